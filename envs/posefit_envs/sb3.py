"""Adapts Gymnasium's vector environments to Stable-Baselines3."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import error
from gymnasium.vector import AutoresetMode, VectorEnv

from posefit_envs.base import mixed
from posefit_envs.rows import VectorRows

if TYPE_CHECKING:
    from stable_baselines3.common.vec_env import VecEnv


def to_sb3_vec_env(vector: VectorEnv[Any, Any, Any]) -> "VecEnv":
    """Return the environment as a `VecEnv` of Stable-Baselines3.

    Stable-Baselines3 resets an environment in the step that ends its episode, and puts
    the last observation into `info["terminal_observation"]`. Every autoreset mode can
    be adapted. Under NEXT_STEP and DISABLED, `vector` must be able to reset some of its
    environments by `options={"reset_mask": ...}`; the vectors of this package and of
    Gymnasium can.

    Options are per environment, and attributes are read per environment. Attributes are
    set, and methods called, for all environments together.

    Args:
        vector: The vector environment.

    Returns:
        The environment for Stable-Baselines3.

    Raises:
        gymnasium.error.DependencyNotInstalled: Without Stable-Baselines3.

    Example:
        >>> import gymnasium as gym
        >>> from posefit_envs import to_sb3_vec_env
        >>> many = gym.make_vec("posefit_envs:posefit/FitImage-v1", num_envs=4)
        >>> to_sb3_vec_env(many).num_envs
        4
    """
    try:
        from stable_baselines3.common.vec_env import VecEnv
    except ImportError:
        raise error.DependencyNotInstalled(
            "to_sb3_vec_env needs Stable-Baselines3: "
            "python -m pip install stable-baselines3"
        ) from None
    rows = VectorRows(vector)
    no_options: list[dict[str, Any]] = [{} for _ in range(rows.count)]

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
            observations, self.reset_infos = rows.reset(self._seeds, self._options)
            self._reset_seeds()
            self._reset_options()
            return observations

        def step_async(self, actions: Any) -> None:
            self._actions = actions

        def step_wait(self) -> Any:
            observations, rewards, done, infos = rows.step(self._actions)
            infos = [dict(info) for info in infos]
            for info, truncated in zip(infos, rows.truncated.tolist(), strict=True):
                info["TimeLimit.truncated"] = truncated
            if done.any():
                for i in np.flatnonzero(done).tolist():
                    infos[i]["terminal_observation"] = observations[i].copy()
                fresh, fresh_infos = rows.begun
                if rows.mode is not AutoresetMode.SAME_STEP:
                    fresh, fresh_infos = rows.reset(None, no_options, done)
                # its learners expect the first picture of the next episode here
                observations = mixed(done, fresh, observations)
                for i in np.flatnonzero(done).tolist():
                    self.reset_infos[i] = fresh_infos[i]
            return observations, rewards.astype(np.float32), done, infos

        def close(self) -> None:
            vector.close()

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
            values = rows.attribute(attr_name)
            return [values[i] for i in self._get_indices(indices)]

        def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
            self._check_all(indices)
            base: Any = vector.unwrapped
            base.set_attr(attr_name, [value] * self.num_envs)

        def env_method(
            self, method_name: str, *arguments: Any, indices: Any = None, **named: Any
        ) -> list[Any]:
            self._check_all(indices)
            base: Any = vector.unwrapped
            return list(base.call(method_name, *arguments, **named))

        def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
            return [False] * len(list(self._get_indices(indices)))

        def get_images(self) -> Sequence[Any]:
            return list(vector.render() or [None] * self.num_envs)

        # the wrapped vector sets and calls for all environments at once
        def _check_all(self, indices: Any) -> None:
            chosen = sorted(set(self._get_indices(indices)))
            if chosen != list(range(self.num_envs)):
                raise error.Error(
                    f"indices must be all of the {self.num_envs} environments, "
                    f"got {chosen}"
                )

    return Adapted()
