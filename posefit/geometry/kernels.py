"""Forward kinematics in numba: plain functions over arrays, shapes checked by the callers."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit
from posefit.geometry.lanes import place_bone

# pi in two parts, so that angles of many turns keep their digits; then Taylor's coefficients on [-pi/2, pi/2],
# where the first term left out is below 1e-10.
_PI_HIGH, _PI_LOW = 3.141592653589793, 1.2246467991473532e-16


class Chain(NamedTuple):
    """A skeleton as the kernel wants it; bones in an order where parents come first."""

    parents: NDArray[np.int64]  # (26,) joint a bone starts from; it ends in joint b + 1
    angles: NDArray[np.int64]  # (26,) index in the pose of the bone's rx, or -1 where it cannot turn
    turns: Array  # (26, 3, 3) parent's frame from this bone's frame, at rest
    turned: NDArray[np.bool_]  # (26,) whether that is more than the identity, as it is for a third of the bones
    offsets: Array  # (26, 3) the bone in its own frame


def chain(parents: NDArray[np.int64], angles: NDArray[np.int64], axes: Array, offsets: Array) -> Chain:
    """Return the constant part of every bone's transform, from rest frames (26, 3, 3) and bone vectors (26, 3)."""
    before = np.concatenate([np.eye(3)[None], axes])[parents]
    turns = np.swapaxes(before, 1, 2) @ axes
    own = np.einsum("bji,bj->bi", axes, offsets)
    turned = np.abs(turns - np.eye(3)).max(axis=(1, 2)) > 1e-12
    return Chain(parents.astype(np.int64), angles.astype(np.int64), turns, turned, own)


@inlined
def sines_cosines(angles, sines, cosines):
    """Write the sine and cosine of each angle. A plain loop of polynomials, so that it runs in vector registers."""
    for i in range(angles.size):
        turns = np.floor(angles[i] * (1.0 / _PI_HIGH) + 0.5)
        x = (angles[i] - turns * _PI_HIGH) - turns * _PI_LOW
        sign = 1.0 - 2.0 * (turns - 2.0 * np.floor(0.5 * turns))
        z = x * x
        s = -1.0 / 1307674368000.0
        s = s * z + 1.0 / 6227020800.0
        s = s * z - 1.0 / 39916800.0
        s = s * z + 1.0 / 362880.0
        s = s * z - 1.0 / 5040.0
        s = s * z + 1.0 / 120.0
        s = s * z - 1.0 / 6.0
        sines[i] = sign * (x + x * z * s)
        c = 1.0 / 20922789888000.0
        c = c * z - 1.0 / 87178291200.0
        c = c * z + 1.0 / 479001600.0
        c = c * z - 1.0 / 3628800.0
        c = c * z + 1.0 / 40320.0
        c = c * z - 1.0 / 720.0
        c = c * z + 1.0 / 24.0
        c = c * z - 0.5
        cosines[i] = sign * (1.0 + z * c)


@inlined
def place_frames(chain, pose, translation, sines, cosines, frames):
    """Write the frames (27, 4, 4) of the joints of one pose (66,): three axes and an origin, as `place_bone` has them.

    `sines` and `cosines` (66,) are scratch.
    """
    sines_cosines(pose, sines, cosines)
    sy, sp, sr = sines[0], sines[1], sines[2]
    cy, cp, cr = cosines[0], cosines[1], cosines[2]
    root = frames[0]
    root[0, 0] = cy * cr + sy * sp * sr
    root[1, 0] = sy * sp * cr - cy * sr
    root[2, 0] = sy * cp
    root[0, 1] = cp * sr
    root[1, 1] = cp * cr
    root[2, 1] = -sp
    root[0, 2] = cy * sp * sr - sy * cr
    root[1, 2] = cy * sp * cr + sy * sr
    root[2, 2] = cy * cp
    for i in range(3):
        root[3, i] = translation[i]
    for b in range(chain.parents.size):
        place_bone(chain, b, sines, cosines, frames)


@inlined
def place_joints(chain, pose, translation, sines, cosines, frames, joints):
    """Write the joints (27, 3) of one pose (66,), and what `place_frames` does."""
    place_frames(chain, pose, translation, sines, cosines, frames)
    for j in range(joints.shape[0]):
        for i in range(3):
            joints[j, i] = frames[j, 3, i]


@inlined
def empty_frames(joints):
    """Return room for the frames of so many joints, no number of it undefined."""
    frames = np.empty((joints, 4, 4))
    for j in range(joints):
        for k in range(4):
            frames[j, k, 3] = 0.0
    return frames


@jit
def joint_positions(chain, poses, translations):
    """Return the joints (n, 27, 3) of poses (n, 66) with their root at translations (n, 3)."""
    n, count = poses.shape[0], chain.parents.size + 1
    joints = np.empty((n, count, 3))
    sines, cosines = np.empty(poses.shape[1]), np.empty(poses.shape[1])
    frames = empty_frames(count)
    for i in range(n):
        place_joints(chain, poses[i], translations[i], sines, cosines, frames, joints[i])
    return joints
