"""Poses with nearly the same silhouette as a given one: left and right exchanged, turned, reflected.

A silhouette shows neither which leg is in front nor how deep anything is. A search that has chosen the wrong one of two
such poses stays there, as each frame continues the last, unless a tracker tries the other one. These are plain
functions of poses (n, 66), whose roots stay where they are; each undoes itself. Bones of the two sides are seldom
equally long; the silhouettes differ as much as the sides do.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    rotation_from_joint_angles,
    wrapped,
)
from posefit.geometry.skeleton import (
    INNER,
    JOINTS,
    LIMBS,
    MIRROR,
    Skeleton,
    angle_index,
)
from posefit.reading import quoted

Limbs = Literal["legs", "arms"]

_LEFT_RIGHT = np.diag([-1.0, 1.0, 1.0])  # of a body at rest, whose left is at +x
_BONES: dict[Limbs, tuple[str, ...]] = {
    "legs": (*LIMBS["left leg"], *LIMBS["right leg"]),
    "arms": (*LIMBS["left arm"], *LIMBS["right arm"]),
}


def mirrored_poses(skeleton: Skeleton, poses: Array) -> Array:
    """Return poses (n, 66) whose left and right are exchanged: a stride becomes the one half a cycle later.

    The body is reflected in the upright plane that it faces along, and each side takes the name of the other. Viewed
    exactly from its side that leaves the silhouette as it is, as the camera looks across that plane and depth does not
    show; the farther the camera stands from the side, the more it shows.
    """
    exchanged = _exchanged(skeleton, poses, JOINTS)
    exchanged[:, 2] *= -1.0  # a lean to the left is one to the right
    return exchanged


def turned_poses(poses: Array) -> Array:
    """Return poses (n, 66) that face the other way, their joints as they are.

    From in front, and from behind, an upright body that stands still shows the same outline; one that walks, only
    about the same, with left and right on the other side. From its side knees and feet point the wrong way.
    """
    poses = np.array(poses, dtype=np.float64)
    poses[:, 0] = wrapped(poses[:, 0] + np.pi)
    return poses


def reflected_poses(skeleton: Skeleton, poses: Array, camera_yaw: float) -> Array:
    """Return poses (n, 66) reflected along the line of sight: towards the camera becomes away from it.

    `camera_yaw` is the yaw in radians of a person who faces the camera, see `facing`. Near and far trade places, and
    so do left and right: a turn of 30 degrees out of the picture becomes one into it. Whatever the pose,
    and from whatever side, a level camera far away sees the same silhouette. From the side it is `mirrored_poses`, and
    from in front it is `turned_poses` with left and right exchanged.
    """
    reflected = mirrored_poses(skeleton, poses)
    reflected[:, 0] = wrapped(2.0 * camera_yaw + np.pi - reflected[:, 0])
    return reflected


def exchanged_limbs(skeleton: Skeleton, poses: Array, limbs: Limbs) -> Array:
    """Return poses (n, 66) whose two `legs`, or two `arms`, have each the other's angles, mirrored.

    The trunk and the other limbs stay. Viewed from the side, the near and the far limb of a pair lie on each other or
    cross, and the silhouette is nearly the same whichever of them is in front.
    """
    if limbs not in _BONES:
        raise InputError(
            f"limbs must be one of {', '.join(_BONES)}, got {quoted(limbs)}"
        )
    return _exchanged(skeleton, poses, _BONES[limbs])


def facing(camera: Camera, place: Array) -> float:
    """Return the yaw in radians of a person at a place (3,) who faces a camera."""
    x, _, z = camera.position - np.asarray(place)
    return float(np.arctan2(x, z))


def _exchanged(skeleton: Skeleton, poses: Array, names: Sequence[str]) -> Array:
    """Return poses (n, 66) in which the joints of some names have the angles of their counterparts, mirrored."""
    poses = np.asarray(poses, dtype=np.float64)
    result = poses.copy()
    for j, frame in _frames(skeleton):
        if JOINTS[j] not in names:
            continue
        angles = poses[:, angle_index(MIRROR[j]) :][:, :3]
        first = angle_index(j)
        if frame is None:
            result[:, first : first + 3] = angles * [1.0, -1.0, -1.0]
        else:
            rotations = frame @ rotation_from_joint_angles(angles) @ frame.T
            result[:, first : first + 3] = joint_angles_from_rotation(rotations)
    return result


@lru_cache(maxsize=16)
def _frames(skeleton: Skeleton) -> list[tuple[int, Array | None]]:
    """Return each joint with its bone's rest frame, from the reflected one of its counterpart.

    None stands for a mere reflection, which keeps angles of more than half a turn as they are.
    """
    frames = [
        (j, skeleton.axes[j - 1].T @ _LEFT_RIGHT @ skeleton.axes[MIRROR[j] - 1])
        for j in INNER
    ]
    return [
        (j, None if np.allclose(frame, _LEFT_RIGHT) else frame) for j, frame in frames
    ]
