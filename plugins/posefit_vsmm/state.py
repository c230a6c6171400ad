"""The state that the motion models move: where the root is, and ten unit quaternions. VSMM step 3.

A state is (43,): the root's translation in metres, then w, x, y, z of the whole body and of nine bones, each turned
against its parent. Its error is (33,): metres, then a rotation vector a quaternion, applied on its right (Reading V4).
A joint that the state does not hold, such as the back's, follows those that it holds: see `Reliance`.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from posefit.arrays import Array, jit
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    root_angles_from_rotation,
    rotation_from_joint_angles,
    rotation_from_root_angles,
)
from posefit.geometry.skeleton import ANGLES, INNER, JOINTS, Skeleton, angle_index
from posefit_vsmm.imm import Manifold

BONES = (
    "lfemur",
    "ltibia",
    "rfemur",
    "rtibia",
    "lhumerus",
    "lradius",
    "rhumerus",
    "rradius",
    "lowerneck",
)  # hips, knees, shoulders, elbows, neck
STATE = 3 + 4 * (1 + len(BONES))
ERROR = 3 + 3 * (1 + len(BONES))
HELD = tuple(JOINTS.index(bone) for bone in BONES)  # the joints that these bones end in
HELD_ANGLES = np.array([angle_index(joint) + k for joint in HELD for k in range(3)])
OTHER_ANGLES = np.array([angle_index(j) + k for j in INNER if j not in HELD for k in range(3)])


@dataclass(frozen=True, eq=False)
class Reliance:
    """How the other joints follow: their angles are `matrix` @ the nine rotation vectors + `offset`."""

    matrix: Array = field(repr=False)  # (36, 27)
    offset: Array = field(repr=False)  # (36,) radians


def encode(poses: Array, translations: Array) -> Array:
    """Return the states (n, 43) of poses (n, 66) and translations (n, 3); signs are those that change least."""
    root = rotation_from_root_angles(poses[:, :3])
    held = rotation_from_joint_angles(poses[:, HELD_ANGLES].reshape(len(poses), -1, 3))
    rotations = np.concatenate([root[:, None], held], axis=1)
    quaternions = Rotation.from_matrix(rotations.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    quaternions = quaternions.reshape(len(poses), -1, 4)
    quaternions[0] *= np.where(quaternions[0, :, :1] < 0.0, -1.0, 1.0)
    for k in range(1, len(poses)):
        turned = np.einsum("ij,ij->i", quaternions[k], quaternions[k - 1]) < 0.0
        quaternions[k, turned] *= -1.0
    return np.column_stack([translations, quaternions.reshape(len(poses), -1)])


def free_errors(skeleton: Skeleton) -> Array:
    """Return 1 for each error (33,) that a skeleton's joints allow, and 0 for the others: a knee is a hinge."""
    return np.concatenate([np.ones(6), skeleton.free[HELD_ANGLES].astype(np.float64)])


def decode(states: Array, reliance: Reliance) -> tuple[Array, Array]:
    """Return the poses (n, 66) and the translations (n, 3) of states (n, 43)."""
    n = len(states)
    quaternions = Rotation.from_quat(states[:, 3:].reshape(-1, 4), scalar_first=True)
    rotations = quaternions.as_matrix().reshape(n, -1, 3, 3)
    vectors = quaternions.as_rotvec().reshape(n, -1)[:, 3:]
    poses = np.zeros((n, ANGLES))
    poses[:, :3] = root_angles_from_rotation(rotations[:, 0])
    poses[:, HELD_ANGLES] = joint_angles_from_rotation(rotations[:, 1:]).reshape(n, -1)
    poses[:, OTHER_ANGLES] = vectors @ reliance.matrix.T + reliance.offset
    return poses, states[:, :3].copy()


@jit
def plus(state, error):
    """Return the state (43,) moved by an error (33,)."""
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
    """Return the error (33,) that leads from `second` to `first`, both (43,), the shorter way round."""
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


MANIFOLD = Manifold(plus, minus)
