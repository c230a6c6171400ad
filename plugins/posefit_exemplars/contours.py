"""Poses of one frame moved until their contours are those of the masks: some steps of Gauss and Newton."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.skeleton import ANGLES
from posefit.tracking.smoothing.contours import MAX_ANGLE_STEP, MaskContours, contour_squares

POINT_SPACING = 0.04  # metres, about, between two points of a mask's border
STEP_EVALUATIONS = 27.0  # effort of a step, in costs of poses, which docs/studies/follow.py measures


def fitted(
    body: Body,
    views: Sequence[MaskContours],
    start: tuple[Array, Array],
    means: Array,
    precisions: Array,
    scales: Sequence[float],
) -> tuple[Array, Array]:
    """Return poses (n, 66) and places (n, 3) after a step to the contours of one frame for each of `scales`.

    Angles are pulled to `means` (n, 66), places to where they `start`, with `precisions` (69,) of places and angles.
    Contours farther off than a scale, metres, count less.
    """
    angles = np.flatnonzero(body.skeleton.free)
    poses, places, weights = start[0].copy(), start[1].copy(), precisions[np.append([0, 1, 2], 3 + angles)]
    for scale in scales:
        curves, slopes, *_ = contour_squares(body, views, poses, places, scale)
        off = np.concatenate([places - start[1], (poses - means)[:, angles]], axis=1)
        np.einsum("nii->ni", curves)[:] += weights  # on the diagonals
        steps = np.linalg.solve(curves, (slopes + weights * off)[..., None])[..., 0]
        places -= steps[:, :3]
        poses[:, angles] -= np.clip(steps[:, 3:], -MAX_ANGLE_STEP, MAX_ANGLE_STEP)
    return poses, places


def precisions(turn: float, shift: float) -> Array:
    """Return the precisions (69,) of a place and of angles with standard deviations, metres and radians."""
    return np.concatenate([np.full(3, shift**-2.0), np.full(ANGLES, turn**-2.0)])
