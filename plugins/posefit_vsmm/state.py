"""The state that the motion models move, and the points of a body that a silhouette may show. VSMM 3 and 6.1.

A state is (43,): the root's translation in metres, then w, x, y, z of the whole body and of nine bones, each turned
against its parent. Its error is (33,): metres, then a rotation vector a quaternion, applied on its right
(Interpretation V4); `imm.PLACED` moves the one by the other. A joint that the state does not hold, such as the back's,
follows those that it holds: see `Reliance`. The 17 points are Interpretation V2.
"""

from dataclasses import dataclass, field

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    root_angles_from_rotation,
    rotation_from_joint_angles,
    rotation_from_root_angles,
)
from posefit.geometry.skeleton import ANGLES, INNER, JOINTS, Skeleton, turns_of

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
STATE = 3 + 4 * (1 + len(BONES))  # a place, and a quaternion of the whole body and of each bone
ERROR = 3 + 3 * (1 + len(BONES))  # a step, and a rotation vector of each of them
FIRST_BONE = 6  # where the bones' part of an error starts: behind the step and the whole body's rotation vector
# Where in an error the whole body's yaw, pitch and roll are: small turns about its y, x and z, whereas a rotation
# vector has them in the order x, y, z.
YAW_PITCH_ROLL = (4, 3, 5)
HELD = tuple(JOINTS.index(bone) for bone in BONES)  # the joints that these bones end in
HELD_ANGLES, OTHER_ANGLES = turns_of(BONES), turns_of([JOINTS[j] for j in INNER if j not in HELD])


def bone_errors(bone: str) -> slice:
    """Return where in an error (33,) the rotation vector of a bone is."""
    first = FIRST_BONE + 3 * BONES.index(bone)
    return slice(first, first + 3)


@dataclass(frozen=True, eq=False)
class Reliance:
    """How the other joints follow: their angles are `matrix` @ the nine rotation vectors + `offset`."""

    matrix: Array = field(repr=False)  # (36, 27)
    offset: Array = field(repr=False)  # (36,) radians


def encode(poses: Array, translations: Array) -> Array:
    """Return the states (n, 43) of poses (n, 66) and translations (n, 3); signs are those that change least."""
    from scipy.spatial.transform import Rotation  # a quarter of a second to import

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
    return np.concatenate([np.ones(FIRST_BONE), skeleton.free[HELD_ANGLES].astype(np.float64)])


def decode(states: Array, reliance: Reliance) -> tuple[Array, Array]:
    """Return the poses (n, 66) and the translations (n, 3) of states (n, 43)."""
    from scipy.spatial.transform import Rotation  # a quarter of a second to import

    n = len(states)
    quaternions = Rotation.from_quat(states[:, 3:].reshape(-1, 4), scalar_first=True)
    rotations = quaternions.as_matrix().reshape(n, -1, 3, 3)
    vectors = quaternions.as_rotvec().reshape(n, -1)[:, 3:]
    poses = np.zeros((n, ANGLES))
    poses[:, :3] = root_angles_from_rotation(rotations[:, 0])
    poses[:, HELD_ANGLES] = joint_angles_from_rotation(rotations[:, 1:]).reshape(n, -1)
    poses[:, OTHER_ANGLES] = vectors @ reliance.matrix.T + reliance.offset
    return poses, states[:, :3].copy()


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
ENDS = np.array([[JOINTS.index(joint) for joint in pair] for pair in _BETWEEN.values()])  # (17, 2) two joints a point
