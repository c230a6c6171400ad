"""Track-v0: a sequence of silhouettes, several proposals for each."""

from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.check import whole
from posefit.fitting.metrics import mpjpe_mm, pose_error_degrees
from posefit.fitting.tracker import Prediction, Predictor
from posefit_envs.base import (
    Flags,
    Infos,
    Outcome,
    SearchEnv,
    SearchVectorEnv,
    image_spaces,
)
from posefit_envs.instance import Episode, Image, Instance, checked, instance
from posefit_envs.rendering import Picture, render_frame
from posefit_envs.stage import Evaluation, Rows

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
        **arguments: Any,
    ) -> None:
        checked(whole, "evaluations_per_frame", evaluations_per_frame, 2)
        checked(whole, "frames", frames, 1)
        super().__init__(num_envs, image_spaces, **arguments)
        self._frame_count, self._budget = int(frames), int(evaluations_per_frame)
        self._predictors: dict[int, Predictor] = {}
        # used: of the current frame
        self._frames, self._used = np.zeros((2, num_envs), dtype=np.int64)
        self._best, self._best_proposals = np.empty(num_envs), np.empty(self._shape)
        self._last: Evaluation | None = None

    def _begin_search(self, i: int, number: int) -> None:
        made = instance(self.world, number, self._frame_count, self._budget)
        self._predictors[i] = Predictor(
            made.task, self.world.learned, Prediction(tilt="box")
        )
        self._begin_frame(i, made, 0)

    def _begin_frame(self, i: int, made: Instance, frame: int) -> None:
        self._enter(
            i, made.episode(frame, self._predictors[i].space(made.observations[frame]))
        )
        self._frames[i], self._used[i], self._best[i] = frame, 0, np.inf

    def _opened(self, started: Flags) -> tuple[Image, Infos]:
        return self._stage.pictures(), {
            "instance": self._numbers.copy(),
            "frame": np.zeros_like(self._frames),
        }

    def _advance(self, actions: Array, stepping: Flags, rows: Rows) -> Outcome:
        last = self._last = self._stage.evaluate(actions, rows)
        self._used += stepping
        better = (stepping & (last.costs < self._best)).nonzero()[0]
        if better.size:
            self._best[better], self._best_proposals[better] = (
                last.costs[better],
                actions[better],
            )
        infos = self._progress(
            self._best, self._used, last.poses, cost=last.costs, areas=last.areas
        )
        terminated = full = stepping & (self._used >= self._budget)
        committed: dict[int, Infos] = {}
        if full.any():
            terminated = full & (self._frames + 1 == self._frame_count)
            committed = self._commit(full.nonzero()[0], last)
        infos["frame"] = self._frames.copy()
        common = {"instance": self._numbers, "frame": infos["frame"]}
        return Outcome(
            last.pictures,
            -np.log1p(last.costs),
            terminated,
            infos,
            common,
            row_infos=committed,
        )

    def _commit(self, rows: Rows, last: Evaluation) -> dict[int, Infos]:
        """Commit the best proposals of some environments, begin their next frames, and return their infos by row."""
        poses, places = self._stage.decode(self._best_proposals[:, None], rows)
        last.poses[rows], last.translations[rows] = poses[rows, 0], places[rows, 0]
        infos = {}
        entered = []
        for i in rows.tolist():
            made = self._episode(i).instance
            frame = int(self._frames[i])
            best = float(self._best[i])
            infos[i] = committed_infos(
                made, frame, poses[i, 0], places[i, 0], best, self.world.errors
            )
            self._predictors[i].commit(self._best_proposals[i])
            if frame + 1 < self._frame_count:
                self._begin_frame(i, made, frame + 1)
                entered.append(i)
        self._stage.redraw(
            last.poses,
            last.translations,
            np.array(entered, dtype=np.int64),
            last.pictures,
        )
        return infos

    def _render_row(self, i: int, episode: Episode) -> Picture:
        last = self._last
        if not self._steps[i] or last is None:
            label = f"instance {episode.instance.number}, frame {episode.frame}"
            return render_frame(episode.problem, None, None, label)
        best = "" if np.isinf(self._best[i]) else f", best {self._best[i]:.1f}"
        label = f"frame {episode.frame}, cost {last.costs[i]:.1f}{best}"
        return render_frame(episode.problem, last.poses[i], last.translations[i], label)


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
    -ln(1 + cost) of the proposal, as in `FitImage-v0`.

    ## Starting State
    The first frame of an instance, as in `FitImage-v0`.

    ## Episode End
    Terminates when the last frame's pose is committed.

    ## Information
    `cost`, `best_cost`, `evaluations` of the frame, `areas` (views, 3), `frame`, `instance`, and unless `errors=False`
    `error_degrees` of the proposal. The step that commits a pose adds `committed_frame`, `committed_cost`,
    `committed_pose` (66,), and unless `errors=False` `committed_error_degrees` and `committed_mpjpe_mm`; `frame` is
    then the next one. A reset gives `instance` and `frame`.

    ## Arguments
    As in `FitImage-v0`, with `frames=20` and `evaluations_per_frame=100` instead of `max_evaluations`.

    ## Version History
    - v0: not released yet; until then a version changes without a number.
    """

    vector = TrackVectorEnv
    metadata = SearchEnv.metadata | {"render_fps": 30}


def committed_infos(
    instance: Instance, frame: int, pose: Array, place: Array, cost: float, errors: bool
) -> dict[str, Any]:
    """Return the infos of the pose that is committed in a frame of an instance."""
    infos = {
        "committed_frame": frame,
        "committed_cost": cost,
        "committed_pose": pose.copy(),
    }
    if errors:
        joints = instance.task.body.skeleton.joints(pose[None], place[None])
        infos["committed_error_degrees"] = float(
            pose_error_degrees(instance.truth.poses[frame][None], pose[None])[0]
        )
        infos["committed_mpjpe_mm"] = float(
            mpjpe_mm(instance.joints[frame][None], joints)[0]
        )
    return infos
