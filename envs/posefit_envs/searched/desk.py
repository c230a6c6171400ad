"""An environment, or a vector of them, as what costs proposals."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import Env, error
from gymnasium.vector import VectorEnv

from posefit import SearchSpace
from posefit.arrays import Array
from posefit_envs.fit import FitEnv
from posefit_envs.policies import PROPOSED
from posefit_envs.proposing.single import ProposalEnv
from posefit_envs.vector.fit import FitVectorEnv
from posefit_envs.vector.proposing import ProposalVectorEnv


class Desk:
    """`posefit/Fit-v0` or `Fit-v1`, single or in a vector. Raises gymnasium.error.Error for another environment.

    An episode that ends begins anew with the same instance, so that proposals are costed as long as somebody asks.
    """

    def __init__(self, env: VectorEnv[Any, Any, Any] | Env[Any, Any], dtype: Any) -> None:
        self._env, self._dtype = env, dtype
        self._bare: Any = env.unwrapped
        self._several = isinstance(env, VectorEnv)
        self.count = env.num_envs if isinstance(env, VectorEnv) else 1
        if not isinstance(self._bare, FitEnv | FitVectorEnv | ProposalEnv | ProposalVectorEnv):
            raise error.Error(f"env must be posefit/Fit-v0 or Fit-v1, got {type(self._bare).__name__}")
        self._whole = isinstance(self._bare, ProposalEnv | ProposalVectorEnv)  # Fit-v1 is told to go all the way
        self._numbers: list[int] = []

    def begin(self, seed: int, instance: int | Sequence[int] | None) -> list[int]:
        """Reset with an instance for all or for each, or with drawn ones; return their numbers."""
        options = {} if instance is None else {"options": {"instance": instance}}
        _, info = self._env.reset(seed=seed, **options)
        self._numbers = np.atleast_1d(info["instance"]).tolist()
        return self._numbers

    def space(self, i: int) -> SearchSpace:
        """Return the space that environment i searches."""
        found: SearchSpace = self._bare.search_spaces[i] if self._several else self._bare.search_space
        return found

    def step(self, proposals: Array) -> Array:
        """Return what a proposal in each environment costs, of proposals (n, d)."""
        actions = proposals.astype(self._dtype)
        if self._whole:
            actions = np.append(actions, np.full((len(actions), 1), PROPOSED, dtype=self._dtype), axis=1)
        if not self._several:
            _, _, ended, cut, info = self._env.step(actions[0])
            if ended or cut:
                self._env.reset(options={"instance": self._numbers[0]})
            return np.array([info["cost"]])
        _, _, terminated, truncated, infos = self._env.step(actions)
        costs: Array = np.array(infos["cost"])
        done = np.asarray(terminated) | np.asarray(truncated)
        if done.any():
            self._env.reset(options={"reset_mask": done, "instance": self._numbers})
        return costs

    def costs(self, proposals: Array) -> Array:
        """Return what proposals (m, d) cost, any number of them, in environments of one instance."""
        found = np.empty(len(proposals))
        for first in range(0, len(proposals), self.count):
            rows = proposals[first : first + self.count]
            filling = np.repeat(rows[-1:], self.count - len(rows), axis=0)
            found[first : first + self.count] = self.step(np.concatenate([rows, filling]))[: len(rows)]
        return found
