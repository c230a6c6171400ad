"""Rotations between the three forms posefit meets: root angles, joint angles and matrices.

Angles are radians. Matrices act on column vectors: `v_parent = rotation @ v_child`.
"""

from typing import Final, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from posefit.arrays import Array

Order = Literal["YXZ", "xyz"]

# Reading S3: yaw about the vertical is outermost, then pitch, then roll. With the paper's x, y, z order
# the middle angle is the yaw, and a side view sits on the singularity.
ROOT_ORDER: Final = "YXZ"
# Acclaim files: rx first, so that the matrix is Rz @ Ry @ Rx.
JOINT_ORDER: Final = "xyz"


def rotation_from_root_angles(angles: Array) -> Array:
    """Return the rotations (..., 3, 3) of root angles (..., 3): yaw, pitch, roll. Reading S3."""
    return _matrices(ROOT_ORDER, angles)


def root_angles_from_rotation(rotations: Array) -> Array:
    """Return yaw, pitch, roll (..., 3) of rotations (..., 3, 3). Reading S3."""
    return _angles(ROOT_ORDER, rotations)


def rotation_from_joint_angles(angles: Array) -> Array:
    """Return the rotations (..., 3, 3) of joint angles (..., 3), Rz @ Ry @ Rx."""
    return _matrices(JOINT_ORDER, angles)


def joint_angles_from_rotation(rotations: Array) -> Array:
    """Return rx, ry, rz (..., 3) of rotations (..., 3, 3), so that Rz @ Ry @ Rx gives them back."""
    return _angles(JOINT_ORDER, rotations)


def wrapped(angles: Array) -> Array:
    """Return angles brought to [-pi, pi). Reading S13."""
    angles = np.asarray(angles, dtype=np.float64)
    return np.asarray(angles - 2.0 * np.pi * np.floor(angles / (2.0 * np.pi) + 0.5))  # faster than a remainder


def geodesic(first: Array, second: Array) -> Array:
    """Return the angle (...), 0 to pi, of the rotation that takes `first` to `second`, both (..., 3, 3)."""
    relative = np.swapaxes(first, -1, -2) @ second
    return np.asarray(_as_batch(relative).magnitude()).reshape(relative.shape[:-2])


def _as_batch(rotations: Array) -> Rotation:
    return Rotation.from_matrix(np.asarray(rotations, dtype=np.float64).reshape(-1, 3, 3))


def _matrices(order: Order, angles: Array) -> Array:
    angles = np.asarray(angles, dtype=np.float64)
    return Rotation.from_euler(order, angles.reshape(-1, 3)).as_matrix().reshape(*angles.shape, 3)


def _angles(order: Order, rotations: Array) -> Array:
    # At the singularity one of the angles is free; scipy then takes zero for it.
    return np.asarray(_as_batch(rotations).as_euler(order, suppress_warnings=True)).reshape(*np.shape(rotations)[:-1])
