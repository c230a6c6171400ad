"""Poses of one frame moved until their contours are those of the masks: some steps of Gauss and Newton."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.tracking.smoothing.contours import Distances, MaskContours
from posefit_exemplars import contour_kernels

SPACING = 0.04  # metres, about, between two points of a mask's border
MAX_TURN = np.radians(20.0)  # of an angle in a step
SHARE = 27.0  # effort of a step, in costs of poses, which docs/studies/follow.py measures


@dataclass(frozen=True, eq=False)
class FrameContours:
    """The borders of a frame's masks, view by view; see `MaskContours`."""

    cameras: tuple[Array, Array, Array, Array] = field(repr=False)  # rotations, translations, focals and centres
    fields: Distances = field(repr=False)  # (V, h, w)
    corners: NDArray[np.int64] = field(repr=False)  # (V, 2)
    sizes: NDArray[np.int64] = field(repr=False)  # (V, 2)
    points: Array = field(repr=False)  # (n, 2)
    starts: NDArray[np.int64] = field(repr=False)  # (V + 1,)
    steps: Array = field(repr=False)  # (V,) pixels that a point stands for

    @classmethod
    def of(cls, cameras: Sequence[Camera], observation: Observation, place: Array) -> Self:
        """Return the borders in one frame, of a person whose root is about at `place` (3,)."""
        views = [MaskContours.of(camera, number, [observation], place[None]) for number, camera in enumerate(cameras)]
        every = [max(round(SPACING * view.metres[0] / view.step), 1) for view in views]
        points = [view.points[::skipped] for view, skipped in zip(views, every, strict=True)]
        fields = np.zeros((len(views), *np.max([view.fields.shape[1:] for view in views], axis=0)), dtype=np.float32)
        for whole, view in zip(fields, views, strict=True):
            whole[: view.fields.shape[1], : view.fields.shape[2]] = view.fields[0]
        names = "rotation", "translation", "focal", "centre"
        arrays = [np.array([getattr(view.camera, name) for view in views], dtype=np.float64) for name in names]
        return cls(
            (arrays[0], arrays[1], arrays[2], arrays[3]),
            fields,
            np.concatenate([view.corners for view in views]).astype(np.int64),
            np.concatenate([view.sizes for view in views]).astype(np.int64),
            writeable(np.concatenate(points)),
            np.cumsum([0, *map(len, points)]),
            np.array([view.step * skipped for view, skipped in zip(views, every, strict=True)]),
        )

    def fitted(
        self, task: Task, poses: Array, places: Array, means: Array, precisions: Array, scales: Sequence[float]
    ) -> tuple[Array, Array]:
        """Return poses (n, 66) and places (n, 3) after a step for each of `scales`.

        A distance of contours counts less beyond that many metres. An angle is pulled to its mean, of `means` (n, 66),
        and the place to where it was, with `precisions` (69,): of the place, then of the angles.
        """
        free = task.body.skeleton.free
        precisions = np.where(np.append([True] * 3, free), precisions, contour_kernels.RIGID)
        moved, places = poses.copy(), places.copy()
        contour_kernels.fit_poses(
            *task.body.skeleton.chain,
            task.body.radii,
            *self.cameras,
            self.fields,
            self.corners,
            self.sizes,
            self.points,
            self.starts,
            self.steps,
            writeable(means),
            precisions,
            MAX_TURN,
            np.array(scales),
            moved,
            places,
        )
        return np.where(free, moved, poses), places


def precisions(turn: float, shift: float) -> Array:
    """Return the precisions (69,) of a place and of angles with standard deviations, metres and radians."""
    return np.concatenate([np.full(3, shift**-2.0), np.full(ANGLES, turn**-2.0)])
