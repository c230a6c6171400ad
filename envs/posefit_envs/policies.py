"""Rollouts of policies, trained ones, and readable observations of Race-v1.

A policy is called with an observation and the step's number. It returns an action.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv

from posefit.arrays import Array
from posefit.fitting.check import one_of
from posefit_envs.race import COMMON_FEATURES, SEARCH_FEATURES
from posefit_envs.rows import AnyEnv, rows_of
from posefit_envs.world import checked

Policy = Callable[[Any, int], Array]
TRAINED = Path(__file__).parent / "trained"


def trained_policy(name: str = "fit-image") -> Policy:
    """Return a policy that has learned FitImage-v1; it needs NumPy alone.

    Args:
        name: The name of a file in the folder `trained`. The card of the same name
            says what the policy was trained on, how well it does, and how it was made.

    Returns:
        The policy. It takes observations of `Corrections`, and returns its actions.

    Raises:
        ArgumentError: There is no policy of that name.

    Example:
        >>> import gymnasium as gym
        >>> from posefit_envs import Corrections, trained_policy
        >>> env = gym.make_vec("posefit_envs:posefit/FitImage-v1", 3, split="test")
        >>> env = Corrections(env)
        >>> observations, _ = env.reset(options={"instance": [10_000, 10_001, 10_002]})
        >>> trained_policy("fit-image")(observations, 0).shape
        (3, 9)
    """
    names = sorted(path.stem for path in TRAINED.glob("*.npz"))
    checked(one_of, "name", name, names)
    with np.load(TRAINED / f"{name}.npz") as file:
        arrays = [np.asarray(file[key], dtype=np.float32) for key in file.files]
    layers = list(zip(arrays[::2], arrays[1::2], strict=True))

    def policy(observations: Any, _: int) -> Array:
        values = np.asarray(observations, dtype=np.float32)
        for weights, biases in layers[:-1]:
            values = np.maximum(values @ weights + biases, 0.0)
        weights, biases = layers[-1]
        return np.asarray(values @ weights + biases, dtype=np.float64)

    return policy


def rollout(
    env: AnyEnv,
    policy: Policy,
    instance: int | Sequence[int],
    seed: int,
) -> Any:
    """Return the last infos of a policy's episode, with its actions and rewards.

    The infos gain `actions` (k, d) and `rewards` (k,). For a vector, in any autoreset
    mode, the result is a list, with an element for each environment. An environment
    whose episode has ended begins again until all others have ended.

    Args:
        env: An environment or a vector.
        policy: The policy; in a vector it gets the observations of all environments.
        instance: The instance's number, or a list with one for each environment.
        seed: The seed; environment i of a vector has `seed` + i.
    """
    rows = rows_of(env)
    numbers: Any = instance
    if isinstance(instance, int | np.integer):
        numbers = [instance] * rows.count
    options = [{"instance": number} for number in numbers]
    seeds = list(range(seed, seed + rows.count))
    vector = isinstance(env, VectorEnv)
    actions: list[Array] = []
    rewards: list[Array] = []
    episodes: dict[int, dict[str, Any]] = {}
    observations, _ = rows.reset(seeds, options)
    while len(episodes) < rows.count:
        shown = observations if vector else observations[0]
        action = np.asarray(policy(shown, len(actions)))
        actions.append(action if vector else action[None])
        observations, reward, ended, infos = rows.step(actions[-1])
        rewards.append(reward)
        for i in np.flatnonzero(ended).tolist():
            # an environment that has begun again only waits for the others
            if i in episodes:
                continue
            own_actions = np.array([step[i] for step in actions])  # (k, d)
            own_rewards = np.array([float(step[i]) for step in rewards])  # (k,)
            own = {"actions": own_actions, "rewards": own_rewards}
            episodes[i] = infos[i] | own
        if ended.any() and len(episodes) < rows.count:
            observations, _ = rows.reset(None, options, ended)
    if vector:
        return [episodes[i] for i in range(rows.count)]
    return episodes[0]


def race_features(observation: Any) -> tuple[Array, Array]:
    """Return the features (..., k, 4) of k searches, and the common ones (..., 3).

    They are read from observations (..., 4 k + 3) of Race-v1. The features of a
    search are its best cost, slope, spread and share of the budget used. The common
    features are the best cost of all, the budget left and the budget.
    """
    shown = np.asarray(observation, dtype=np.float64)
    each = shown[..., :-COMMON_FEATURES]
    features = each.reshape(
        *shown.shape[:-1], SEARCH_FEATURES, each.shape[-1] // SEARCH_FEATURES
    )
    return features.swapaxes(-1, -2), shown[..., -COMMON_FEATURES:]


def race_action(choice: Any, searches: int) -> Array:
    """Return actions (..., searches + 1) of Race-v1 that make the choices (...).

    A choice is a whole number from 0 to `searches`.
    """
    # 1 for the choice, and -1 for all others
    return np.asarray(2.0 * np.eye(searches + 1)[np.asarray(choice)] - 1.0)
