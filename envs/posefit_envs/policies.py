"""Policies on environments: an episode of one, and what observations and actions of Race-v0 mean.

A policy is called with an observation and the number of the step, and returns an action.
"""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

from posefit.arrays import Array
from posefit_envs.race import COMMON_FEATURES, SEARCH_FEATURES

Policy = Callable[[Any, int], Array]


def rollout(
    env: gym.Env[Any, Any], policy: Policy, instance: int, seed: int
) -> dict[str, Any]:
    """Return the last info of an episode of a policy on an instance, with its `actions` (k, d) and `rewards` (k,)."""
    observation, info = env.reset(seed=seed, options={"instance": instance})
    actions: list[Array] = []
    rewards = []
    ended = False
    cut = False
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
    features = each.reshape(
        *shown.shape[:-1], SEARCH_FEATURES, each.shape[-1] // SEARCH_FEATURES
    )
    return features.swapaxes(-1, -2), shown[..., -COMMON_FEATURES:]


def race_action(choice: Any, searches: int) -> Array:
    """Return the actions (..., searches + 1) of Race-v0 that make choices (...), whole numbers from 0 to searches."""
    return np.asarray(2.0 * np.eye(searches + 1)[np.asarray(choice)] - 1.0)
