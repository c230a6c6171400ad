"""The person's bones: 27 joints, 66 angles.

A pose (66,) has the root's yaw, pitch and roll, then rx, ry and rz of the 21 inner
joints in the order of `JOINTS`. As in Acclaim files, a joint has the name of the bone
that ends in it, and the angles of that name turn this bone about the joint where it
starts. The five end bones cannot turn. SAPSO section 2.
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

# The chains of bones from the joints where several chains begin. l is left, r is right.
LIMBS: Mapping[str, Sequence[str]] = {
    "left leg": ("lhipjoint", "lfemur", "ltibia", "lfoot", "ltoes"),
    "right leg": ("rhipjoint", "rfemur", "rtibia", "rfoot", "rtoes"),
    "left arm": ("lclavicle", "lhumerus", "lradius", "lwrist", "lhand"),
    "right arm": ("rclavicle", "rhumerus", "rradius", "rwrist", "rhand"),
    "head": ("lowerneck", "upperneck", "head"),
}
# the joint where each chain begins, and its bones, in the order of `JOINTS`
_CHAINS = (
    ("root", LIMBS["left leg"]),
    ("root", LIMBS["right leg"]),
    ("root", ("lowerback", "upperback", "thorax", *LIMBS["head"])),
    ("thorax", LIMBS["left arm"]),
    ("thorax", LIMBS["right arm"]),
)
_PARENT = {"root": "root"}  # the parent of each joint, parents before children
for _start, _chain in _CHAINS:
    # a bone's parent is the bone before it in its chain
    _PARENT.update(zip(_chain, (_start, *_chain), strict=False))

JOINTS = tuple(_PARENT)  # 27 names, parents before children
PARENTS = (-1, *map(JOINTS.index, [*_PARENT.values()][1:]))  # PARENTS[0] is -1
BONES = JOINTS[1:]  # bone b runs from joint PARENTS[b + 1] to joint b + 1
ENDS = tuple(j for j in range(len(JOINTS)) if j not in PARENTS)
INNER = tuple(j for j in range(1, len(JOINTS)) if j in PARENTS)
ANGLES = 3 + 3 * len(INNER)  # M = 66

Channels = tuple[tuple[str, tuple[str, ...]], ...]
Side = Literal["left", "right", "middle"]
# the first letters of names that come in pairs, such as lfemur and rfemur
_OTHER = {"l": "r", "r": "l"}


def mirrored(bone: str) -> str:
    """Return the name on the other side of the body; in the middle, the same name."""
    other = _OTHER.get(bone[0], "") + bone[1:]
    return other if other in JOINTS else bone


def side(bone: str) -> Side:
    """Return the side of the body where a bone or joint is."""
    if mirrored(bone) == bone:
        return "middle"
    return "left" if bone[0] == "l" else "right"


def kind(bone: str) -> str:
    """Return a bone's name without its side: `femur` for `lfemur` and `rfemur`."""
    if side(bone) == "middle":
        return bone
    return bone[1:]


def both(kind: str) -> tuple[str, str]:
    """Return the names of the left and the right bone of a kind such as `femur`."""
    return f"l{kind}", f"r{kind}"


# (27,) the joint on the other side of the body
MIRROR = tuple(JOINTS.index(mirrored(name)) for name in JOINTS)
# (27,) left, right or middle
SIDES: tuple[Side, ...] = tuple(map(side, JOINTS))


def angle_index(joint: int) -> int:
    """Return the index in a pose of a joint's first angle, or -1 for an end joint."""
    if joint in INNER:
        return 3 + 3 * INNER.index(joint)
    return -1


def channel_angles(bone: str, channels: Sequence[str]) -> list[int]:
    """Return the indices in a pose (66,) of some angles of a bone, such as `rx`, `rz`.

    An end bone or an unknown bone has none.
    """
    if bone in JOINTS:
        start = angle_index(JOINTS.index(bone))
    else:
        start = -1
    if start <= 0:
        return []
    return [start + "xyz".index(channel[1]) for channel in channels]


def angles_of(bones: Sequence[str]) -> NDArray[np.intp]:
    """Return the indices in a pose (66,) of all angles that turn some bones."""
    indices: list[int] = []
    for bone in bones:
        indices += channel_angles(bone, ("rx", "ry", "rz"))
    return np.array(indices, dtype=np.intp)


# (26,) the joint where each bone starts, and the index of its first angle in a pose, -1
# for an end bone
_STARTS = np.array(PARENTS[1:])
_FIRST_ANGLES = np.array([angle_index(j) for j in range(1, len(JOINTS))])


def root_centred(joints: Array) -> Array:
    """Return joints (..., 27, 3) with their root at the origin."""
    return np.asarray(joints - joints[..., :1, :])


def joint_distances(first: Array, second: Array) -> Array:
    """Return distances (..., 27) between joints (..., 27, 3) with the same root."""
    difference = root_centred(first) - root_centred(second)
    return np.asarray(np.linalg.norm(difference, axis=-1))


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The bones at rest, and the frames of their angles.

    Attributes:
        name: The skeleton's name.
        offsets: The vectors (26, 3) in metres from each bone's start to its end, at
            rest, in the world.
        axes: The rotations (26, 3, 3) from the frame of each bone's angles to the
            world, at rest.
        channels: The layout of .amc files after the root: each bone and its free
            angles, in the order of the file.
        limits: The lowest and the highest value (63, 2) in radians of each joint angle,
            0 for padding, or None if unknown.

    Raises:
        InputError: An array has another shape or is not finite, or a lowest angle is
            above the highest.

    Example:
        >>> from posefit import load_motion
        >>> motion = load_motion("walk")
        >>> joints = motion.skeleton.joints(motion.poses, motion.translations)
        >>> joints.shape[1:]
        (27, 3)
    """

    name: str
    offsets: Array = field(repr=False)  # (26, 3)
    axes: Array = field(repr=False)  # (26, 3, 3)
    channels: Channels = field(repr=False)
    limits: Array | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        shapes: dict[str, tuple[int, ...]] = {"offsets": (26, 3), "axes": (26, 3, 3)}
        if self.limits is not None:
            shapes["limits"] = (63, 2)
        for name, shape in shapes.items():
            object.__setattr__(self, name, frozen(name, getattr(self, name), shape))
        if self.limits is not None and (self.limits[:, 0] > self.limits[:, 1]).any():
            raise InputError(
                "limits must not be reversed, got a lowest angle above the highest"
            )

    @cached_property
    def lengths(self) -> Array:
        """The lengths (26,) of the bones in metres."""
        return np.asarray(np.linalg.norm(self.offsets, axis=1))

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """Which angles (66,) the subject has; the others are padding and stay 0."""
        free = np.zeros(ANGLES, dtype=bool)
        free[:3] = True
        for bone, angles in self.channels:
            free[channel_angles(bone, angles)] = True
        return free

    @cached_property
    def chain(self) -> kernels.Chain:
        """The skeleton in the form that the kernels need."""
        before = np.concatenate([np.eye(3)[None], self.axes])[_STARTS]
        turns = np.swapaxes(before, 1, 2) @ self.axes
        # rounding errors are removed: equal frames give the identity exactly
        turns[np.abs(turns - np.eye(3)).max(axis=(1, 2)) <= 1e-12] = np.eye(3)
        offsets = np.einsum(
            "bji,bj->bi", self.axes, self.offsets
        )  # in their own frames
        return kernels.Chain(_STARTS, _FIRST_ANGLES, turns, offsets)

    def turns(self, poses: Array) -> Array:
        """Return the rotations (27, T, 3, 3) of the bones from rest in poses (T, 66).

        A bone has the index of the joint where it ends. Its rotation is in the frame of
        the bone before it, and the root's in the world. End bones have the identity.
        """
        turns = np.tile(np.eye(3), (len(JOINTS), len(poses), 1, 1))
        turns[0] = rotation_from_root_angles(poses[:, :3])
        for joint in INNER:
            first = angle_index(joint)
            axes = self.axes[joint - 1]
            rotations = rotation_from_joint_angles(poses[:, first : first + 3])
            turns[joint] = axes @ rotations @ axes.T
        return turns

    def frames(self, poses: Array, translations: Array) -> tuple[Array, Array, Array]:
        """Return the frames of the joints of poses.

        Args:
            poses: The poses (n, 66).
            translations: The positions (n, 3) of their roots.

        Returns:
            The frames (n, 27, 4, 3), each three axes and an origin, and the sines and
            the cosines (n, 66) of the angles.
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
        """Return the joints of poses.

        Args:
            poses: The poses (..., 66).
            translations: The positions (..., 3) of their roots in metres; by default
                the origin.

        Returns:
            The joints (..., 27, 3) in metres in the world.

        Raises:
            InputError: A shape does not fit.
        """
        poses = np.asarray(poses, dtype=np.float64)
        if poses.ndim < 1 or poses.shape[-1] != ANGLES:
            raise InputError(
                f"poses must have shape (..., {ANGLES}), got {poses.shape}"
            )
        lead = poses.shape[:-1]
        if translations is None:
            translations = np.zeros((*lead, 3))
        roots = np.asarray(translations, dtype=np.float64)
        if roots.shape != (*lead, 3):
            raise InputError(
                f"translations must have shape {(*lead, 3)}, got {roots.shape}"
            )
        flat = writeable(poses.reshape(-1, ANGLES))
        flat_roots = writeable(roots.reshape(-1, 3))
        positions = kernels.joint_positions(self.chain, flat, flat_roots)
        return np.asarray(positions).reshape(*lead, len(JOINTS), 3)
