"""Fit-v0 for many environments at once: a proposal in each is one compiled call, whatever their instances."""

from typing import Any, Unpack

import numpy as np
from gymnasium import error

from posefit import PoseProblem, SearchSpace
from posefit.arrays import Array
from posefit.fitting.metrics import pose_error_degrees
from posefit.geometry.skeleton import ANGLES
from posefit_envs.drawing import portray
from posefit_envs.fit import MAX_EVALUATIONS, TARGET_COST, Episode, check_budget, spaces_of
from posefit_envs.instance import Arguments, select
from posefit_envs.search import Image
from posefit_envs.stage import Evaluated
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class FitVectorEnv(SearchVectorEnv):
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
        self._episodes: list[Episode | None] = [None] * num_envs
        self._truths, self._best = np.empty((num_envs, ANGLES)), np.full(num_envs, np.inf)
        self._last: Evaluated | None = None

    @property
    def search_spaces(self) -> list[SearchSpace]:
        """The space of each environment's instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return [episode.space for episode in self._current()]

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
        # a time limit of Gymnasium's cuts an episode that ends by itself, too
        truncated = stepping & ((self._steps >= self._longest) | (~terminated & (self._steps >= self._most)))
        self._ended = terminated | truncated
        values: Infos = {
            "cost": seen.costs,
            "best_cost": self._best.copy(),
            "evaluations": self._steps.copy(),
            "areas": seen.areas,
            "instance": self._numbers.copy(),
        }
        if self._selection.errors:
            values["error_degrees"] = pose_error_degrees(self._truths, seen.poses)
        infos = masked(stepping, values, {"instance": self._numbers})
        return seen.pictures, np.where(stepping, -seen.costs, 0.0), terminated, truncated, infos

    def _begin(self, i: int, number: int) -> None:
        episode = self._episodes[i] = Episode(self.world, number, self._most)
        self._stage.put(i, episode.scenery, episode.space)
        self._truths[i], self._best[i] = episode.instance.truth.poses[0], np.inf

    def _opened(self, begun: Flags) -> tuple[Image, Infos]:
        return self._stage.pictures(), {"instance": self._numbers.copy()}

    def render(self) -> Any:
        """Return a tuple of pictures (height, width, 3), one an environment, where `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        shown = []
        for i, episode in enumerate(self._current()):
            if self._steps[i] and self._last is not None:
                label = f"cost {self._last.costs[i]:.1f}, best {self._best[i]:.1f}, {self._steps[i]} evaluations"
                shown.append(portray(episode.scenery, self._last.poses[i], self._last.translations[i], label))
            else:
                shown.append(portray(episode.scenery, None, None, episode.label))
        return tuple(shown)

    def _current(self) -> list[Episode]:
        episodes = [episode for episode in self._episodes if episode is not None]
        if len(episodes) < self.num_envs:
            raise error.ResetNeeded("reset must come before anything else")
        return episodes
