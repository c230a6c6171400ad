"""An adapter of Gymnasium's vector environments to those of Stable-Baselines3."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import error
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.wrappers.vector import DictInfoToList

from posefit_envs.base import mixed

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv


def to_sb3_vec_env(vector: VectorEnv[Any, Any, Any]) -> "VecEnv":
    """Return the environment as a `VecEnv` of Stable-Baselines3.

    Stable-Baselines3 resets an environment in the step that ends its episode, with the last observation in
    `info["terminal_observation"]`. So `vector` must be able to reset some of its environments, by
    `options={"reset_mask": ...}`, as those of this package are. Its environments share their attributes and methods, so
    that only all of them together can be set or called. Raises gymnasium.error.DependencyNotInstalled without
    Stable-Baselines3.
    """
    try:
        from stable_baselines3.common.vec_env import VecEnv
    except ImportError:
        raise error.DependencyNotInstalled(
            "to_sb3_vec_env needs Stable-Baselines3: python -m pip install stable-baselines3"
        ) from None
    if vector.metadata.get("autoreset_mode") != AutoresetMode.NEXT_STEP:
        raise error.Error(
            f"autoreset_mode must be NEXT_STEP, got {vector.metadata.get('autoreset_mode')}"
        )

    rows_of: Any = DictInfoToList(vector)

    class Adapted(VecEnv):
        def __init__(self) -> None:
            self._actions: Any = None
            self._seeds: Any = None
            super().__init__(
                vector.num_envs,
                vector.single_observation_space,
                vector.single_action_space,
            )

        def reset(self) -> Any:
            seeds: Any = (
                None if all(seed is None for seed in self._seeds) else list(self._seeds)
            )
            observations, self.reset_infos = rows_of.reset(
                seed=seeds, options=self._options[0] or None
            )
            self._reset_seeds()
            self._reset_options()
            return observations

        def step_async(self, actions: Any) -> None:
            self._actions = actions

        def step_wait(self) -> Any:
            observations, rewards, terminated, truncated, rows = rows_of.step(
                self._actions
            )
            done = terminated | truncated
            if done.any():
                for i in np.flatnonzero(done):
                    rows[i]["terminal_observation"] = observations[i].copy()
                    rows[i]["TimeLimit.truncated"] = bool(
                        truncated[i] and not terminated[i]
                    )
                fresh, fresh_rows = rows_of.reset(options={"reset_mask": done})
                observations = mixed(done, fresh, observations)
                for i in np.flatnonzero(done):
                    self.reset_infos[i] = fresh_rows[i]
            return observations, rewards.astype(np.float32), done, rows

        def close(self) -> None:
            vector.close()

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
            return [getattr(vector, attr_name)] * len(list(self._get_indices(indices)))

        def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
            self._check_all(indices)
            setattr(vector, attr_name, value)

        def env_method(
            self, method_name: str, *arguments: Any, indices: Any = None, **named: Any
        ) -> list[Any]:
            self._check_all(indices)
            return [getattr(vector, method_name)(*arguments, **named)] * self.num_envs

        def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
            return [False] * len(list(self._get_indices(indices)))

        def get_images(self) -> Sequence[Any]:
            return list(vector.render() or [None] * self.num_envs)

        def _check_all(self, indices: Any) -> None:
            chosen = sorted(set(self._get_indices(indices)))
            if chosen != list(range(self.num_envs)):
                raise error.Error(
                    f"indices must be all of the {self.num_envs} environments, got {chosen}"
                )

    return Adapted()
