"""Fit-v0 for many environments at once: a proposal in each is one compiled call, whatever their instances."""

from typing import Any, Unpack

import numpy as np

from posefit import PoseProblem
from posefit.arrays import Array
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import MAX_EVALUATIONS, TARGET_COST, Episode, check_budget, spaces_of
from posefit_envs.instance import Arguments, select
from posefit_envs.search import Image
from posefit_envs.stage import Evaluated
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class FitVectorEnv(SearchVectorEnv[Episode]):
    """`num_envs` environments as `posefit_envs.fit.FitEnv`, with the same arguments.

    So many `threads` draw; it is one unless somebody says otherwise, and changes nothing but the time.
    Seeded with s, environment i does what a single one does that is seeded with s + i. The step after an episode's last
    one resets, as `AutoresetMode.NEXT_STEP` says.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        target_cost: float = TARGET_COST,
        max_evaluations: int = MAX_EVALUATIONS,
        threads: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_budget(target_cost, "max_evaluations", max_evaluations)
        selection = select(**arguments)
        super().__init__(num_envs, selection, spaces_of(selection.world), threads, render_mode, max_episode_steps)
        self._target, self._most = float(target_cost), int(max_evaluations)
        self._best = np.full(num_envs, np.inf)
        self._last: Evaluated | None = None

    @property
    def problems(self) -> list[PoseProblem]:
        """The problem that each environment's proposals are evaluated on."""
        return [episode.scenery.problem(episode.space) for episode in self._current()]

    def step(self, actions: Any) -> tuple[Image, Array, Flags, Flags, Infos]:
        """Propose a pose in each environment; one whose episode has ended resets instead."""
        proposals = self._door.proposals(actions, self._shape)
        stepping = self._renew_ended()
        seen = self._last = self._stage.look(proposals, np.flatnonzero(stepping))
        np.minimum(self._best, seen.costs, out=self._best, where=stepping)
        terminated = stepping & (self._best <= self._target)
        truncated = self._ends(stepping, terminated, ~terminated & (self._steps >= self._most))
        values = {"cost": seen.costs, "areas": seen.areas}
        values |= self._standings(self._best.copy(), self._steps.copy(), lambda: seen.poses)
        infos = masked(stepping, values, {"instance": self._numbers})
        return seen.pictures, np.where(stepping, -seen.costs, 0.0), terminated, truncated, infos

    def _begin(self, i: int, number: int) -> None:
        episode = self._searches[i] = Episode(self.world, number, self._most)
        self._put(i, episode)
        self._best[i] = np.inf

    def _opened(self, begun: Flags) -> tuple[Image, Infos]:
        return self._stage.pictures(), {"instance": self._numbers.copy()}

    def _portrait(self, i: int, search: Episode) -> Picture:
        last = self._last
        if not self._steps[i] or last is None:
            return portray(search.scenery, None, None, search.label)
        label = f"cost {last.costs[i]:.1f}, best {self._best[i]:.1f}, {self._steps[i]} evaluations"
        return portray(search.scenery, last.poses[i], last.translations[i], label)
