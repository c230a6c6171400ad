"""Training poses: collected from the motions, checked, and thinned out."""

import numpy as np

from posefit.plugin import Array, Task


def training_poses(task: Task) -> Array:
    """Return the poses (T, 66) of all training motions. Raises ValueError if none."""
    if not task.training:
        raise ValueError("training must contain a motion to learn from, got none")
    return np.concatenate([motion.poses for motion in task.training])


def training_angles(angles: Array, least: int) -> Array:
    """Return joint angles (T, 63) as an array.

    Raises ValueError if the shape is wrong, a number is not finite, or there are fewer
    than `least` frames.
    """
    angles = np.asarray(angles, dtype=np.float64)
    if angles.ndim != 2 or angles.shape[1] != 63 or not np.isfinite(angles).all():
        raise ValueError(f"angles must be finite and (T, 63), got {angles.shape}")
    if len(angles) < least:
        raise ValueError(
            f"angles must contain at least {least} frames, got {len(angles)}"
        )
    return angles


def evenly(angles: Array, count: int) -> Array:
    """Return at most `count` of the angles (T, 63), evenly spaced."""
    rows = np.unique(
        np.linspace(0, len(angles) - 1, min(count, len(angles))).astype(int)
    )
    return np.asarray(angles[rows])
