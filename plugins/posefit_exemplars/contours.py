"""Poses of one frame moved until their contours are those of the masks: some steps of Gauss and Newton."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.camera import Camera
from posefit.geometry.kernels import kinematics
from posefit.geometry.skeleton import ANGLES
from posefit.tracking.smoothing.contours import Distances, MaskContours
from posefit_exemplars.kernels import RIGID, Pull, step_poses

POINT_SPACING = 0.04  # metres, about, between two points of a mask's border
STEP_EVALUATIONS = 27.0  # effort of a step, in costs of poses, which docs/studies/follow.py measures


class FrameContours(NamedTuple):
    """The borders of a frame's masks, view by view; see `MaskContours`."""

    rotations: Array  # (V, 3, 3) of the cameras, as the three that follow
    translations: Array
    focals: Array
    centres: Array
    fields: Distances  # (V, h, w)
    corners: NDArray[np.int64]  # (V, 2)
    sizes: NDArray[np.int64]  # (V, 2)
    points: Array  # (n, 2)
    starts: NDArray[np.int64]  # (V + 1,) of each view's points
    steps: Array  # (V,) pixels that a point stands for

    @classmethod
    def of(cls, cameras: Sequence[Camera], observation: Observation, place: Array) -> Self:
        """Return the borders in one frame, of a person whose root is about at `place` (3,)."""
        views = [MaskContours.of(camera, number, [observation], place[None]) for number, camera in enumerate(cameras)]
        strides = [max(round(POINT_SPACING * view.metres[0] / view.step), 1) for view in views]
        points = [view.points[::stride] for view, stride in zip(views, strides, strict=True)]
        fields = np.zeros((len(views), *np.max([view.fields.shape[1:] for view in views], axis=0)), dtype=np.float32)
        for padded, view in zip(fields, views, strict=True):
            padded[: view.fields.shape[1], : view.fields.shape[2]] = view.fields[0]
        return cls(
            np.array([view.camera.rotation for view in views]),
            np.array([view.camera.translation for view in views]),
            np.array([view.camera.focal for view in views], dtype=np.float64),
            np.array([view.camera.centre for view in views], dtype=np.float64),
            fields,
            np.concatenate([view.corners for view in views]).astype(np.int64),
            np.concatenate([view.sizes for view in views]).astype(np.int64),
            writeable(np.concatenate(points)),
            np.cumsum([0, *map(len, points)]),
            np.array([view.step * stride for view, stride in zip(views, strides, strict=True)]),
        )

    def fitted(
        self, task: Task, poses: Array, places: Array, means: Array, precisions: Array, reaches: Sequence[float]
    ) -> tuple[Array, Array]:
        """Return poses (n, 66) and places (n, 3) after a step for each of `reaches`; see `step_poses`.

        Angles are pulled to `means` (n, 66), places to where they were, with `precisions` (69,) of places and angles.
        """
        free = task.body.skeleton.free
        precisions = np.where(np.append([True] * 3, free), precisions, RIGID)
        pull = Pull(writeable(means), places.copy(), precisions)
        moved, places = poses.copy(), places.copy()
        for reach in reaches:
            step_poses(kinematics(), task.body.skeleton.chain, task.body.radii, self, pull, reach, moved, places)
        return np.where(free, moved, poses), places


def precisions(turn: float, shift: float) -> Array:
    """Return the precisions (69,) of a place and of angles with standard deviations, metres and radians."""
    return np.concatenate([np.full(3, shift**-2.0), np.full(ANGLES, turn**-2.0)])
