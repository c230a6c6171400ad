"""Hands a vector environment of Gymnasium to Stable-Baselines3, which has its own kind."""

from collections.abc import Sequence
from copy import deepcopy
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import error
from gymnasium.vector import AutoresetMode, VectorEnv

from posefit_envs.vector.checker import part_of

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv


def to_sb3_vec_env(vector: VectorEnv[Any, Any, Any]) -> "VecEnv":
    """Return the environment as a `VecEnv` of Stable-Baselines3.

    Stable-Baselines3 wants an environment to reset in the very step that ends its episode, with what was seen last in
    `info["terminal_observation"]`. So `vector` has to be one that can reset some of its environments, by
    `options={"reset_mask": ...}`, as those of this package can. Raises gymnasium.error.DependencyNotInstalled without
    Stable-Baselines3.
    """
    try:
        from stable_baselines3.common.vec_env import VecEnv
    except ImportError:
        raise error.DependencyNotInstalled(
            "to_sb3_vec_env needs Stable-Baselines3: python -m pip install stable-baselines3"
        ) from None
    if vector.metadata.get("autoreset_mode") != AutoresetMode.NEXT_STEP:
        raise error.Error(f"autoreset_mode must be NEXT_STEP, got {vector.metadata.get('autoreset_mode')}")

    class Adapted(VecEnv):
        def __init__(self) -> None:
            self._actions: Any = None
            self._seeds: Any = None
            super().__init__(vector.num_envs, vector.single_observation_space, vector.single_action_space)

        def reset(self) -> Any:
            observations, infos = vector.reset(seed=self._seed_list(), options=self._one_for_all())
            self.reset_infos = [_row(infos, i) for i in range(self.num_envs)]
            self._reset_seeds()
            self._reset_options()
            return observations

        def _seed_list(self) -> Any:
            return None if all(seed is None for seed in self._seeds) else list(self._seeds)

        def _one_for_all(self) -> Any:
            return self._options[0] or None

        def step_async(self, actions: Any) -> None:
            self._actions = actions

        def step_wait(self) -> Any:
            observations, rewards, terminated, truncated, infos = vector.step(self._actions)
            rows = [_row(infos, i) for i in range(self.num_envs)]
            done = terminated | truncated
            if done.any():
                for i in np.flatnonzero(done):
                    rows[i]["terminal_observation"] = deepcopy(part_of(observations, int(i)))
                    rows[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
                fresh, fresh_infos = vector.reset(options={"reset_mask": done})
                observations = _mixed(done, fresh, observations)
                for i in np.flatnonzero(done):
                    self.reset_infos[i] = _row(fresh_infos, int(i))
            return observations, rewards.astype(np.float32), done, rows

        def close(self) -> None:
            vector.close()

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
            return [getattr(vector, attr_name)] * len(self._chosen(indices))

        def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
            setattr(vector, attr_name, value)

        def env_method(self, method_name: str, *arguments: Any, indices: Any = None, **named: Any) -> list[Any]:
            return [getattr(vector, method_name)(*arguments, **named)] * len(self._chosen(indices))

        def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
            return [False] * len(self._chosen(indices))

        def get_images(self) -> Sequence[Any]:
            return list(vector.render() or [None] * self.num_envs)

        def _chosen(self, indices: Any) -> Sequence[int]:
            return list(self._get_indices(indices))

    return Adapted()


def _mixed(mask: Any, these: Any, others: Any) -> Any:
    """Return observations (n, ...), these where the mask (n,) is true and others elsewhere; of a Dict, by name."""
    if isinstance(these, dict):
        return {name: _mixed(mask, one, others[name]) for name, one in these.items()}
    return np.where(mask.reshape(-1, *[1] * (these.ndim - 1)), these, others)


def _row(infos: dict[str, Any], i: int) -> dict[str, Any]:
    """Return the info of one environment."""
    return {
        key: values[i]
        for key, values in infos.items()
        if not key.startswith("_") and np.asarray(infos.get(f"_{key}", np.ones(i + 1, dtype=bool)))[i]
    }
