"""Forward kinematics in numba: functions over arrays, whose callers check the shapes.

LANES poses are processed at a time, side by side in vector registers. All their numbers
are in one flat array: LANES values of one quantity, then LANES values of the next.
Because the compiler knows these offsets, it sees that rows do not overlap, and keeps
loops over lanes in registers. If it did not know them, it would have to compare
addresses first, and would use registers only in loops of 16 and more.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit

# poses side by side: the fewest for which the compiler uses vector registers
LANES = 16

# pi in two parts, so that angles of many turns keep their digits. The sine and the
# cosine are Taylor polynomials on [-pi/2, pi/2], where the first omitted term is below
# 1e-10.
PI_HIGH = 3.141592653589793
PI_LOW = 1.2246467991473532e-16

# The offsets of the rows of lanes, in this order:
# - the angles, then their sines and their cosines; each has three more, of angles that
#   are always 0;
# - a matrix (3, 4) from the world to the frame in which joints are placed;
# - the bones (26, 3) in their own frames;
# - the frames (27, 4, 3) of the joints: three axes and a position each;
# - the positions again: x of all 27 joints, then y, then z.
_ANGLES = 66
_BONES = 26
_JOINTS = 27
_ANGLE = 0
_SINE = _ANGLE + (_ANGLES + 3) * LANES
_COSINE = _SINE + (_ANGLES + 3) * LANES
_VIEW = _COSINE + (_ANGLES + 3) * LANES
_OFFSETS = _VIEW + 12 * LANES
_FRAMES = _OFFSETS + 3 * _BONES * LANES
X = _FRAMES + 12 * _JOINTS * LANES
Y = X + _JOINTS * LANES
Z = Y + _JOINTS * LANES
_END = Z + _JOINTS * LANES
# with this mask an index is provably not negative, and numba omits the test for that
NATURAL = 0x7FFFFFFF


class Chain(NamedTuple):
    """A skeleton as the kernel needs it; parents come before children."""

    parents: NDArray[np.int64]  # (26,) the joint where bone b starts; it ends in b + 1
    # (26,) the index of the bone's rx in a pose, or -1 if it cannot turn
    angles: NDArray[np.int64]
    turns: Array  # (26, 3, 3) parent's frame from this bone's frame, at rest
    offsets: Array  # (26, 3) the bone in its own frame


@inlined
def sine_cosine_near_zero(x):
    """Return the sine and cosine of an angle from -pi/2 to pi/2.

    They are polynomials, so that the compiler can use vector registers.
    """
    z = x * x
    s = -1.0 / 1307674368000.0
    s = s * z + 1.0 / 6227020800.0
    s = s * z - 1.0 / 39916800.0
    s = s * z + 1.0 / 362880.0
    s = s * z - 1.0 / 5040.0
    s = s * z + 1.0 / 120.0
    s = s * z - 1.0 / 6.0
    c = 1.0 / 20922789888000.0
    c = c * z - 1.0 / 87178291200.0
    c = c * z + 1.0 / 479001600.0
    c = c * z - 1.0 / 3628800.0
    c = c * z + 1.0 / 40320.0
    c = c * z - 1.0 / 720.0
    c = c * z + 1.0 / 24.0
    c = c * z - 0.5
    return x + x * z * s, 1.0 + z * c


@inlined
def sine_cosine(angle):
    """Return the sine and cosine of an angle."""
    turns = np.floor(angle * (1.0 / PI_HIGH) + 0.5)
    sign = 1.0 - 2.0 * (turns - 2.0 * np.floor(0.5 * turns))
    sine, cosine = sine_cosine_near_zero((angle - turns * PI_HIGH) - turns * PI_LOW)
    return sign * sine, sign * cosine


@inlined
def rotated(first, second, sine, cosine):
    """Return one coordinate of two axes after a rotation about the third."""
    return first * cosine + second * sine, second * cosine - first * sine


@inlined
def empty_lanes():
    """Return the array for LANES poses; joints are placed in the world's frame."""
    lanes = np.empty(_END)
    for k in range(12 * LANES):
        lanes[_VIEW + k] = 1.0 if k // LANES % 5 == 0 else 0.0
    for k in range(3 * LANES):
        lanes[_SINE + _ANGLES * LANES + k], lanes[_COSINE + _ANGLES * LANES + k] = (
            0.0,
            1.0,
        )
    return lanes


@inlined
def set_view(lanes, first, stop, rotation, translation, focal, centre):
    """Make some lanes place joints in a camera's picture.

    Their coordinates are x and y in pixels, times the depth, and the depth.
    """
    for i in range(translation.size):
        for j in range(translation.size + 1):
            coordinate, depth = (
                (rotation[i, j], rotation[2, j])
                if j < 3
                else (translation[i], translation[2])
            )
            value = focal[i] * coordinate + centre[i] * depth if i < 2 else depth
            for lane in range(first, stop):
                lanes[_VIEW + LANES * (4 * i + j) + lane] = value


@inlined
def set_offsets(lanes, first, stop, offsets):
    """Give some lanes the bones of a body (26, 3)."""
    # with constant bounds the compiler would unroll these loops completely
    for b in range(offsets.shape[0]):
        for i in range(offsets.shape[1]):
            for lane in range(first, stop):
                lanes[_OFFSETS + LANES * (3 * b + i) + lane] = offsets[b, i]


@inlined
def all_same(rows):
    """Return whether all lanes have the same pose, as for the last of n poses."""
    same = True
    for lane in range(1, LANES):
        same &= rows[lane] == rows[0]
    return same


@inlined
def write_sines(poses, rows, lanes):
    """Write the sines and cosines of the angles of a pose for each lane."""
    for lane in range(LANES):
        for a in range(_ANGLES):
            lanes[_ANGLE + LANES * a + lane] = poses[rows[lane], a]
    for k in range(LANES * _ANGLES):
        sine, cosine = sine_cosine(lanes[_ANGLE + k])
        lanes[_SINE + k] = sine
        lanes[_COSINE + k] = cosine


@inlined
def write_sines_of_one(pose, lanes):
    """Write sines and cosines of one pose that is in all lanes, each computed once."""
    # one angle after another, in the room of the angles of all lanes
    sines = _ANGLE + _ANGLES
    cosines = sines + _ANGLES
    for a in range(_ANGLES):
        lanes[_ANGLE + a] = pose[a]
    for a in range(_ANGLES):
        sine, cosine = sine_cosine(lanes[_ANGLE + a])
        lanes[sines + a] = sine
        lanes[cosines + a] = cosine
    for a in range(_ANGLES):
        for lane in range(LANES):
            lanes[_SINE + LANES * a + lane] = lanes[sines + a]
            lanes[_COSINE + LANES * a + lane] = lanes[cosines + a]


@inlined
def place_roots(places, rows, lanes):
    """Write the frames of the root joints, at places (n, 3).

    Their axes are Ry @ Rx @ Rz of yaw, pitch and roll.
    """
    for k in range(LANES):
        sy = lanes[_SINE + k]
        sp = lanes[_SINE + LANES + k]
        sr = lanes[_SINE + 2 * LANES + k]
        cy = lanes[_COSINE + k]
        cp = lanes[_COSINE + LANES + k]
        cr = lanes[_COSINE + 2 * LANES + k]
        ux = cy * cr + sy * sp * sr
        uy = cp * sr
        uz = cy * sp * sr - sy * cr
        vx = sy * sp * cr - cy * sr
        vy = cp * cr
        vz = cy * sp * cr + sy * sr
        wx = sy * cp
        wy = -sp
        wz = cy * cp
        x = places[rows[k], 0]
        y = places[rows[k], 1]
        z = places[rows[k], 2]
        for i in range(3):
            at = _VIEW + 4 * LANES * i + k
            to = _FRAMES + LANES * i + k
            a = lanes[at]
            b = lanes[at + LANES]
            c = lanes[at + 2 * LANES]
            lanes[to] = a * ux + b * uy + c * uz
            lanes[to + 3 * LANES] = a * vx + b * vy + c * vz
            lanes[to + 2 * 3 * LANES] = a * wx + b * wy + c * wz
            lanes[to + 3 * 3 * LANES] = a * x + b * y + c * z + lanes[at + 3 * LANES]


@inlined
def place_bones(chain, lanes):
    """Write the frame at the end of each bone, from the frame at its start."""
    parents, angles, turns, _ = chain
    for b in range(parents.size):
        a = angles[b] if angles[b] >= 0 else _ANGLES
        # read before the loop: the compiler assumes that writing lanes changes them
        xx = turns[b, 0, 0]
        xy = turns[b, 0, 1]
        xz = turns[b, 0, 2]
        yx = turns[b, 1, 0]
        yy = turns[b, 1, 1]
        yz = turns[b, 1, 2]
        zx = turns[b, 2, 0]
        zy = turns[b, 2, 1]
        zz = turns[b, 2, 2]
        sine = (_SINE + LANES * a) & NATURAL
        cosine = (_COSINE + LANES * a) & NATURAL
        offset = (_OFFSETS + 3 * LANES * b) & NATURAL
        for i in range(3):
            start = (_FRAMES + LANES * (12 * parents[b] + i)) & NATURAL
            end = (_FRAMES + LANES * (12 * b + 12 + i)) & NATURAL
            for k in range(LANES):
                x = lanes[start + k]
                y = lanes[start + 3 * LANES + k]
                z = lanes[start + 6 * LANES + k]
                u = x * xx + y * yx + z * zx
                v = x * xy + y * yy + z * zy
                w = x * xz + y * yz + z * zz
                # Rz @ Ry @ Rx
                u, v = rotated(
                    u, v, lanes[sine + 2 * LANES + k], lanes[cosine + 2 * LANES + k]
                )
                w, u = rotated(w, u, lanes[sine + LANES + k], lanes[cosine + LANES + k])
                v, w = rotated(v, w, lanes[sine + k], lanes[cosine + k])
                x = lanes[offset + k]
                y = lanes[offset + LANES + k]
                z = lanes[offset + 2 * LANES + k]
                (
                    lanes[end + k],
                    lanes[end + 3 * LANES + k],
                    lanes[end + 6 * LANES + k],
                ) = u, v, w
                lanes[end + 9 * LANES + k] = (
                    lanes[start + 9 * LANES + k] + u * x + v * y + w * z
                )


@jit
def place_lanes(chain, poses, places, rows, lanes):
    """Write the frames and joints of LANES poses.

    `rows` (LANES,) has their indices in `poses` (n, 66) and in `places` (n, 3), which
    has the positions of the roots.
    """
    if all_same(rows):
        write_sines_of_one(poses[rows[0]], lanes)
    else:
        write_sines(poses, rows, lanes)
    place_roots(places, rows, lanes)
    place_bones(chain, lanes)
    for j in range(_JOINTS):
        for i in range(3):
            for lane in range(LANES):
                place = lanes[_FRAMES + LANES * (12 * j + 9 + i) + lane]
                lanes[X + LANES * (_JOINTS * i + j) + lane] = place


@inlined
def set_rows(rows, first, n):
    """Write the indices of the LANES poses from `first` on.

    Beyond the last of the n poses its index is repeated.
    """
    for lane in range(LANES):
        rows[lane] = min(first + lane, n - 1)


@jit
def place_frames(chain, poses, places, sines, cosines, frames):
    """Write the frames (n, 27, 4, 3) of the joints of poses (n, 66) at places (n, 3).

    A frame is three axes and an origin. The sines and cosines (n, 66) of the angles are
    written too.
    """
    n = poses.shape[0]
    rows = np.empty(LANES, np.int64)
    lanes = empty_lanes()
    set_offsets(lanes, 0, LANES, chain.offsets)
    for first in range(0, n, LANES):
        set_rows(rows, first, n)
        place_lanes(chain, poses, places, rows, lanes)
        for lane in range(min(LANES, n - first)):
            for a in range(_ANGLES):
                at = LANES * a + lane
                sines[first + lane, a], cosines[first + lane, a] = (
                    lanes[_SINE + at],
                    lanes[_COSINE + at],
                )
            for j in range(_JOINTS):
                for k in range(4):
                    for i in range(3):
                        frames[first + lane, j, k, i] = lanes[
                            _FRAMES + 3 * LANES * (4 * j + k) + LANES * i + lane
                        ]


@inlined
def read_joints(lanes, lane, joints):
    """Write the joints (27, 3) of a lane."""
    for j in range(_JOINTS):
        for i in range(3):
            joints[j, i] = lanes[X + LANES * (_JOINTS * i + j) + lane]


@jit
def joint_positions(chain, poses, places):
    """Return the joints (n, 27, 3) of poses (n, 66) with roots at places (n, 3)."""
    n = poses.shape[0]
    rows = np.empty(LANES, np.int64)
    lanes = empty_lanes()
    joints = np.empty((n, _JOINTS, 3))
    set_offsets(lanes, 0, LANES, chain.offsets)
    for first in range(0, n, LANES):
        set_rows(rows, first, n)
        place_lanes(chain, poses, places, rows, lanes)
        for lane in range(min(LANES, n - first)):
            read_joints(lanes, lane, joints[first + lane])
    return joints


@inlined
def joint_distance(joints, i, j, targets, k):
    """Return the distance of joint j of pose i from the same joint of target k."""
    x = joints[i, j, 0] - targets[k, j, 0]
    y = joints[i, j, 1] - targets[k, j, 1]
    z = joints[i, j, 2] - targets[k, j, 2]
    return math.sqrt(x * x + y * y + z * z)


@jit
def write_mean_distances(joints, targets, distances):
    """Write the mean distances (n, K) of joints (n, 27, 3) from others (K, 27, 3)."""
    count = joints.shape[1]
    for i in range(joints.shape[0]):
        for k in range(targets.shape[0]):
            total = 0.0
            for j in range(count):
                total += joint_distance(joints, i, j, targets, k)
            distances[i, k] = total / count


@jit
def lower_to_nearest(joints, targets, least):
    """Lower `least` (n,) to the summed distances of joints from the nearest target.

    Joints are (n, 27, 3), and targets are (K, 27, 3). The sums of most targets end
    after a few joints, which alone are farther away than all of the nearest target.
    """
    count = joints.shape[1]
    for i in range(joints.shape[0]):
        for k in range(targets.shape[0]):
            total = 0.0
            for j in range(count):
                total += joint_distance(joints, i, j, targets, k)
                if total >= least[i]:
                    break
            least[i] = min(least[i], total)
