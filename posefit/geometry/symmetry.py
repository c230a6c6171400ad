"""Poses with nearly the same silhouette: left and right exchanged, turned, reflected.

A silhouette shows neither depth nor which leg is in front. A search that has chosen the
wrong one of two such poses keeps it, because each frame continues the last, unless a
tracker tries the other pose. These functions take poses (n, 66) and do not change the
roots; applied twice, they give the original poses. The bones of the two sides
are seldom equally long, so the silhouettes differ as much as the sides do.
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

_LEFT_RIGHT = np.diag(
    [-1.0, 1.0, 1.0]
)  # the reflection of a body at rest; its left is at +x
_BONES: dict[Limbs, tuple[str, ...]] = {
    "legs": (*LIMBS["left leg"], *LIMBS["right leg"]),
    "arms": (*LIMBS["left arm"], *LIMBS["right arm"]),
}


def mirrored_poses(skeleton: Skeleton, poses: Array) -> Array:
    """Return poses (n, 66) with left and right exchanged.

    A stride becomes the stride half a cycle later. The body is reflected in the upright
    plane along which it faces, and each side takes the name of the other. Seen exactly
    from the side, the silhouette does not change, because the camera looks across this
    plane and depth is invisible. The farther the camera is from there, the more the
    silhouette changes.

    Args:
        skeleton: The skeleton.
        poses: The poses (n, 66).

    Returns:
        The mirrored poses (n, 66).

    Example:
        >>> import numpy as np
        >>> from posefit import load_motion, mirrored_poses
        >>> walk = load_motion("walk")
        >>> once = mirrored_poses(walk.skeleton, walk.poses)
        >>> bool(np.allclose(mirrored_poses(walk.skeleton, once), walk.poses))
        True
    """
    exchanged = _exchanged(skeleton, poses, JOINTS)
    exchanged[:, 2] *= -1.0  # a lean to the left becomes a lean to the right
    return exchanged


def turned_poses(poses: Array) -> Array:
    """Return poses (n, 66) that face the opposite way, with the same joint angles.

    From the front or from behind, the outline of an upright body at rest is the same.
    That of a walking body is nearly the same, with left and right exchanged. From the
    side, knees and feet point the wrong way.

    Args:
        poses: The poses (n, 66).

    Returns:
        The turned poses (n, 66).

    Example:
        >>> import numpy as np
        >>> from posefit import load_motion, turned_poses
        >>> poses = load_motion("walk").poses
        >>> turn = np.cos(turned_poses(poses)[:, 0] - poses[:, 0])
        >>> bool(np.allclose(turn, -1.0))
        True
    """
    poses = np.array(poses, dtype=np.float64)
    poses[:, 0] = wrapped(poses[:, 0] + np.pi)
    return poses


def reflected_poses(skeleton: Skeleton, poses: Array, camera_yaw: float) -> Array:
    """Return poses (n, 66) reflected along the line of sight.

    Near and far are exchanged, and so are left and right: a turn of 30 degrees out of
    the picture becomes a turn into it. A level camera far away sees the same silhouette
    for every pose and from every side. From the side, the result is `mirrored_poses`;
    from the front, it is `turned_poses` with left and right exchanged.

    Args:
        skeleton: The skeleton.
        poses: The poses (n, 66).
        camera_yaw: The yaw in radians of a person who faces the camera; see `facing`.

    Returns:
        The reflected poses (n, 66).

    Example:
        >>> import numpy as np
        >>> from posefit import load_motion, reflected_poses
        >>> walk = load_motion("walk")
        >>> once = reflected_poses(walk.skeleton, walk.poses, camera_yaw=0.5)
        >>> twice = reflected_poses(walk.skeleton, once, camera_yaw=0.5)
        >>> bool(np.allclose(np.sin(twice), np.sin(walk.poses)))
        True
    """
    reflected = mirrored_poses(skeleton, poses)
    reflected[:, 0] = wrapped(2.0 * camera_yaw + np.pi - reflected[:, 0])
    return reflected


def exchanged_limbs(skeleton: Skeleton, poses: Array, limbs: Limbs) -> Array:
    """Return poses (n, 66) in which the two `legs`, or the two `arms`, are exchanged.

    Each limb gets the mirrored angles of the other; the rest is not changed. From
    the side, the near and the far limb overlap or cross, and the silhouette is nearly
    the same whichever is in front.

    Args:
        skeleton: The skeleton.
        poses: The poses (n, 66).
        limbs: The pair of limbs, "legs" or "arms".

    Returns:
        The poses (n, 66) with exchanged limbs.

    Raises:
        InputError: `limbs` is neither "legs" nor "arms".

    Example:
        >>> import numpy as np
        >>> from posefit import exchanged_limbs, load_motion
        >>> walk = load_motion("walk")
        >>> once = exchanged_limbs(walk.skeleton, walk.poses, "legs")
        >>> twice = exchanged_limbs(walk.skeleton, once, "legs")
        >>> bool(np.allclose(twice, walk.poses))
        True
    """
    if limbs not in _BONES:
        raise InputError(
            f"limbs must be one of {', '.join(_BONES)}, got {quoted(limbs)}"
        )
    return _exchanged(skeleton, poses, _BONES[limbs])


def facing(camera: Camera, place: Array) -> float:
    """Return the yaw in radians of a person at a place (3,) who faces the camera.

    Args:
        camera: The camera.
        place: The position (3,) of the person in metres.

    Returns:
        The yaw in radians.

    Example:
        >>> import numpy as np
        >>> from posefit import Camera, facing
        >>> place = np.array([0.0, 0.9, 0.0])
        >>> camera = Camera.around(place, azimuth=0.5, distance=3.0, size=(320, 240))
        >>> round(facing(camera, place), 6)
        0.5
    """
    x, _, z = camera.position - np.asarray(place)
    return float(np.arctan2(x, z))


def _exchanged(skeleton: Skeleton, poses: Array, names: Sequence[str]) -> Array:
    """Return poses (n, 66) in which some joints mirror the other side.

    They have the mirrored angles of the joints on the other side.
    """
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
    """Return each inner joint with the map from its counterpart's frame to its own.

    The map includes the reflection. None means the reflection alone, so that
    angles of more than half a turn can be kept.
    """
    frames: list[tuple[int, Array | None]] = []
    for j in INNER:
        frame = skeleton.axes[j - 1].T @ _LEFT_RIGHT @ skeleton.axes[MIRROR[j] - 1]
        frames.append((j, None if np.allclose(frame, _LEFT_RIGHT) else frame))
    return frames
