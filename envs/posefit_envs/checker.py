"""A checker of vector environments, of which Gymnasium has none: whether they do what single ones do."""

import copy
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from posefit_envs.base import row_of


def check_vector_env(
    vector: VectorEnv[Any, Any, Any], make: Callable[[], gym.Env[Any, Any]], steps: int = 50, seed: int = 0
) -> None:
    """Return nothing. Raises AssertionError where a vector environment and single ones from `make` differ.

    Spaces, observations, rewards, ends, infos with their masks and the automatic reset are compared, step by step, with
    the same actions; environment i is seeded with `seed` + i. Returned values must not change in the next step.
    `vector` has just been made, and its autoreset mode must be NEXT_STEP or SAME_STEP.
    """
    n = vector.num_envs
    singles = [make() for _ in range(n)]
    mode = vector.metadata.get("autoreset_mode")
    assert mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP), f"autoreset_mode must be declared, got {mode!r}"
    for name in ("observation_space", "action_space"):
        expected, own = getattr(singles[0], name), getattr(vector, f"single_{name}")
        assert expected == own, f"single_{name} must be {expected}, got {own}"
    observations, infos = vector.reset(seed=seed)
    assert observations in vector.observation_space, "reset must return observations of the observation space"
    for i, single in enumerate(singles):
        observation, info = single.reset(seed=seed + i)
        _same(f"environment {i}, reset: observation", row_of(observations, i), observation)
        _same_info(f"environment {i}, reset", infos, info, i)
    ended = np.zeros(n, dtype=bool)
    vector.action_space.seed(seed)
    for step in range(steps):
        actions = vector.action_space.sample()
        returned = (observations, infos), copy.deepcopy((observations, infos))
        observations, rewards, terminated, truncated, infos = vector.step(actions)
        assert observations in vector.observation_space, f"step {step}: observations must lie in the observation space"
        _same_later(f"step {step}", *returned)
        for i, single in enumerate(singles):
            where = f"environment {i}, step {step}"
            if ended[i]:  # NEXT_STEP: this step resets, and its action is ignored
                observation, info = single.reset()
                reward, ends, cut = 0.0, False, False
            else:
                observation, reward, ends, cut, info = single.step(actions[i])  # type: ignore[assignment]
            if mode == AutoresetMode.SAME_STEP and (ends or cut):
                _same(f"{where}: final observation", infos["final_obs"][i], observation)
                _same_info(f"{where}: final info", infos["final_info"], info, i)
                observation, info = single.reset()
            _same(f"{where}: observation", row_of(observations, i), observation)
            _same(f"{where}: reward", rewards[i], reward)
            _same(f"{where}: terminated", terminated[i], ends)
            _same(f"{where}: truncated", truncated[i], cut)
            _same_info(where, infos, info, i)
            ended[i] = (ends or cut) and mode == AutoresetMode.NEXT_STEP
    vector.close()
    vector.close()
    for single in singles:
        single.close()


def _same_later(where: str, now: Any, before: Any) -> None:
    """Compare the observations and infos of the step before with their copies."""
    _same(f"{where}: the observations before it", now[0], before[0])
    for key, value in before[1].items():
        if not key.startswith(("final_", "_final_")):  # objects, which a reset replaces
            _same(f"{where}: the info {key} before it", now[1][key], value)


def _same(where: str, own: Any, expected: Any) -> None:
    if isinstance(expected, dict):
        assert own.keys() == expected.keys(), f"{where} must have {sorted(expected)}, got {sorted(own)}"
        for name, value in expected.items():
            _same(f"{where} {name}", own[name], value)
        return
    assert np.array_equal(np.asarray(own), np.asarray(expected)), f"{where} must be {expected}, got {own}"


def _same_info(where: str, infos: dict[str, Any], info: dict[str, Any], i: int) -> None:
    masks = {key: np.asarray(infos[f"_{key}"]) for key in infos if f"_{key}" in infos}
    present = {key for key, mask in masks.items() if mask[i] and key not in ("final_obs", "final_info")}
    assert present == set(info), f"{where}: info must have {sorted(info)}, got {sorted(present)}"
    for key, value in info.items():
        _same(f"{where}: info {key}", infos[key][i], value)
