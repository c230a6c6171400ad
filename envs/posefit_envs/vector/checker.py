"""Does a vector environment do what single ones do? A checker for anyone's, since Gymnasium has none."""

import copy
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv


def check_vector_env(
    vector: VectorEnv[Any, Any, Any], make: Callable[[], gym.Env[Any, Any]], steps: int = 50, seed: int = 0
) -> None:
    """Return nothing. Raises AssertionError where a vector environment and single ones from `make` come apart.

    Spaces, observations, rewards, ends, infos with their masks and the automatic reset are compared, step by step, with
    the same actions; environment i is seeded with `seed` + i. What was returned must not change in the next step.
    `vector` has just been made, and its autoreset mode must be NEXT_STEP or SAME_STEP.
    """
    n = vector.num_envs
    singles = [make() for _ in range(n)]
    mode = vector.metadata.get("autoreset_mode")
    assert mode in (AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP), f"autoreset_mode must be declared, got {mode!r}"
    for name in ("observation_space", "action_space"):
        theirs, ours = getattr(singles[0], name), getattr(vector, f"single_{name}")
        assert theirs == ours, f"single_{name} must be {theirs}, got {ours}"
    observations, infos = vector.reset(seed=seed)
    assert observations in vector.observation_space, "reset must return observations of the observation space"
    for i, single in enumerate(singles):
        observation, info = single.reset(seed=seed + i)
        _same(f"environment {i}, reset: observation", part_of(observations, i), observation)
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
            if ended[i]:  # NEXT_STEP: this step resets, and its action counts for nothing
                observation, info = single.reset()
                reward, ends, cut = 0.0, False, False
            else:
                observation, reward, ends, cut, info = single.step(actions[i])  # type: ignore[assignment]
            if mode == AutoresetMode.SAME_STEP and (ends or cut):
                _same(f"{where}: final observation", infos["final_obs"][i], observation)
                _same_info(f"{where}: final info", infos["final_info"], info, i)
                observation, info = single.reset()
            _same(f"{where}: observation", part_of(observations, i), observation)
            _same(f"{where}: reward", rewards[i], reward)
            _same(f"{where}: terminated", terminated[i], ends)
            _same(f"{where}: truncated", truncated[i], cut)
            _same_info(where, infos, info, i)
            ended[i] = (ends or cut) and mode == AutoresetMode.NEXT_STEP
    vector.close()
    vector.close()
    for single in singles:
        single.close()


def part_of(observations: Any, i: int) -> Any:
    """Return what environment i observes, of observations (n, ...); of a Dict, by name."""
    return {name: one[i] for name, one in observations.items()} if isinstance(observations, dict) else observations[i]


def _same_later(where: str, now: Any, then: Any) -> None:
    """Compare what was returned a step ago, observations and infos, with its copy."""
    _same(f"{where}: the observations before it", now[0], then[0])
    for key, value in then[1].items():
        if not key.startswith(("final_", "_final_")):  # objects, which a reset makes anew
            _same(f"{where}: the info {key} before it", now[1][key], value)


def _same(where: str, ours: Any, theirs: Any) -> None:
    if isinstance(theirs, dict):
        assert ours.keys() == theirs.keys(), f"{where} must have {sorted(theirs)}, got {sorted(ours)}"
        for name, one in theirs.items():
            _same(f"{where} {name}", ours[name], one)
        return
    assert np.array_equal(np.asarray(ours), np.asarray(theirs)), f"{where} must be {theirs}, got {ours}"


def _same_info(where: str, infos: dict[str, Any], info: dict[str, Any], i: int) -> None:
    masks = {key: np.asarray(infos[f"_{key}"]) for key in infos if f"_{key}" in infos}
    present = {key for key, mask in masks.items() if mask[i] and key not in ("final_obs", "final_info")}
    assert present == set(info), f"{where}: info must have {sorted(info)}, got {sorted(present)}"
    for key, value in info.items():
        _same(f"{where}: info {key}", infos[key][i], value)
