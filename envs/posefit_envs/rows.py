"""A common interface to single environments and vectors: independent rows.

Each row resets and ends independently, in any autoreset mode. `drive`, `rollout` and
the adapter to Stable-Baselines3 use it. A vector may be one of this package, or
Gymnasium's SyncVectorEnv or AsyncVectorEnv of any environments.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import Env
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.wrappers.vector import DictInfoToList

from posefit_envs.base import Flags, Infos

AnyEnv = VectorEnv[Any, Any, Any] | Env[Any, Any]
Options = Sequence[Mapping[str, Any]]


def rows_of(env: AnyEnv) -> "SingleRow | VectorRows":
    """Return the rows of a vector, or the only row of a single environment."""
    return VectorRows(env) if isinstance(env, VectorEnv) else SingleRow(env)


class SingleRow:
    """A single environment as a vector of one row; see `VectorRows` for the methods."""

    count = 1

    def __init__(self, env: Env[Any, Any]) -> None:
        self._env = env

    def reset(
        self,
        seeds: Sequence[int | None] | None,
        options: Options,
        mask: Flags | None = None,
    ) -> tuple[Any, list[Infos]]:
        """Reset the environment."""
        seed = None if seeds is None else seeds[0]
        observation, info = self._env.reset(seed=seed, options=dict(options[0]))
        return np.asarray(observation)[None], [info]

    def step(self, actions: Any) -> tuple[Any, Any, Flags, list[Infos]]:
        """Step the environment."""
        observation, reward, terminated, truncated, info = self._env.step(actions[0])
        ended = np.array([terminated or truncated])
        return np.asarray(observation)[None], np.array([reward]), ended, [info]

    def attribute(self, name: str) -> list[Any]:
        """Return an attribute of the environment."""
        if name == "action_space":
            return [self._env.action_space]
        return [getattr(self._env.unwrapped, name)]


class VectorRows:
    """A vector environment, row by row. Infos are a list with an element per row."""

    def __init__(self, vector: VectorEnv[Any, Any, Any]) -> None:
        self.count = vector.num_envs
        self.mode = AutoresetMode(vector.metadata["autoreset_mode"])
        self._vector: Any = DictInfoToList(vector)
        self._begun = False
        # the observations and infos of the last step; a row that ended under SAME_STEP
        # already shows its new episode
        self.begun: tuple[Any, list[Infos]] = None, []
        # which rows the last step truncated
        self.truncated = np.zeros(self.count, dtype=bool)

    def reset(
        self,
        seeds: Sequence[int | None] | None,
        options: Options,
        mask: Flags | None = None,
    ) -> tuple[Any, list[Infos]]:
        """Reset some rows, all by default; return observations and infos.

        Each row has separate options and a separate seed. Rows that are not reset keep
        their observations; their infos are meaningless.
        """
        seeds = [None] * self.count if seeds is None else list(seeds)
        waiting = np.ones(self.count, dtype=bool) if mask is None else mask.copy()
        infos: list[Infos] = [{} for _ in range(self.count)]
        observations = None
        # a reset has one set of options, so rows with equal options are reset together
        while waiting.any():
            first = options[int(np.flatnonzero(waiting)[0])]
            alike = waiting & np.array([one == first for one in options])
            chosen = dict(first)
            # a vector's first reset covers all rows; rows with other options are then
            # reset again
            if self._begun:
                chosen["reset_mask"] = alike.copy()
            observations, rows = self._vector.reset(seed=seeds, options=chosen or None)
            self._begun = True
            for i in np.flatnonzero(alike).tolist():
                infos[i] = _plain(rows[i])
            waiting &= ~alike
        return observations, infos

    def step(self, actions: Any) -> tuple[Any, Any, Flags, list[Infos]]:
        """Step all rows; return observations, rewards, which episodes ended, and infos.

        Observations and infos of a row whose episode has ended are the episode's last.
        Reset the row before the next step, in every autoreset mode. Under SAME_STEP
        its next episode has begun already: see `begun`.
        """
        observations, rewards, terminated, truncated, rows = self._vector.step(actions)
        ended = terminated | truncated
        infos = [_plain(row) for row in rows]
        self.truncated = truncated & ~terminated
        self.begun = observations, infos
        if self.mode is AutoresetMode.SAME_STEP and ended.any():
            observations = observations.copy()
            infos = list(infos)
            for i in np.flatnonzero(ended).tolist():
                observations[i] = infos[i]["final_obs"]
                infos[i] = infos[i]["final_info"]
        return observations, rewards, ended, infos

    def attribute(self, name: str) -> list[Any]:
        """Return an attribute of each environment. Raises AttributeError if unknown."""
        if name in ("action_space", "observation_space"):
            return [getattr(self._vector, f"single_{name}")] * self.count
        return list(self._vector.unwrapped.get_attr(name))


def _plain(info: Infos) -> Infos:
    """Return infos with Python's numbers instead of NumPy's."""
    plain: Infos = {}
    for name, value in info.items():
        if isinstance(value, dict):
            plain[name] = _plain(value)
        elif isinstance(value, np.generic):
            plain[name] = value.item()
        else:
            plain[name] = value
    return plain
