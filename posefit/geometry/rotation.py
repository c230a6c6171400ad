"""Rotations in the three forms that posefit uses: root angles, joint angles, matrices.

Angles are radians. Matrices act on column vectors: `v_parent = rotation @ v_child`.
"""

import numpy as np

from posefit.arrays import Array

# Interpretation S3: yaw about the vertical is outermost, then pitch, then roll. In the
# paper's order x, y, z the middle angle is the yaw, so that a side view is at the
# singularity.
ROOT_ORDER = (1, 0, 2)
# Acclaim files: rx first, so that the matrix is Rz @ Ry @ Rx.
JOINT_ORDER = (2, 1, 0)
# radians from the singularity, where the outer and the inner axis coincide
LOCKED = 1e-7


def rotation_from_root_angles(angles: Array) -> Array:
    """Return rotations (..., 3, 3) of yaw, pitch, roll (..., 3). Interpretation S3."""
    yaw, pitch, roll = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    return rotation_about(1, yaw) @ rotation_about(0, pitch) @ rotation_about(2, roll)


def yaw_first(angles: Array) -> Array:
    """Return yaw, pitch, roll (..., 3) of the paper's root angles. Interpretation S3.

    The paper turns about x, then y, then z. `angles` (..., 3) has these angles in the
    order of yaw, pitch and roll: about y, x and z.
    """
    y, x, z = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    rotations = rotation_about(0, x) @ rotation_about(1, y) @ rotation_about(2, z)
    return root_angles_from_rotation(rotations)


def root_angles_from_rotation(rotations: Array) -> Array:
    """Return yaw, pitch, roll (..., 3) of rotations (..., 3, 3). Interpretation S3."""
    return angles_about(ROOT_ORDER, rotations)


def rotation_from_joint_angles(angles: Array) -> Array:
    """Return the rotations (..., 3, 3) of joint angles (..., 3), Rz @ Ry @ Rx."""
    rx, ry, rz = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    return rotation_about(2, rz) @ rotation_about(1, ry) @ rotation_about(0, rx)


def joint_angles_from_rotation(rotations: Array) -> Array:
    """Return rx, ry, rz (..., 3) of rotations (..., 3, 3) that equal Rz @ Ry @ Rx."""
    return angles_about(JOINT_ORDER, rotations)[..., ::-1].copy()


def shortest_turn(start: Array, end: Array) -> Array:
    """Return the rotations (..., 3, 3) of the least angle between directions (..., 3).

    Opposite directions give some rotation by half a turn. If a direction is 0, the
    result is the identity.
    """
    start = np.asarray(start, dtype=np.float64)
    end = np.asarray(end, dtype=np.float64)
    start, end = np.broadcast_arrays(start, end)
    lengths = np.linalg.norm(start, axis=-1) * np.linalg.norm(end, axis=-1)
    known = lengths > 0.0
    cross = np.cross(start, end)
    cosine = (start * end).sum(axis=-1)
    sine = np.linalg.norm(cross, axis=-1)
    opposite = known & (sine <= 1e-12 * lengths) & (cosine < 0.0)
    # opposite directions have no cross product: any axis at a right angle will do
    perpendicular = along_y(np.where(known[..., None], start, 1.0))[..., 0]
    normal = cross / np.where(sine > 0.0, sine, 1.0)[..., None]
    axis = np.where(opposite[..., None], perpendicular, normal)
    x, y, z = np.moveaxis(axis, -1, 0)
    zero = np.zeros_like(x)
    skew = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=-1)
    skew = skew.reshape(*x.shape, 3, 3)
    angle = np.where(known, np.arctan2(sine, cosine), 0.0)[..., None, None]
    # Rodrigues' formula
    bent = (1.0 - np.cos(angle)) * skew @ skew
    return np.asarray(np.eye(3) + np.sin(angle) * skew + bent)


def along_y(directions: Array) -> Array:
    """Return rotations (..., 3, 3) that take y to directions (..., 3).

    If a direction is 0, its rotation takes y to y.
    """
    y = np.asarray(directions, dtype=np.float64)
    length = np.linalg.norm(y, axis=-1, keepdims=True)
    known = length > 0.0
    y = np.where(known, y, (0.0, 1.0, 0.0)) / np.where(known, length, 1.0)
    # the second direction must not be parallel to y
    aside = np.where(np.abs(y[..., 2:]) < 0.9, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
    x = np.cross(y, aside)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1)


def quaternions(rotations: Array) -> Array:
    """Return unit quaternions (T, 4), x, y, z, w, of successive rotations (T, 3, 3).

    Of the two quaternions of a rotation, the nearer to the one before is taken.
    """
    # imported here, because it takes a quarter of a second
    from scipy.spatial.transform import Rotation

    chosen = Rotation.from_matrix(rotations).as_quat()
    turned = np.where((chosen[1:] * chosen[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(chosen * np.cumprod(np.append(1.0, turned))[:, None])


def wrapped(angles: Array) -> Array:
    """Return angles brought to [-pi, pi). Interpretation S13."""
    angles = np.asarray(angles, dtype=np.float64)
    # faster than np.remainder
    return np.asarray(angles - 2.0 * np.pi * np.floor(angles / (2.0 * np.pi) + 0.5))


def unwrapped(angles: Array) -> Array:
    """Return angles over time (T, ...) in radians without jumps of whole turns.

    NaN is kept and skipped.
    """
    series = np.array(angles, dtype=np.float64)
    for column in series.reshape(len(series), -1).T:
        known = np.isfinite(column)
        column[known] = np.unwrap(column[known])
    return series


def steady_angles(angles: Array) -> Array:
    """Return the three angles (T, ..., 3) of successive rotations without jumps.

    The angles are about three different axes, so that each rotation has two triples.
    The triple nearer to the one before is taken, and then `unwrapped`.
    """
    first = np.asarray(angles, dtype=np.float64)
    second = np.array(first)
    second[..., ::2] += np.pi
    second[..., 1] = np.pi - second[..., 1]
    chosen = np.array(first)
    for k in range(1, len(first)):
        either = np.stack([first[k], second[k]])
        near = chosen[k - 1] + wrapped(either - chosen[k - 1])
        off = ((near - chosen[k - 1]) ** 2).sum(axis=-1)
        chosen[k] = np.where((off[1] < off[0] - 1e-9)[..., None], near[1], near[0])
    return unwrapped(chosen)


def geodesic(first: Array, second: Array) -> Array:
    """Return the angles (...), 0 to pi, between rotations (..., 3, 3)."""
    relative = np.swapaxes(first, -1, -2) @ second
    # its entries are the axis times twice the sine of the angle
    twist = relative - np.swapaxes(relative, -1, -2)
    x = twist[..., 2, 1]
    y = twist[..., 0, 2]
    z = twist[..., 1, 0]
    sine = 0.5 * np.sqrt(x**2 + y**2 + z**2)
    cosine = 0.5 * (np.trace(relative, axis1=-2, axis2=-1) - 1.0)
    return np.asarray(np.arctan2(sine, cosine))


def rotation_about(axis: int, angles: Array) -> Array:
    """Return the rotations (..., 3, 3) about an axis by angles (...)."""
    sines = np.sin(angles)
    cosines = np.cos(angles)
    rotations = np.zeros((*np.shape(angles), 3, 3))
    j = (axis + 1) % 3
    k = (axis + 2) % 3
    rotations[..., axis, axis] = 1.0
    rotations[..., j, j] = rotations[..., k, k] = cosines
    rotations[..., j, k] = -sines
    rotations[..., k, j] = sines
    return rotations


def angles_about(axes: tuple[int, int, int], rotations: Array) -> Array:
    """Return the angles (..., 3) about three axes of rotations (..., 3, 3).

    The axes differ, and the outermost is first. At the singularity one of the angles is
    free. There the angle about z is set to 0, or about y if z is the middle axis.
    """
    i, j, k = axes
    sign = 1.0 if (j - i) % 3 == 1 else -1.0
    rotations = np.asarray(rotations, dtype=np.float64)
    # the cosine of the middle angle
    level = np.hypot(rotations[..., i, i], rotations[..., i, j])
    outer = np.arctan2(-sign * rotations[..., j, k], rotations[..., k, k])
    inner = np.arctan2(-sign * rotations[..., i, j], rotations[..., i, i])
    locked = level < LOCKED
    if i < k:
        alone = np.arctan2(sign * rotations[..., k, j], rotations[..., j, j])
        outer = np.where(locked, alone, outer)
        inner = np.where(locked, 0.0, inner)
    else:
        alone = np.arctan2(sign * rotations[..., j, i], rotations[..., j, j])
        outer = np.where(locked, 0.0, outer)
        inner = np.where(locked, alone, inner)
    middle = np.arctan2(sign * rotations[..., i, k], level)
    return np.stack([outer, middle, inner], axis=-1)
