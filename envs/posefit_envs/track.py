"""Track-v0: a sequence of silhouettes, several proposals for each."""

from dataclasses import replace
from typing import Any, Unpack

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.check import whole
from posefit.fitting.tracker import Follower, Prediction
from posefit.geometry.skeleton import ANGLES
from posefit_envs.base import (
    Flags,
    Infos,
    Outcome,
    SearchEnv,
    SearchVectorEnv,
    VectorArguments,
    check_budget,
    image_spaces,
)
from posefit_envs.instance import Episode, Image, Instance, checked, first_episode
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Rows

FRAMES = 20
EVALUATIONS = 100  # a frame


class TrackVectorEnv(SearchVectorEnv):
    """`num_envs` environments as TrackEnv."""

    metadata = SearchVectorEnv.metadata | {"render_fps": 30}

    def __init__(
        self,
        num_envs: int = 1,
        *,
        frames: int = FRAMES,
        evaluations_per_frame: int = EVALUATIONS,
        **arguments: Unpack[VectorArguments],
    ) -> None:
        check_budget(0.0, "evaluations_per_frame", evaluations_per_frame)
        checked(whole, "frames", frames, 1)
        super().__init__(num_envs, image_spaces, **arguments)
        self._frames, self._budget = int(frames), int(evaluations_per_frame)
        self._followers: list[Follower | None] = [None] * num_envs
        # of the current frame: the count of proposals, the last one, and the best one
        n, d = self._shape
        self._used, self._frame_numbers = np.zeros(num_envs, dtype=np.int64), np.zeros(num_envs, dtype=np.int64)
        self._costs, self._poses, self._places = np.empty(n), np.empty((n, ANGLES)), np.empty((n, 3))
        self._best, self._best_proposals = np.empty(n), np.empty((n, d))
        self._best_poses, self._best_places = np.empty((n, ANGLES)), np.empty((n, 3))

    def _begin_search(self, i: int, number: int) -> None:
        episode = first_episode(self.world, number, self._budget, self._frames)
        follower = self._followers[i] = Follower(episode.instance.task, self.world.learned, Prediction(tilt="box"))
        self._enter(i, replace(episode, space=follower.space(episode.instance.observations[0])))

    def _enter(self, i: int, episode: Episode) -> None:
        super()._enter(i, episode)
        self._frame_numbers[i], self._used[i], self._best[i] = episode.frame, 0, np.inf

    def _opened(self, begun: Flags) -> tuple[Image, Infos]:
        frames = np.zeros(self.num_envs, dtype=np.int64)
        return self._stage.pictures(), {"instance": self._numbers.copy(), "frame": frames}

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        last = self._stage.evaluate(actions, rows)
        self._used += stepping
        self._costs, self._poses, self._places = last.costs, last.poses, last.translations
        better = np.flatnonzero(stepping & (last.costs < self._best))
        if better.size:
            self._best[better], self._best_proposals[better] = last.costs[better], actions[better]
            self._best_poses[better], self._best_places[better] = last.poses[better], last.translations[better]
        infos = {"cost": last.costs, "areas": last.areas}
        infos |= self._progress(self._best.copy(), self._used.copy(), lambda: last.poses)
        committed, terminated = {}, np.zeros(self.num_envs, dtype=bool)
        for i in np.flatnonzero(stepping & (self._used >= self._budget)).tolist():
            committed[i] = self._commit(i)
            terminated[i] = self.episodes[i].frame + 1 >= self._frames
            if not terminated[i]:
                self._enter_next(i)
        if committed:
            entered = np.array([i for i in committed if not terminated[i]], dtype=np.int64)
            self._stage.redraw(self._poses, self._places, entered, last.pictures)
        frames = self._frame_numbers.copy()
        common = {"instance": self._numbers, "frame": frames}
        never = np.zeros_like(terminated)
        return Outcome(last.pictures, -last.costs, terminated, never, infos | {"frame": frames}, common, committed)

    def _commit(self, i: int) -> Infos:
        """Commit the best proposal of environment i, and return its infos."""
        episode, follower = self.episodes[i], self._followers[i]
        assert follower is not None
        self._poses[i], self._places[i] = self._best_poses[i], self._best_places[i]
        follower.commit(self._best_proposals[i])
        return committed_infos(
            episode.instance,
            episode.frame,
            self._poses[i],
            self._places[i],
            float(self._best[i]),
            self._selection.errors,
        )

    def _enter_next(self, i: int) -> None:
        instance, frame, follower = self.episodes[i].instance, self.episodes[i].frame + 1, self._followers[i]
        assert follower is not None
        self._enter(i, Episode(instance, frame, follower.space(instance.observations[frame])))

    def _render_row(self, i: int, episode: Episode) -> Picture:
        if not self._steps[i]:
            label = f"instance {episode.instance.number}, frame {episode.frame}"
            return render_frame(episode.scenery, None, None, label)
        best = "" if np.isinf(self._best[i]) else f", best {self._best[i]:.1f}"
        label = f"frame {episode.frame}, cost {self._costs[i]:.1f}{best}"
        return render_frame(episode.scenery, self._poses[i], self._places[i], label)


class TrackEnv(SearchEnv):
    """
    ## Description
    A person walks by, observed as a silhouette a frame. For each frame some poses are proposed; the best of them is
    committed, the next silhouette appears, and the box of proposals moves on with the prediction, SAPSO (6).

    ## Action Space
    `Box(-1, 1, (d,), float32)`: a proposal, as in `FitImage-v0`. The yaw, and a searched translation, are
    centred on the pose that was committed last.

    ## Observation Space
    `Box(0, 255, (height, width, 2 views), uint8)`, as in `FitImage-v0`: the silhouette of the current frame, and
    that of the last proposal. The first picture of a frame shows the pose that was committed in the frame before.

    ## Rewards
    Minus the cost of the proposal, 0 to 100; SAPSO (4).

    ## Starting State
    The first frame of an instance, as in `FitImage-v0`.

    ## Episode End
    Terminates when the last frame's pose is committed. It is never truncated.

    ## Information
    `cost`, `best_cost`, `evaluations` of the frame, `areas` (views, 3), `frame`, `instance`, and unless `errors=False`
    `error_degrees` of the proposal. The step that commits a pose adds `committed_frame`, `committed_cost`,
    `committed_pose` (66,), and unless `errors=False` `committed_error_degrees` and `committed_mpjpe_mm`; `frame` is
    then the next one. A reset gives `instance` and `frame`.

    ## Arguments
    As in `FitImage-v0`, with `frames=20` and `evaluations_per_frame=100` instead of `target_cost` and
    `max_evaluations`.
    """

    vector = TrackVectorEnv
    metadata = SearchEnv.metadata | {"render_fps": 30}


def committed_infos(
    instance: Instance, frame: int, pose: Array, place: Array, cost: float, errors: bool
) -> dict[str, Any]:
    """Return the infos of the pose that is committed in a frame of an instance."""
    infos = {"committed_frame": frame, "committed_cost": cost, "committed_pose": pose.copy()}
    if errors:
        ours = instance.task.body.skeleton.joints(pose[None], place[None])
        infos |= {f"committed_{name}": error for name, error in instance.errors(frame, pose).items()}
        infos["committed_mpjpe_mm"] = float(metrics.mpjpe_mm(instance.joints[frame][None], ours)[0])
    return infos
