"""A checker of vector environments, of which Gymnasium has none: whether they do what single ones do."""

import copy
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import iterate

FINAL = ("final_obs", "final_info")


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
    rows = list(iterate(vector.observation_space, observations))
    for i, single in enumerate(singles):
        observation, info = single.reset(seed=seed + i)
        own = {"observation": rows[i], "info": _info(infos, i)}
        _same(f"environment {i}, reset:", own, {"observation": observation, "info": info})
    ended = np.zeros(n, dtype=bool)
    vector.action_space.seed(seed)
    for step in range(steps):
        actions = vector.action_space.sample()
        before, kept = (observations, infos), copy.deepcopy((observations, infos))
        observations, rewards, terminated, truncated, infos = vector.step(actions)
        assert observations in vector.observation_space, f"step {step}: observations must lie in the observation space"
        _same(f"step {step}: the observations before it", before[0], kept[0])
        for key in [key for key in kept[1] if not key.startswith(("final_", "_final_"))]:  # a reset replaces those
            _same(f"step {step}: the info {key} before it", before[1][key], kept[1][key])
        rows = list(iterate(vector.observation_space, observations))
        for i, single in enumerate(singles):
            if ended[i]:  # NEXT_STEP: this step resets, and its action is ignored
                observation, info = single.reset()
                reward, ends, cut = 0.0, False, False
            else:
                observation, reward, ends, cut, info = single.step(actions[i])  # type: ignore[assignment]
            own, expected = {}, {}
            if mode == AutoresetMode.SAME_STEP and (ends or cut):
                own = {"final": infos["final_obs"][i], "final info": _info(infos["final_info"], i)}
                expected = {"final": observation, "final info": info}
                observation, info = single.reset()
            own |= {"observation": rows[i], "reward": rewards[i]}
            own["info"] = _info(infos, i)
            expected |= {"observation": observation, "reward": reward, "info": info}
            own |= {"terminated": terminated[i], "truncated": truncated[i]}
            _same(f"environment {i}, step {step}:", own, expected | {"terminated": ends, "truncated": cut})
            ended[i] = (ends or cut) and mode == AutoresetMode.NEXT_STEP
    vector.close()
    vector.close()
    for single in singles:
        single.close()


def _same(where: str, own: Any, expected: Any) -> None:
    if isinstance(expected, dict):
        assert own.keys() == expected.keys(), f"{where} must have {sorted(expected)}, got {sorted(own)}"
        for name, value in expected.items():
            _same(f"{where} {name}", own[name], value)
        return
    assert np.array_equal(np.asarray(own), np.asarray(expected)), f"{where} must be {expected}, got {own}"


def _info(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """Return what the masks of infos say that environment i has."""
    return {key: infos[key][i] for key in infos if f"_{key}" in infos and infos[f"_{key}"][i] and key not in FINAL}
