"""Errors of an estimate. Poses are (T, 66) radians, joints (T, 27, 3) metres."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import (
    geodesic,
    rotation_from_joint_angles,
    rotation_from_root_angles,
    wrapped,
)
from posefit.geometry.skeleton import joint_distances

LOST_MM = 150.0  # MPJPE above which a frame counts as lost


def pose_error_degrees(
    truth: Array, estimate: Array, dimensions: NDArray[np.bool_] | None = None
) -> Array:
    """Return the mean absolute difference of the angles (T,) in degrees, wrapped.

    SAPSO (8), Interpretation S13. All 66 angles count, padding too, unless `dimensions`
    (66,) chooses some.
    """
    difference = np.degrees(np.abs(wrapped(truth - estimate)))
    # SAPSO (8)
    return np.asarray(
        (difference if dimensions is None else difference[:, dimensions]).mean(axis=1)
    )


def mean_error(errors: Array) -> float:
    """Return the mean of a sequence's errors (T,). SAPSO (9)."""
    return float(np.mean(errors))  # SAPSO (9)


def error_spread(errors: Array) -> float:
    """Return the standard deviation of errors (T,), with divisor T. SAPSO (10)."""
    return float(np.std(errors))  # SAPSO (10)


def geodesic_degrees(truth: Array, estimate: Array) -> Array:
    """Return the mean angle (T,) between true and estimated rotations, degrees.

    The root and the 21 inner joints count.
    """
    root = geodesic(
        rotation_from_root_angles(truth[:, :3]),
        rotation_from_root_angles(estimate[:, :3]),
    )
    inner = []
    for poses in (truth, estimate):
        inner.append(
            rotation_from_joint_angles(poses[:, 3:].reshape(len(poses), -1, 3))
        )
    return np.asarray(
        np.degrees(np.column_stack([root, geodesic(*inner)])).mean(axis=1)
    )


def mpjpe_mm(truth: Array, joints: Array) -> Array:
    """Return the mean distance (T,) of the joints in millimetres, with aligned roots.

    Both roots are moved to the origin, as is usual because one camera leaves the depth
    open. All 27 joints count, the root with its zero.
    """
    return np.asarray(1e3 * joint_distances(truth, joints).mean(axis=1))


def pa_mpjpe_mm(truth: Array, joints: Array) -> Array:
    """Return the mean distance (T,) of the joints in millimetres, Procrustes-aligned.

    Each frame gets the best rotation, scale and translation.
    """
    target = truth - truth.mean(axis=1, keepdims=True)
    source = joints - joints.mean(axis=1, keepdims=True)
    u, spread, vh = np.linalg.svd(np.swapaxes(source, 1, 2) @ target)
    sign = np.sign(np.linalg.det(u @ vh))
    u[:, :, -1] *= sign[:, None]  # a rotation, never a reflection
    spread[:, -1] *= sign
    size = (source**2).sum(axis=(1, 2))
    scale = spread.sum(axis=1) / np.where(size > 0.0, size, 1.0)
    moved = scale[:, None, None] * (source @ u @ vh)
    return np.asarray(1e3 * np.linalg.norm(target - moved, axis=-1).mean(axis=1))


def iou(areas: NDArray[np.int64]) -> Array:
    """Return the intersection over union (n,) of areas R, B, Y (n, 3); 1 if empty."""
    total = areas.sum(axis=1)
    return np.asarray(np.where(total > 0, areas[:, 2] / np.maximum(total, 1), 1.0))


def lost_rate(mpjpe: Array) -> float:
    """Return the share of frames with an MPJPE (T,) above 150 mm."""
    return float((mpjpe > LOST_MM).mean())


def skill(error: float, baseline: float) -> float | None:
    """Return 1 - error / baseline: 1 is perfect, 0 no better than the baseline.

    None if the baseline is 0.
    """
    if baseline > 0.0:
        return 1.0 - error / baseline
    return None
