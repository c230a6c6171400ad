"""The person's bones: 27 joints, 66 angles.

A pose is (66,): root yaw, pitch, roll, then rx, ry, rz of the 21 inner joints in the order of `JOINTS`.
Following Acclaim, a joint is named after the bone that ends in it, and the angles of that name turn that
bone about the joint it starts from. The five end bones have no freedom. SAPSO section 2.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, frozen, writeable
from posefit.errors import InputError
from posefit.geometry import kernels
from posefit.geometry.rotation import (
    rotation_from_joint_angles,
    rotation_from_root_angles,
)

# The chains of bones between the joints where several begin; l and r are left and right.
LIMBS: Mapping[str, Sequence[str]] = {
    "left leg": ("lhipjoint", "lfemur", "ltibia", "lfoot", "ltoes"),
    "right leg": ("rhipjoint", "rfemur", "rtibia", "rfoot", "rtoes"),
    "left arm": ("lclavicle", "lhumerus", "lradius", "lwrist", "lhand"),
    "right arm": ("rclavicle", "rhumerus", "rradius", "rwrist", "rhand"),
    "head": ("lowerneck", "upperneck", "head"),
}
_LEGS = (LIMBS["left leg"], LIMBS["right leg"])
_ARMS = (LIMBS["left arm"], LIMBS["right arm"])
_TORSO = ("lowerback", "upperback", "thorax", *LIMBS["head"])
_PARENT = {"root": "root"}  # of each joint, parents before children
for _start, *_chain in (
    *(("root", *leg) for leg in _LEGS),
    ("root", *_TORSO),
    *(("thorax", *arm) for arm in _ARMS),
):
    _PARENT.update(zip(_chain, [_start, *_chain], strict=False))

JOINTS = tuple(_PARENT)  # 27 names, parents before children
PARENTS = (-1, *map(JOINTS.index, [*_PARENT.values()][1:]))  # PARENTS[0] is -1
BONES = JOINTS[1:]  # bone b runs from joint PARENTS[b + 1] to joint b + 1
ENDS = tuple(j for j in range(len(JOINTS)) if j not in PARENTS)
INNER = tuple(j for j in range(1, len(JOINTS)) if j in PARENTS)
ANGLES = 3 + 3 * len(INNER)  # M = 66

Channels = tuple[tuple[str, tuple[str, ...]], ...]
Side = Literal["left", "right", "middle"]
# first letters of names that come in pairs, such as lfemur and rfemur
_OTHER = {"l": "r", "r": "l"}


def mirrored(bone: str) -> str:
    """Return the name of the bone, or joint, on the other side of the body; of one in the middle, its own."""
    other = _OTHER.get(bone[0], "") + bone[1:]
    return other if other in JOINTS else bone


def side(bone: str) -> Side:
    """Return on which side of the body a bone, or the joint it ends in, is."""
    if mirrored(bone) == bone:
        return "middle"
    return "left" if bone[0] == "l" else "right"


def kind(bone: str) -> str:
    """Return a bone's name without its side: `femur` of `lfemur` and `rfemur`, `head` of `head`."""
    return bone if side(bone) == "middle" else bone[1:]


def both(kind: str) -> tuple[str, str]:
    """Return the names of the left and of the right bone of a kind such as `femur`."""
    return f"l{kind}", f"r{kind}"


# (27,) the joint on the other side of the body
MIRROR = tuple(JOINTS.index(mirrored(name)) for name in JOINTS)
# (27,) left, right or middle
SIDES: tuple[Side, ...] = tuple(side(name) for name in JOINTS)


def angle_index(joint: int) -> int:
    """Return where in a pose the three angles of an inner joint start, or -1 for an end joint."""
    return 3 + 3 * INNER.index(joint) if joint in INNER else -1


def channel_angles(bone: str, channels: Sequence[str]) -> list[int]:
    """Return the places in a pose (66,) of some angles of a bone, such as `rx` and `rz`; none for an end bone."""
    start = angle_index(JOINTS.index(bone)) if bone in JOINTS else -1
    return (
        [start + "xyz".index(channel[1]) for channel in channels] if start > 0 else []
    )


def angles_of(bones: Sequence[str]) -> NDArray[np.intp]:
    """Return the places in a pose (66,) of all angles that turn some bones."""
    return np.array(
        [angle for bone in bones for angle in channel_angles(bone, ("rx", "ry", "rz"))],
        dtype=np.intp,
    )


# (26,) of each bone: the joint it starts from, and the place in a pose of its first angle, -1 for an end bone
_STARTS = np.array(PARENTS[1:])
_FIRST_ANGLES = np.array([angle_index(j) for j in range(1, len(JOINTS))])


def root_centred(joints: Array) -> Array:
    """Return joints (..., 27, 3) with their root at the origin."""
    return np.asarray(joints - joints[..., :1, :])


def joint_distances(first: Array, second: Array) -> Array:
    """Return the distances (..., 27) between joints (..., 27, 3), both roots at one point."""
    return np.asarray(
        np.linalg.norm(root_centred(first) - root_centred(second), axis=-1)
    )


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Bone vectors at rest and the frames their angles are counted in. Lengths are metres."""

    name: str
    # (26, 3) from a bone's start to its end, at rest, in the world frame
    offsets: Array = field(repr=False)
    # (26, 3, 3) world_from_bone at rest: the frame of the bone's angles
    axes: Array = field(repr=False)
    # the .amc layout after the root: (bone, its free angles) in file order
    channels: Channels = field(repr=False)
    # (63, 2) radians: lowest and highest of each joint angle, 0 for padding; None where unknown
    limits: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        shapes = {"offsets": (26, 3), "axes": (26, 3, 3)} | (
            {} if self.limits is None else {"limits": (63, 2)}
        )
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        if self.limits is not None and (self.limits[:, 0] > self.limits[:, 1]).any():
            raise InputError(
                "limits must not be reversed, got a lowest angle above the highest"
            )

    @cached_property
    def lengths(self) -> Array:
        """Bone lengths (26,) in metres."""
        return np.asarray(np.linalg.norm(self.offsets, axis=1))

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which of the 66 angles the subject really has (66,); the others are padding and stay zero."""
        free = np.zeros(ANGLES, dtype=bool)
        free[:3] = True
        for bone, angles in self.channels:
            free[channel_angles(bone, angles)] = True
        return free

    @cached_property
    def chain(self) -> kernels.Chain:
        """The constant part of every bone's transform."""
        before = np.concatenate([np.eye(3)[None], self.axes])[_STARTS]
        turns = np.swapaxes(before, 1, 2) @ self.axes
        turns[np.abs(turns - np.eye(3)).max(axis=(1, 2)) <= 1e-12] = np.eye(3)
        return kernels.Chain(
            _STARTS,
            _FIRST_ANGLES,
            turns,
            np.einsum("bji,bj->bi", self.axes, self.offsets),
        )

    def turns(self, poses: Array) -> Array:
        """Return how each bone, named by the joint it ends in, turns (27, T, 3, 3) from rest in poses (T, 66).

        That is in the frame of the bone before it; the root's turn is in the world, and end bones have none.
        """
        turns = np.tile(np.eye(3), (len(JOINTS), len(poses), 1, 1))
        turns[0] = rotation_from_root_angles(poses[:, :3])
        for joint in INNER:
            first = angle_index(joint)
            axes = self.axes[joint - 1]
            turns[joint] = (
                axes @ rotation_from_joint_angles(poses[:, first : first + 3]) @ axes.T
            )
        return turns

    def frames(self, poses: Array, translations: Array) -> tuple[Array, Array, Array]:
        """Return the frames (n, 27, 4, 3) of the joints of poses (n, 66) with their roots at translations (n, 3).

        A frame is three axes and a place. With them come the sines and the cosines (n, 66) of the angles.
        """
        frames = np.empty((len(poses), len(JOINTS), 4, 3))
        sines = np.empty((len(poses), ANGLES))
        cosines = np.empty((len(poses), ANGLES))
        kernels.place_frames(
            self.chain,
            writeable(poses),
            writeable(translations),
            sines,
            cosines,
            frames,
        )
        return frames, sines, cosines

    def joints(self, poses: Array, translations: Array | None = None) -> Array:
        """Return joint positions (..., 27, 3) in metres, world frame, of poses (..., 66).

        `translations` (..., 3) places the root joint; without it the root is at the origin.
        Raises InputError where a shape does not fit.
        """
        poses = np.asarray(poses, dtype=np.float64)
        if poses.ndim < 1 or poses.shape[-1] != ANGLES:
            raise InputError(
                f"poses must have shape (..., {ANGLES}), got {poses.shape}"
            )
        lead = poses.shape[:-1]
        where = (
            np.zeros((*lead, 3))
            if translations is None
            else np.asarray(translations, dtype=np.float64)
        )
        if where.shape != (*lead, 3):
            raise InputError(
                f"translations must have shape {(*lead, 3)}, got {where.shape}"
            )
        flat = writeable(poses.reshape(-1, ANGLES))
        positions = kernels.joint_positions(
            self.chain, flat, writeable(where.reshape(-1, 3))
        )
        return np.asarray(positions).reshape(*lead, len(JOINTS), 3)
