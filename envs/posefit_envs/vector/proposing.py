"""Fit-v1 for many environments at once: a proposal in each is one compiled call, whatever their instances."""

from typing import Any, Unpack

import numpy as np
from gymnasium import error

from posefit import SearchSpace
from posefit.arrays import Array
from posefit.fitting.metrics import pose_error_degrees
from posefit.geometry.skeleton import ANGLES
from posefit_envs.drawing import portray
from posefit_envs.fit import MAX_EVALUATIONS, Episode
from posefit_envs.instance import Arguments, select
from posefit_envs.proposing.memory import ProposalMemory, seen_with
from posefit_envs.proposing.single import check_proposing, spaces_of_proposing
from posefit_envs.stage import Evaluated
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class ProposalVectorEnv(SearchVectorEnv):
    """`num_envs` environments as `posefit_envs.proposing.single.ProposalEnv`, with the same arguments.

    So many `threads` draw; it is one unless somebody says otherwise, and changes nothing but the time.
    Seeded with s, environment i does what a single one does that is seeded with s + i. The step after an episode's last
    one resets, as `AutoresetMode.NEXT_STEP` says.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        max_evaluations: int = MAX_EVALUATIONS,
        image: bool = False,
        threads: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_proposing(max_evaluations, image)
        selection = select(**arguments)
        spaces = spaces_of_proposing(selection.world, image)
        super().__init__(num_envs, selection, spaces, threads, render_mode, max_episode_steps)
        self._most, self._image, self._dimensions = int(max_evaluations), image, self._shape[1] - 1
        self._episodes: list[Episode | None] = [None] * num_envs
        self._memories = [ProposalMemory(self._dimensions, np.inf, self._most) for _ in range(num_envs)]
        self._truths = np.empty((num_envs, ANGLES))
        self._last: Evaluated | None = None

    @property
    def search_spaces(self) -> list[SearchSpace]:
        """The space of each environment's instance. Raises gymnasium.error.ResetNeeded before the first reset."""
        return [episode.space for episode in self._current()]

    def step(self, actions: Any) -> tuple[Any, Array, Flags, Flags, Infos]:
        """Propose a pose in each environment; one whose episode has ended resets instead."""
        given = self._door.proposals(actions, self._shape)
        stepping = self._renew_ended()
        middle = np.zeros(self._dimensions)
        proposals = np.stack(
            [
                memory.proposal(action) if steps else middle
                for memory, action, steps in zip(self._memories, given, stepping, strict=True)
            ]
        )
        seen = self._look(proposals, ~stepping)
        rewards = np.zeros(self.num_envs)
        for i in np.flatnonzero(stepping).tolist():
            rewards[i] = self._memories[i].take(proposals[i], float(seen.costs[i]))
        terminated = stepping & (np.array([memory.used for memory in self._memories]) >= self._most)
        truncated = stepping & (self._steps >= self._longest)
        self._ended = terminated | truncated
        infos = masked(np.ones_like(stepping), self._infos(seen))
        return self._states(seen.pictures), rewards, terminated, truncated, infos

    def _look(self, proposals: Array, begun: Flags) -> Evaluated:
        """Evaluate proposals (n, d); in environments that have begun they are the first ones."""
        seen = self._last = self._stage.look(proposals, self._stage.everyone)
        for i in np.flatnonzero(begun).tolist():
            self._memories[i] = ProposalMemory(self._dimensions, float(seen.costs[i]), self._most)
        return seen

    def _states(self, pictures: Any) -> Any:
        return seen_with(np.stack([memory.state() for memory in self._memories]), pictures, self._image)

    def _infos(self, seen: Evaluated) -> Infos:
        values: Infos = {
            "cost": seen.costs,
            "best_cost": np.array([float(memory.best_costs[0]) for memory in self._memories]),
            "evaluations": np.array([memory.used for memory in self._memories]),
            "areas": seen.areas,
            "instance": self._numbers.copy(),
        }
        if self._selection.errors:
            values["error_degrees"] = pose_error_degrees(self._truths, seen.poses)
        return values

    def _begin(self, i: int, number: int) -> None:
        episode = self._episodes[i] = Episode(self.world, number, self._most)
        self._stage.put(i, episode.scenery, episode.space)
        self._truths[i] = episode.instance.truth.poses[0]

    def _opened(self, begun: Flags) -> tuple[Any, Infos]:
        # who goes on is shown his last proposal once more, which counts for nothing
        last = np.stack([memory.last[0] for memory in self._memories])
        seen = self._look(np.where(begun[:, None], 0.0, last), begun)
        return self._states(seen.pictures), self._infos(seen)

    def render(self) -> Any:
        """Return a tuple of pictures (height, width, 3), one an environment, where `render_mode` is "rgb_array"."""
        if self.render_mode is None:
            return None
        pictures = []
        for i, episode in enumerate(self._current()):
            memory, last = self._memories[i], self._last
            assert last is not None
            label = f"best {memory.best_costs[0]:.1f}, {memory.used} evaluations"
            pictures.append(portray(episode.scenery, last.poses[i], last.translations[i], label))
        return tuple(pictures)

    def _current(self) -> list[Episode]:
        episodes = [episode for episode in self._episodes if episode is not None]
        if len(episodes) < self.num_envs:
            raise error.ResetNeeded("reset must come before anything else")
        return episodes
