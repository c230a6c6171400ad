"""The motion models' step, quaternions, points with their Jacobian, and the skeleton line's branches, in numba.

Plain functions over arrays, scratch arrays among them; shapes are checked by the callers. Quaternions are w, x, y, z.
Everything is loops over numbers: a slice, a product of matrices or an array that is made here would each take numba
longer to compile than a whole function.
"""

import math

import numpy as np

from posefit.arrays import jit
from posefit.geometry.skeleton import JOINTS, PARENTS
from posefit_vsmm.state import ENDS, HELD, HELD_ANGLES, OTHER_ANGLES

# the joints that the errors turn: the whole body about the root, then each bone about its parent's end
_TURNING = np.array([0, *HELD])
_PIVOTS = np.array([0, *(PARENTS[joint] for joint in HELD)])
_OTHER_JOINTS = np.array([j for j in range(1, len(JOINTS)) if j in PARENTS and j not in HELD])
_OTHER_PIVOTS = np.array([PARENTS[joint] for joint in _OTHER_JOINTS])


_HANGS = np.eye(len(JOINTS), dtype=np.bool_)  # which joints (column) move when a joint (row) turns
for _joint in range(1, len(JOINTS)):
    _HANGS[:, _joint] |= _HANGS[:, PARENTS[_joint]]


@jit
def headed(state, headless, signs):
    """Return the heading (w, y) of a state (43,); write its quaternions (40,) without it, w positive, and their signs.

    The heading is the twist of the first one about the vertical: (w, 0, y, 0), made a unit.
    """
    size = math.sqrt(state[3] * state[3] + state[5] * state[5])
    sure = size > 1e-9
    c, s = state[3] / size if sure else 1.0, state[5] / size if sure else 0.0
    for j in range(signs.size):
        w, x, y, z = state[4 * j + 3], state[4 * j + 4], state[4 * j + 5], state[4 * j + 6]
        if j == 0:
            w, x, y, z = c * w + s * y, c * x - s * z, c * y - s * w, c * z + s * x
        sign = -1.0 if w < 0.0 else 1.0
        signs[j] = sign
        headless[4 * j], headless[4 * j + 1] = sign * w, sign * x
        headless[4 * j + 2], headless[4 * j + 3] = sign * y, sign * z
    return c, s


@jit
def tangents(quaternions, change):
    """Write the change (4 n, 3) of each of n quaternions (4 n,) by a small rotation on its right."""
    for r in range(0, quaternions.size, 4):
        w, x, y, z = quaternions[r], quaternions[r + 1], quaternions[r + 2], quaternions[r + 3]
        w, x, y, z = 0.5 * w, 0.5 * x, 0.5 * y, 0.5 * z
        change[r, 0], change[r, 1], change[r, 2] = -x, -y, -z
        change[r + 1, 0], change[r + 1, 1], change[r + 1, 2] = w, -z, y
        change[r + 2, 0], change[r + 2, 1], change[r + 2, 2] = z, w, -x
        change[r + 3, 0], change[r + 3, 1], change[r + 3, 2] = -y, x, w


@jit
def step(matrix, offset, share, leg, state, signs, before, after, change, flow, moved, jacobian):
    """Write the state `moved` (43,) that a model leads to, and the Jacobian (33, 33) of its error by the error before.

    The heading is taken out, the rest moved by `matrix` and `offset`, and the heading put back. Write q = h r for the
    whole body's quaternion, h its heading by an angle a about the vertical j, and r = (w, x, 0, z) what is headed.

    - An error d on the right makes r (1, d / 2), whose y is (z d_x + w d_y - x d_z) / 2. A turn of the heading by
      da / 2 takes w da / 2 out of it, so that y stays 0: da = (z / w, 1, -x / w) d, which is `turn_x`, 1, `turn_z`.
    - Of what is headed that leaves its own change less da / 2 times j r = (0, z, w, -x).
    - Put back before the moved r' = (w, x, y, z), the heading adds da / 2 times j r' = (-y, z, w, -x).
    - It also turns the way gone g about j, by da times j x g = (g_z, 0, -g_x).
    - The columns of a quaternion's tangents are orthogonal and of length 1/2: four times their transpose is what leads
      back from its change to an error on its right.

    `jacobian` comes full of zeros; `signs` (10,), `before` and `after` (40,), `change` (40, 3) and `flow` (43, 30), how
    the way and the quaternions after change with the errors before, are scratch.
    """
    c, s = headed(state, before, signs)
    n = signs.size
    sine, cosine = 2.0 * c * s, c * c - s * s  # of the heading, twice its half angle
    for i in range(offset.size):  # a way, then the change of each quaternion
        total = offset[i]
        for k in range(before.size):
            total += matrix[i, k] * before[k]
        moved[i] = share * total
    x, y, z = leg * moved[0], leg * moved[1], leg * moved[2]
    gone_x, gone_z = cosine * x + sine * z, cosine * z - sine * x
    moved[0], moved[1], moved[2] = state[0] + gone_x, state[1] + y, state[2] + gone_z
    w, x, z = before[0], before[1], before[3]
    turn_x, turn_z = z / w, -x / w  # how the heading turns with an error of the whole body
    tangents(before, change)
    for k in range(1, 4):  # less j r da / 2
        jr = 0.5 * (z if k == 1 else w if k == 2 else -x)
        change[k, 0] -= jr * turn_x
        change[k, 1] -= jr
        change[k, 2] -= jr * turn_z
    for i in range(offset.size):
        for k in range(n):
            for d in range(3):
                total = 0.0
                for r in range(4 * k, 4 * k + 4):
                    total += matrix[i, r] * change[r, d]
                flow[i, 3 * k + d] = share * total
    for j in range(n):
        size = 0.0
        for r in range(4 * j, 4 * j + 4):
            after[r] = before[r] + moved[3 + r]
            size += after[r] * after[r]
        size = math.sqrt(size)
        for r in range(4 * j, 4 * j + 4):
            after[r] /= size
            for d in range(3):
                flow[3 + r, 3 * j + d] += change[r, d]
            for k in range(3 * n):
                flow[3 + r, k] /= size
            moved[3 + r] = signs[j] * after[r]
    w, x, y, z = after[0], after[1], after[2], after[3]
    moved[3], moved[4] = signs[0] * (c * w - s * y), signs[0] * (c * x + s * z)
    moved[5], moved[6] = signs[0] * (c * y + s * w), signs[0] * (c * z - s * x)
    for r in range(4):  # and j r' da / 2
        jr = 0.5 * (-y if r == 0 else z if r == 1 else w if r == 2 else -x)
        flow[3 + r, 0] += jr * turn_x
        flow[3 + r, 1] += jr
        flow[3 + r, 2] += jr * turn_z
    tangents(after, change)
    for k in range(3 * n):
        x, z = flow[0, k], flow[2, k]
        jacobian[0, 3 + k] = leg * (cosine * x + sine * z)
        jacobian[1, 3 + k] = leg * flow[1, k]
        jacobian[2, 3 + k] = leg * (cosine * z - sine * x)
    for i in range(3):
        jacobian[i, i] = 1.0
        turn = turn_x if i == 0 else 1.0 if i == 1 else turn_z
        jacobian[0, 3 + i] += gone_z * turn
        jacobian[2, 3 + i] -= gone_x * turn
    for j in range(n):  # from changes of quaternions to errors
        for d in range(3):
            for k in range(3 * n):
                total = 0.0
                for r in range(4 * j, 4 * j + 4):
                    total += change[r, d] * flow[3 + r, k]
                jacobian[3 + 3 * j + d, 3 + k] = 4.0 * total


@jit
def bend(state, matrix, offset, vectors, pose, chained):
    """Write the pose (66,) of a state (43,), and how its other angles (36, 27) change with the errors of its bones.

    `matrix` (36, 27) and `offset` (36,) say how these angles follow the nine rotation vectors; `vectors` (27,), which
    are these, is scratch.
    """
    w, x, y, z = state[3], state[4], state[5], state[6]
    pose[0] = math.atan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))  # yaw, pitch, roll
    pose[1] = math.asin(min(1.0, max(-1.0, -2.0 * (y * z - w * x))))
    pose[2] = math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z))
    for v in range(0, vectors.size, 3):
        at, first = 7 + 4 * (v // 3), HELD_ANGLES[v]
        w, x, y, z = state[at], state[at + 1], state[at + 2], state[at + 3]
        pose[first] = math.atan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))  # rx, ry, rz
        pose[first + 1] = math.asin(min(1.0, max(-1.0, -2.0 * (x * z - w * y))))
        pose[first + 2] = math.atan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
        sign = -1.0 if w < 0.0 else 1.0
        size = math.sqrt(x * x + y * y + z * z)
        angle = 2.0 * math.atan2(size, sign * w)
        share = sign * (2.0 if size < 1e-8 else angle / size)
        x, y, z = share * x, share * y, share * z
        vectors[v], vectors[v + 1], vectors[v + 2] = x, y, z
        # the inverse of the right Jacobian: I + [v]/2 + k [v]^2
        k = 1.0 / 12.0
        if angle >= 1e-3:
            k = 1.0 / (angle * angle) - (1.0 + math.cos(angle)) / (2.0 * angle * math.sin(angle))
        own = 1.0 - k * angle * angle
        for i in range(offset.size):
            a, b, c = matrix[i, v], matrix[i, v + 1], matrix[i, v + 2]
            along = k * (a * x + b * y + c * z)
            chained[i, v] = own * a + along * x + 0.5 * (b * z - c * y)
            chained[i, v + 1] = own * b + along * y + 0.5 * (c * x - a * z)
            chained[i, v + 2] = own * c + along * z + 0.5 * (a * y - b * x)
    for i in range(offset.size):
        total = offset[i]
        for v in range(vectors.size):
            total += matrix[i, v] * vectors[v]
        pose[OTHER_ANGLES[i]] = total


@jit
def turned_about(axis_x, axis_y, axis_z, pivot, joint, joints, moves, column):
    """Write to `moves` (17, 3, n) in a column how the points move when a joint turns about an axis through another."""
    for p in range(moves.shape[0]):
        move_x, move_y, move_z = 0.0, 0.0, 0.0
        for end in range(2):  # a point is the middle of two joints
            j = ENDS[p, end]
            share = 0.5 if _HANGS[joint, j] else 0.0
            x = share * (joints[j, 0] - joints[pivot, 0])
            y = share * (joints[j, 1] - joints[pivot, 1])
            z = share * (joints[j, 2] - joints[pivot, 2])
            move_x += axis_y * z - axis_z * y
            move_y += axis_z * x - axis_x * z
            move_z += axis_x * y - axis_y * x
        moves[p, 0, column], moves[p, 1, column], moves[p, 2, column] = move_x, move_y, move_z


@jit
def points_and_jacobian(sines, cosines, frames, joints, points, jacobian, others):
    """Write the points (17, 3) of a body's joints (27, 3), and their Jacobian (17, 3, 33) by a state's error.

    The other joints' part of it is left out: `others` (17, 3, 36) is the Jacobian by their angles, of which `sines` and
    `cosines` (66,) are given. `jacobian` comes full of zeros.
    """
    for p in range(points.shape[0]):
        for i in range(3):
            points[p, i] = 0.5 * (joints[ENDS[p, 0], i] + joints[ENDS[p, 1], i])
            jacobian[p, i, i] = 1.0
    for k in range(3 * _TURNING.size):
        joint, pivot, i = _TURNING[k // 3], _PIVOTS[k // 3], k % 3
        turned_about(
            frames[joint, i, 0], frames[joint, i, 1], frames[joint, i, 2], pivot, joint, joints, jacobian, 3 + k
        )
    for k in range(others.shape[2]):
        joint, pivot, first = _OTHER_JOINTS[k // 3], _OTHER_PIVOTS[k // 3], OTHER_ANGLES[3 * (k // 3)]
        # the axes of rx, ry and rz in the world: those of the bone's own frame e_x, Rx' e_y and Rx' Ry' e_z
        sx, cx, sy, cy = sines[first], cosines[first], sines[first + 1], cosines[first + 1]
        i = k % 3
        a = 1.0 if i == 0 else 0.0 if i == 1 else -sy
        b = 0.0 if i == 0 else cx if i == 1 else sx * cy
        c = 0.0 if i == 0 else -sx if i == 1 else cx * cy
        turned_about(
            a * frames[joint, 0, 0] + b * frames[joint, 1, 0] + c * frames[joint, 2, 0],
            a * frames[joint, 0, 1] + b * frames[joint, 1, 1] + c * frames[joint, 2, 1],
            a * frames[joint, 0, 2] + b * frames[joint, 1, 2] + c * frames[joint, 2, 2],
            pivot,
            joint,
            joints,
            others,
            k,
        )


@jit
def branch(thin, number, row, column):
    """Return row and column where the line that ends in a pixel meets another; -1, -1 where it does not."""
    before_row, before_column = -1, -1
    for _ in range(thin.size):
        count, next_row, next_column = 0, -1, -1
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                y, x = row + dy, column + dx
                if thin[y, x] and (dy or dx) and not (y == before_row and x == before_column):
                    count, next_row, next_column = count + 1, y, x
        if count != 1:
            return (row, column) if count else (-1, -1)
        before_row, before_column, row, column = row, column, next_row, next_column
        if number[row, column] > 3:
            return row, column
    return -1, -1


@jit
def plus(state, error):
    """Return the state (3 + 4 n,) moved by an error (3 + 3 n,)."""
    moved = np.empty(state.size)
    for k in range(3):
        moved[k] = state[k] + error[k]
    for j in range((state.size - 3) // 4):
        x, y, z = error[3 + 3 * j], error[4 + 3 * j], error[5 + 3 * j]
        angle = np.sqrt(x * x + y * y + z * z)
        share = 0.5 - angle * angle / 48.0 if angle < 1e-4 else np.sin(0.5 * angle) / angle
        b0, b1, b2, b3 = np.cos(0.5 * angle), share * x, share * y, share * z
        at = 3 + 4 * j
        a0, a1, a2, a3 = state[at], state[at + 1], state[at + 2], state[at + 3]
        c0 = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3
        c1 = a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2
        c2 = a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1
        c3 = a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0
        size = np.sqrt(c0 * c0 + c1 * c1 + c2 * c2 + c3 * c3)
        moved[at], moved[at + 1], moved[at + 2], moved[at + 3] = c0 / size, c1 / size, c2 / size, c3 / size
    return moved


@jit
def minus(first, second):
    """Return the error (3 + 3 n,) that leads from `second` to `first`, both (3 + 4 n,), the shorter way round."""
    error = np.empty(3 + 3 * ((first.size - 3) // 4))
    for k in range(3):
        error[k] = first[k] - second[k]
    for j in range((first.size - 3) // 4):
        at = 3 + 4 * j
        a0, a1, a2, a3 = second[at], -second[at + 1], -second[at + 2], -second[at + 3]
        b0, b1, b2, b3 = first[at], first[at + 1], first[at + 2], first[at + 3]
        c0 = a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3
        c1 = a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2
        c2 = a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1
        c3 = a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0
        if c0 < 0.0:
            c0, c1, c2, c3 = -c0, -c1, -c2, -c3
        size = np.sqrt(c1 * c1 + c2 * c2 + c3 * c3)
        share = 2.0 if size < 1e-8 else 2.0 * np.arctan2(size, c0) / size
        error[3 + 3 * j], error[4 + 3 * j], error[5 + 3 * j] = share * c1, share * c2, share * c3
    return error
