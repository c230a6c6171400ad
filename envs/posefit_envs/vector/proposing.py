"""Fit-v1 for many environments at once: a proposal in each is one compiled call, whatever their instances."""

from typing import Any, Unpack

import numpy as np

from posefit.arrays import Array
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import MAX_EVALUATIONS, Episode
from posefit_envs.instance import Arguments, select
from posefit_envs.proposing.memory import ProposalMemory, seen_with
from posefit_envs.proposing.single import check_proposing, spaces_of_proposing
from posefit_envs.stage import Evaluated
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class ProposalVectorEnv(SearchVectorEnv[Episode]):
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
        self._memories = [ProposalMemory(self._dimensions, np.inf, self._most) for _ in range(num_envs)]
        self._last: Evaluated | None = None

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
        truncated = self._ends(stepping, terminated)
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
        best = np.array([float(memory.best_costs[0]) for memory in self._memories])
        used = np.array([memory.used for memory in self._memories])
        return {"cost": seen.costs, "areas": seen.areas} | self._standings(best, used, lambda: seen.poses)

    def _begin(self, i: int, number: int) -> None:
        episode = self._searches[i] = Episode(self.world, number, self._most)
        self._put(i, episode)

    def _opened(self, begun: Flags) -> tuple[Any, Infos]:
        # who goes on is shown his last proposal once more, which counts for nothing
        last = np.stack([memory.last[0] for memory in self._memories])
        seen = self._look(np.where(begun[:, None], 0.0, last), begun)
        return self._states(seen.pictures), self._infos(seen)

    def _portrait(self, i: int, search: Episode) -> Picture:
        memory, last = self._memories[i], self._last
        assert last is not None
        label = f"best {memory.best_costs[0]:.1f}, {memory.used} evaluations"
        return portray(search.scenery, last.poses[i], last.translations[i], label)
