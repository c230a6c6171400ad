"""The motion models' step, the points with their Jacobian, and the skeleton line's branches, in numba.

Plain functions over arrays; shapes are checked by the callers. Quaternions are w, x, y, z.
"""

import numpy as np

from posefit.arrays import jit
from posefit.geometry.kernels import place_joints
from posefit.geometry.skeleton import ANGLES, JOINTS, PARENTS
from posefit_imm.kernels import product
from posefit_vsmm.points import ENDS
from posefit_vsmm.state import ERROR, FIRST_BONE, HELD, HELD_ANGLES, OTHER_ANGLES

_HELD = np.array(HELD)
_PARENTS = np.array(PARENTS)
_OTHER_JOINTS = np.array([j for j in range(1, len(JOINTS)) if j in PARENTS and j not in HELD])


@jit
def headed(quaternions):
    """Return the heading (4,) of quaternions (n, 4), they without it and with w positive, and the signs they had (n,).

    The heading is the twist of the first one about the vertical: (w, 0, y, 0), made a unit.
    """
    back = np.array([quaternions[0, 0], 0.0, quaternions[0, 2], 0.0])
    size = np.sqrt(back[0] ** 2 + back[2] ** 2)
    if size > 1e-9:
        back /= size
    else:
        back[0], back[2] = 1.0, 0.0
    found, signs = quaternions.copy(), np.ones(len(quaternions))
    found[0] = product(np.array([back[0], 0.0, -back[2], 0.0]), found[0])
    for j in range(len(found)):
        if found[j, 0] < 0.0:
            signs[j] = -1.0
            found[j] *= -1.0
    return back, found, signs


@jit
def tangents(quaternions):
    """Return the change (4 n, 3 n) of quaternions (n, 4) by small rotations on their right."""
    n = len(quaternions)
    change = np.zeros((4 * n, 3 * n))
    for j in range(n):
        w, x, y, z = 0.5 * quaternions[j]
        r, c = 4 * j, 3 * j
        change[r, c], change[r, c + 1], change[r, c + 2] = -x, -y, -z
        change[r + 1, c], change[r + 1, c + 1], change[r + 1, c + 2] = w, -z, y
        change[r + 2, c], change[r + 2, c + 1], change[r + 2, c + 2] = z, w, -x
        change[r + 3, c], change[r + 3, c + 1], change[r + 3, c + 2] = -y, x, w
    return change


@jit
def step(matrix, offset, share, leg, state):
    """Return the state (43,) that a model leads to, and the Jacobian (33, 33) of its error by the error before.

    The heading is taken out, the rest moved by `matrix` and `offset`, and the heading put back. Write q = h r for the
    whole body's quaternion, h its heading by an angle a about the vertical j, and r = (w, x, 0, z) what is headed.

    - An error d on the right makes r (1, d / 2), whose y is (z d_x + w d_y - x d_z) / 2. A turn of the heading by
      da / 2 takes w da / 2 out of it, so that y stays 0: da = (z / w, 1, -x / w) d, which is `by_heading`.
    - Of what is headed that leaves its own change less da / 2 times j r = (0, z, w, -x).
    - Put back before the moved r' = (w, x, y, z), the heading adds da / 2 times j r' = (-y, z, w, -x).
    - It also turns the way gone g about j, by da times j x g = (g_z, 0, -g_x).
    - The columns of a quaternion's tangents are orthogonal and of length 1/2: four times their transpose is what leads
      back from its change to an error on its right.
    """
    back, before, signs = headed(state[3:].copy().reshape(-1, 4))
    change = share * (matrix @ before.ravel() + offset)  # a step, then the change of each quaternion
    n = len(before)
    # the heading's rotation matrix, by the sine and cosine of twice its half angle
    sine, cosine = 2.0 * back[0] * back[2], back[0] ** 2 - back[2] ** 2
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    after = before + change[3:].copy().reshape(n, 4)
    sizes = np.empty(n)
    for j in range(n):
        sizes[j] = np.sqrt((after[j] ** 2).sum())
        after[j] /= sizes[j]
    moved = np.empty(state.size)
    gone = leg * (turn @ change[:3].copy())
    moved[:3] = state[:3] + gone
    for j in range(n):
        moved[3 + 4 * j : 7 + 4 * j] = signs[j] * (product(back, after[0]) if j == 0 else after[j])
    w, x, _, z = before[0]
    by_heading = np.array([z / w, 1.0, -x / w])  # how the heading turns with an error of the whole body
    flow = tangents(before)
    flow[:4, :3] -= 0.5 * np.outer(np.array([0.0, z, w, -x]), by_heading)  # less j r da / 2
    change_flow = share * (matrix @ flow)  # (43, 30)
    flow += change_flow[3:]
    for j in range(n):
        flow[4 * j : 4 * j + 4] /= sizes[j]
    w, x, y, z = after[0]
    flow[:4, :3] += 0.5 * np.outer(np.array([-y, z, w, -x]), by_heading)  # and j r' da / 2
    jacobian = np.eye(3 + 3 * n)
    jacobian[:3, 3:] = leg * (turn @ change_flow[:3].copy())
    jacobian[:3, 3:6] += np.outer(np.array([gone[2], 0.0, -gone[0]]), by_heading)
    jacobian[3:, 3:] = 4.0 * (tangents(after).T.copy() @ flow)  # from changes of quaternions to errors
    return moved, jacobian


@jit
def rotation_vector(w, x, y, z, vector, back):
    """Write the rotation vector (3,) of a quaternion, and its Jacobian (3, 3) by a small rotation on its right."""
    sign = -1.0 if w < 0.0 else 1.0
    w, x, y, z = sign * w, sign * x, sign * y, sign * z
    size = np.sqrt(x * x + y * y + z * z)
    angle = 2.0 * np.arctan2(size, w)
    share = 2.0 if size < 1e-8 else angle / size
    vector[0], vector[1], vector[2] = share * x, share * y, share * z
    # the inverse of the right Jacobian: I + [v]/2 + k [v]^2
    k = 1.0 / 12.0 if angle < 1e-3 else 1.0 / (angle * angle) - (1.0 + np.cos(angle)) / (2.0 * angle * np.sin(angle))
    for i in range(3):
        for j in range(3):
            back[i, j] = k * vector[i] * vector[j]
        back[i, i] += 1.0 - k * angle * angle
    back[0, 1] -= 0.5 * vector[2]
    back[0, 2] += 0.5 * vector[1]
    back[1, 0] += 0.5 * vector[2]
    back[1, 2] -= 0.5 * vector[0]
    back[2, 0] -= 0.5 * vector[1]
    back[2, 1] += 0.5 * vector[0]


@jit
def euler_angles(w, x, y, z, order_root, out):
    """Write the three angles of a quaternion: yaw, pitch, roll, or rx, ry, rz."""
    if order_root:
        out[0] = np.arctan2(2.0 * (x * z + w * y), 1.0 - 2.0 * (x * x + y * y))
        out[1] = np.arcsin(min(1.0, max(-1.0, -2.0 * (y * z - w * x))))
        out[2] = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z))
    else:
        out[0] = np.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
        out[1] = np.arcsin(min(1.0, max(-1.0, -2.0 * (x * z - w * y))))
        out[2] = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))


@jit
def turned_about(axis, pivot, joint, parents, joints, moves, column):
    """Add to `moves` (27, 3, n) in a column how all joints move that hang on `joint` when it turns about an axis."""
    for j in range(joint, joints.shape[0]):
        above = j
        while above > joint:
            above = parents[above]
        if above != joint:
            continue
        x, y, z = joints[j, 0] - pivot[0], joints[j, 1] - pivot[1], joints[j, 2] - pivot[2]
        moves[j, 0, column] += axis[1] * z - axis[2] * y
        moves[j, 1, column] += axis[2] * x - axis[0] * z
        moves[j, 2, column] += axis[0] * y - axis[1] * x


@jit
def points_and_jacobian(chain, state, matrix, offset):
    """Return the points (17, 3) in metres of a state (43,), and their Jacobian (17, 3, 33) by its error.

    `matrix` (36, 27) and `offset` (36,) say how the angles of the other joints follow the nine rotation vectors.
    """
    pose = np.zeros(ANGLES)
    held = _HELD.size
    vectors, backs = np.empty(3 * held), np.empty((held, 3, 3))
    angles = np.empty(3)
    euler_angles(state[3], state[4], state[5], state[6], True, angles)
    pose[0:3] = angles
    for k in range(held):
        at = 7 + 4 * k
        w, x, y, z = state[at], state[at + 1], state[at + 2], state[at + 3]
        rotation_vector(w, x, y, z, vectors[3 * k : 3 * k + 3], backs[k])
        euler_angles(w, x, y, z, False, angles)
        for i in range(3):
            pose[HELD_ANGLES[3 * k + i]] = angles[i]
    for i in range(offset.size):
        total = offset[i]
        for j in range(vectors.size):
            total += matrix[i, j] * vectors[j]
        pose[OTHER_ANGLES[i]] = total
    sines, cosines, frames, joints = np.empty(ANGLES), np.empty(ANGLES), np.empty((27, 3, 3)), np.empty((27, 3))
    place_joints(chain, pose, state[:3], sines, cosines, frames, joints)

    moves = np.zeros((27, 3, ERROR))  # of the joints, by the error
    for i in range(3):
        moves[:, i, i] = 1.0
        turned_about(frames[0][:, i], joints[0], 0, _PARENTS, joints, moves, 3 + i)
    for k in range(held):
        joint = _HELD[k]
        for i in range(3):
            turned_about(
                frames[joint][:, i], joints[_PARENTS[joint]], joint, _PARENTS, joints, moves, FIRST_BONE + 3 * k + i
            )
    others = np.zeros((27, 3, offset.size))  # by the angles of the other joints
    axis = np.empty(3)
    for k in range(_OTHER_JOINTS.size):
        joint = _OTHER_JOINTS[k]
        first = OTHER_ANGLES[3 * k]
        frame, pivot = frames[joint], joints[_PARENTS[joint]]
        # the axes of rx, ry and rz in the world: those of the bone's own frame e_x, Rx' e_y and Rx' Ry' e_z
        sx, cx, sy, cy = sines[first], cosines[first], sines[first + 1], cosines[first + 1]
        for i in range(3):
            axis[i] = frame[i, 0]
        turned_about(axis, pivot, joint, _PARENTS, joints, others, 3 * k)
        for i in range(3):
            axis[i] = cx * frame[i, 1] - sx * frame[i, 2]
        turned_about(axis, pivot, joint, _PARENTS, joints, others, 3 * k + 1)
        for i in range(3):
            axis[i] = -sy * frame[i, 0] + sx * cy * frame[i, 1] + cx * cy * frame[i, 2]
        turned_about(axis, pivot, joint, _PARENTS, joints, others, 3 * k + 2)
    chained = np.zeros((offset.size, ERROR))
    for i in range(offset.size):
        for k in range(held):
            for j in range(3):
                total = 0.0
                for m in range(3):
                    total += matrix[i, 3 * k + m] * backs[k, m, j]
                chained[i, FIRST_BONE + 3 * k + j] = total
    moves += (others.reshape(81, offset.size) @ chained).reshape(27, 3, ERROR)

    count = ENDS.shape[0]
    points, jacobian = np.empty((count, 3)), np.empty((count, 3, ERROR))
    for p in range(count):
        a, b = ENDS[p, 0], ENDS[p, 1]
        points[p] = 0.5 * (joints[a] + joints[b])
        jacobian[p] = 0.5 * (moves[a] + moves[b])
    return points, jacobian


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
