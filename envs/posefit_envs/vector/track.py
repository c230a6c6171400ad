"""Track-v0 for many environments at once: a proposal in each is one compiled call, whatever their frames."""

from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit.geometry.skeleton import ANGLES
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import check_budget, spaces_of
from posefit_envs.instance import Arguments, approved, select
from posefit_envs.search import Image
from posefit_envs.track import EVALUATIONS, FRAMES, Passage, track_label
from posefit_envs.vector.batch import Flags, Infos, SearchVectorEnv, masked


class TrackVectorEnv(SearchVectorEnv[Passage]):
    """`num_envs` environments as `posefit_envs.track.TrackEnv`, with the same arguments.

    So many `threads` draw; it is one unless somebody says otherwise, and changes nothing but the time.
    Seeded with s, environment i does what a single one does that is seeded with s + i. The step after an episode's last
    one resets, as `AutoresetMode.NEXT_STEP` says.
    """

    metadata = SearchVectorEnv.metadata | {"render_fps": 30}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        threads: int = 1,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        check_budget(0.0, "evaluations_per_frame", evaluations_per_frame)
        approved(whole, "frames", frames, 1)
        selection = select(**arguments)
        super().__init__(num_envs, selection, spaces_of(selection.world), threads, render_mode, max_episode_steps)
        self._frames, self._most = int(frames), int(evaluations_per_frame)
        # of the current frame: proposals made, what the last and the best proposal came to
        n, d = self._shape
        self._used = np.zeros(num_envs, dtype=np.int64)
        self._costs, self._poses, self._places = np.empty(n), np.empty((n, ANGLES)), np.empty((n, 3))
        self._best, self._best_proposals = np.empty(n), np.empty((n, d))
        self._best_poses, self._best_places = np.empty((n, ANGLES)), np.empty((n, 3))

    def step(self, actions: Any) -> tuple[Image, Array, Flags, Flags, Infos]:
        """Propose a pose in each environment; one whose episode has ended resets instead."""
        proposals = self._door.proposals(actions, self._shape)
        stepping = self._renew_ended()
        seen = self._stage.look(proposals, np.flatnonzero(stepping))
        self._used += stepping
        self._costs, self._poses, self._places = seen.costs, seen.poses, seen.translations
        better = np.flatnonzero(stepping & (seen.costs < self._best))
        self._best[better], self._best_proposals[better] = seen.costs[better], proposals[better]
        self._best_poses[better], self._best_places[better] = seen.poses[better], seen.translations[better]
        values = {"cost": seen.costs, "areas": seen.areas}
        values |= self._standings(self._best.copy(), self._used.copy(), lambda: seen.poses)
        committing = np.flatnonzero(stepping & (self._used >= self._most))
        told, terminated = self._commit(committing, seen.pictures)
        truncated = self._ends(stepping, terminated)
        frames = np.array([passage.frame for passage in self._current()])
        others = {"instance": self._numbers, "frame": frames}
        infos = masked(stepping, values | {"frame": frames}, others) | told
        return seen.pictures, np.where(stepping, -seen.costs, 0.0), terminated, truncated, infos

    def _commit(self, rows: NDArray[np.int64], pictures: Image) -> tuple[Infos, Flags]:
        """Commit the best poses of some rows, and go on; return what is said of it, and where the last frame was."""
        infos: Infos = {}
        ended, errors = np.zeros(self.num_envs, dtype=bool), self._selection.errors
        for i in rows.tolist():
            passage = self._searches[i]
            assert passage is not None
            self._poses[i], self._places[i] = self._best_poses[i], self._best_places[i]
            info = passage.commit(
                self._best_proposals[i], self._poses[i], self._places[i], float(self._best[i]), errors
            )
            infos = self._add_info(infos, info, i)
            ended[i] = passage.ended
            if not passage.ended:
                self._enter(i, passage)
        self._stage.show(self._poses, self._places, rows[~ended[rows]], pictures)
        return infos, ended

    def _begin(self, i: int, number: int) -> None:
        passage = self._searches[i] = Passage(self.world, number, self._frames, self._most)
        self._enter(i, passage)

    def _enter(self, i: int, passage: Passage) -> None:
        self._stage.put(i, passage.scenery, passage.space)
        self._truths[i], self._used[i], self._best[i] = passage.instance.truth.poses[passage.frame], 0, np.inf

    def _opened(self, begun: Flags) -> tuple[Image, Infos]:
        frames = np.zeros(self.num_envs, dtype=np.int64)
        return self._stage.pictures(), {"instance": self._numbers.copy(), "frame": frames}

    def _portrait(self, i: int, search: Passage) -> Picture:
        if not self._steps[i]:
            return portray(search.scenery, None, None, track_label(search, None, np.inf))
        label = track_label(search, float(self._costs[i]), float(self._best[i]))
        return portray(search.scenery, self._poses[i], self._places[i], label)
