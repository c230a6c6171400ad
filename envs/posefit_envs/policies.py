"""References as policies: random actions, and races.

A policy is called with an observation and the number of the step, and returns an action.
"""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from posefit.arrays import Array
from posefit_envs.race import COMMON_FEATURES, SEARCH_FEATURES

Policy = Callable[[Any, int], Array]


def uniform_policy(env: gym.Env[Any, Any], rng: np.random.Generator) -> Policy:
    """Return the policy that draws actions uniformly from an environment's box."""
    shape = env.action_space.shape
    return lambda _, __: rng.uniform(-1.0, 1.0, shape)


def rollout(env: gym.Env[Any, Any], policy: Policy, instance: int, seed: int) -> dict[str, Any]:
    """Return the last info of an episode of a policy on an instance, with its `actions` (k, d) and `rewards` (k,)."""
    observation, info = env.reset(seed=seed, options={"instance": instance})
    actions: list[Array] = []
    rewards, ended, cut = [], False, False
    while not (ended or cut):
        actions.append(policy(observation, len(actions)))
        observation, reward, ended, cut, info = env.step(actions[-1])
        rewards.append(float(reward))
    return info | {"actions": np.array(actions), "rewards": np.array(rewards)}


def race_features(observation: Any) -> tuple[Array, Array]:
    """Return what observations (..., 4 k + 3) of Race-v0 show of its k searches (..., k, 4), and in common (..., 3).

    Of a search: best cost, slope, spread and share of the budget used; in common: best cost, budget left, budget.
    """
    shown = np.asarray(observation, dtype=np.float64)
    each = shown[..., :-COMMON_FEATURES]
    features = each.reshape(*shown.shape[:-1], SEARCH_FEATURES, each.shape[-1] // SEARCH_FEATURES)
    return features.swapaxes(-1, -2), shown[..., -COMMON_FEATURES:]


def race_action(choice: Any, searches: int) -> Array:
    """Return the actions (..., searches + 1) of Race-v0 that make choices (...), whole numbers from 0 to searches."""
    return np.asarray(2.0 * np.eye(searches + 1)[np.asarray(choice)] - 1.0)


def round_robin_policy() -> Policy:
    """Return the policy of Race-v0 whose searches take turns."""

    def act(observation: Any, step: int) -> Array:
        features, _ = race_features(observation)
        searches: int = features.shape[-2]
        return race_action(np.full(features.shape[:-2], step % searches), searches)

    return act


def restarted_policy(slope: float = 0.05) -> Policy:
    """Return the policy of Race-v0 that advances one search until it shows a slope below `slope`, and then another.

    The next one is a search that never was advanced, or where there is none, one that begins.
    """

    def act(observation: Any, _: int) -> Array:
        features = race_features(observation)[0]
        open_ones = features[..., 1] >= slope
        longest = np.where(open_ones, features[..., 3], -1.0).argmax(axis=-1)
        searches = features.shape[-2]
        return race_action(np.where(open_ones.any(axis=-1), longest, searches), searches)

    return act


def halving_policy() -> Policy:
    """Return successive halving as a policy of Race-v0: after each of equal parts of the budget the worse half stops.

    Those that are left take turns. K. Jamieson, A. Talwalkar, Non-stochastic best arm identification and
    hyperparameter optimization, AISTATS 2016.
    """

    def act(observation: Any, _: int) -> Array:
        features, common = race_features(observation)
        searches = features.shape[-2]
        parts = int(np.log2(searches)) + 1
        done = np.minimum(np.floor(parts * (1.0 - common[..., 1]) + 1e-6), parts - 1)  # float32 shows the budget
        ranks = features[..., 0].argsort(axis=-1, kind="stable").argsort(axis=-1)
        left = ranks < searches // 2.0 ** done[..., None]
        return race_action(np.where(left, features[..., 3], np.inf).argmin(axis=-1), searches)

    return act


def bandit_policy(curiosity: float = 0.4) -> Policy:
    """Return UCB1 as a policy of Race-v0: the lowest best cost, less what a search may gain that had few generations.

    That is `curiosity` times the root of ln(generations of all) / generations, in shown costs. It begins no search.
    P. Auer, N. Cesa-Bianchi, P. Fischer, Finite-time analysis of the multiarmed bandit problem, Machine Learning 47,
    2002, whose rewards are means and not bests.
    """

    def act(observation: Any, step: int) -> Array:
        features, _ = race_features(observation)
        searches, used = int(features.shape[-2]), np.asarray(features[..., 3])
        total = step + searches
        generations = used / used.sum(axis=-1, keepdims=True) * total
        index = features[..., 0] - curiosity * np.sqrt(np.log(total) / generations)
        return race_action(index.argmin(axis=-1), searches)

    return act


def linear_policy(weights: Any) -> Policy:
    """Return the policy of Race-v0 with the choice of the highest score, linear in what is shown of a search.

    `weights` (..., 9), one policy or one for each row of observations: of four numbers, of these times the budget left,
    and the score of another search. The numbers are the best cost above the best of all, slope, spread and use.
    """
    own = np.asarray(weights, dtype=np.float64)

    def act(observation: Any, _: int) -> Array:
        features, common = race_features(observation)
        features[..., 0] -= common[..., :1]
        shown = np.concatenate([features, features * common[..., 1, None, None]], axis=-1)
        scores = (shown @ own[..., :-1, None])[..., 0]
        another = np.broadcast_to(own[..., -1:], (*scores.shape[:-1], 1))
        choice = np.concatenate([scores, another], axis=-1).argmax(axis=-1)
        return race_action(choice, scores.shape[-1])

    return act
