"""The 17 points of a body that a silhouette may show, and how they move with the state. VSMM 6.1, Reading V2."""

from dataclasses import dataclass, field

import numpy as np

from posefit.arrays import Array, jit
from posefit.geometry.camera import Camera
from posefit.geometry.kernels import place_joints
from posefit.geometry.skeleton import ANGLES, JOINTS, PARENTS, Skeleton
from posefit_vsmm.state import ERROR, HELD, HELD_ANGLES, OTHER_ANGLES, Reliance

# Each point is the middle of two joints, or one joint twice.
_BETWEEN = {
    "head": ("upperneck", "head"),
    "root": ("root", "root"),
    "torso": ("upperback", "upperback"),
    "left clavicle": ("thorax", "lclavicle"),
    "right clavicle": ("thorax", "rclavicle"),
    "left shoulder": ("lclavicle", "lclavicle"),
    "right shoulder": ("rclavicle", "rclavicle"),
    "left elbow": ("lhumerus", "lhumerus"),
    "right elbow": ("rhumerus", "rhumerus"),
    "left hand": ("lwrist", "lwrist"),
    "right hand": ("rwrist", "rwrist"),
    "left hip": ("lhipjoint", "lhipjoint"),
    "right hip": ("rhipjoint", "rhipjoint"),
    "left knee": ("lfemur", "lfemur"),
    "right knee": ("rfemur", "rfemur"),
    "left foot": ("lfoot", "lfoot"),
    "right foot": ("rfoot", "rfoot"),
}
POINTS = tuple(_BETWEEN)
AT = {name: k for k, name in enumerate(POINTS)}
_ENDS = np.array([[JOINTS.index(joint) for joint in pair] for pair in _BETWEEN.values()])
_HELD = np.array(HELD)
_PARENTS = np.array(PARENTS)
_OTHER_JOINTS = np.array([j for j in range(1, len(JOINTS)) if j in PARENTS and j not in HELD])
NEAREST = 0.05  # metres: what is nearer to the camera than that is taken to be so far away


def points_of(joints: Array) -> Array:
    """Return the points (..., 17, 3) of joints (..., 27, 3)."""
    return np.asarray(0.5 * (joints[..., _ENDS[:, 0], :] + joints[..., _ENDS[:, 1], :]))


@dataclass(frozen=True, eq=False)
class Figure:
    """A skeleton as its states move it."""

    skeleton: Skeleton
    reliance: Reliance = field(repr=False)

    def points(self, state: Array) -> tuple[Array, Array]:
        """Return the points (17, 3) in metres of a state (43,), and their Jacobian (17, 3, 33) by its error."""
        found, jacobian = _points(self.skeleton.chain, state, self.reliance.matrix, self.reliance.offset)
        return found, jacobian

    def seen(self, camera: Camera, state: Array) -> tuple[Array, Array]:
        """Return where a camera sees the points (17, 2) of a state, in pixels, and their Jacobian (17, 2, 33)."""
        points, jacobian = self.points(state)
        inside = points @ camera.rotation.T + camera.translation
        depths = np.maximum(inside[:, 2], NEAREST)
        pixels = inside[:, :2] / depths[:, None] * camera.focal + camera.centre
        moving = camera.rotation @ jacobian  # (17, 3, 33)
        ratio = (inside[:, :2] / depths[:, None])[:, :, None]
        by_error = camera.focal[None, :, None] / depths[:, None, None] * (moving[:, :2] - ratio * moving[:, 2:])
        return pixels, by_error


@jit
def _rotation_vector(w, x, y, z, vector, back):
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
def _angles_of(w, x, y, z, order_root, out):
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
def _turned_about(axis, pivot, joint, parents, joints, moves, column):
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
def _points(chain, state, matrix, offset):
    pose = np.zeros(ANGLES)
    held = _HELD.size
    vectors, backs = np.empty(3 * held), np.empty((held, 3, 3))
    angles = np.empty(3)
    _angles_of(state[3], state[4], state[5], state[6], True, angles)
    pose[0:3] = angles
    for k in range(held):
        at = 7 + 4 * k
        w, x, y, z = state[at], state[at + 1], state[at + 2], state[at + 3]
        _rotation_vector(w, x, y, z, vectors[3 * k : 3 * k + 3], backs[k])
        _angles_of(w, x, y, z, False, angles)
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
        _turned_about(frames[0][:, i], joints[0], 0, _PARENTS, joints, moves, 3 + i)
    for k in range(held):
        joint = _HELD[k]
        for i in range(3):
            _turned_about(frames[joint][:, i], joints[_PARENTS[joint]], joint, _PARENTS, joints, moves, 6 + 3 * k + i)
    others = np.zeros((27, 3, offset.size))  # by the angles of the other joints
    axis = np.empty(3)
    for k in range(_OTHER_JOINTS.size):
        joint = _OTHER_JOINTS[k]
        first = OTHER_ANGLES[3 * k]
        frame, pivot = frames[joint], joints[_PARENTS[joint]]
        sx, cx, sy, cy = sines[first], cosines[first], sines[first + 1], cosines[first + 1]
        for i in range(3):
            axis[i] = frame[i, 0]
        _turned_about(axis, pivot, joint, _PARENTS, joints, others, 3 * k)
        for i in range(3):
            axis[i] = cx * frame[i, 1] - sx * frame[i, 2]
        _turned_about(axis, pivot, joint, _PARENTS, joints, others, 3 * k + 1)
        for i in range(3):
            axis[i] = -sy * frame[i, 0] + sx * cy * frame[i, 1] + cx * cy * frame[i, 2]
        _turned_about(axis, pivot, joint, _PARENTS, joints, others, 3 * k + 2)
    chained = np.zeros((offset.size, ERROR))
    for i in range(offset.size):
        for k in range(held):
            for j in range(3):
                total = 0.0
                for m in range(3):
                    total += matrix[i, 3 * k + m] * backs[k, m, j]
                chained[i, 6 + 3 * k + j] = total
    moves += (others.reshape(81, offset.size) @ chained).reshape(27, 3, ERROR)

    count = _ENDS.shape[0]
    points, jacobian = np.empty((count, 3)), np.empty((count, 3, ERROR))
    for p in range(count):
        a, b = _ENDS[p, 0], _ENDS[p, 1]
        points[p] = 0.5 * (joints[a] + joints[b])
        jacobian[p] = 0.5 * (moves[a] + moves[b])
    return points, jacobian
