"""Clinical joint angles, in degrees: of hip, knee and ankle, of shoulder and elbow.

All angles are zero in the anatomical position, and have the same sign on both sides of
the body. `posefit.measuring.segments` defines the axes. The shoulder's plane and
rotation are undefined if the arm hangs straight down, like the longitude at a pole;
near that pose they are left out.
"""

from collections.abc import Iterator

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import angles_about, unwrapped
from posefit.geometry.skeleton import Skeleton
from posefit.measuring.segments import SIDES, segment_rotations

# each joint's angles, and the direction of positive values
MEANINGS = {
    "hip": {
        "flexion": "thigh forwards",
        "adduction": "thigh inwards",
        "internal_rotation": "knee inwards",
    },
    "knee": {
        "flexion": "heel towards the buttocks",
        "adduction": "shank inwards (varus)",
        "internal_rotation": "toes inwards",
    },
    "ankle": {
        "dorsiflexion": "toes up",
        "inversion": "sole inwards",
        "internal_rotation": "toes inwards",
    },
    "shoulder": {
        "plane": "plane of elevation: 0 sideways (abduction), 90 forwards (flexion)",
        "elevation": "arm raised, 0 hanging to 180",
        "internal_rotation": "arm turned inwards about its long axis",
    },
    "elbow": {
        "flexion": "hand towards the shoulder",
        "adduction": "forearm inwards",
        "pronation": "palm backwards",
    },
}
# each joint's segments, the proximal one first
BETWEEN = {
    "hip": ("pelvis", "thigh"),  # WU2002 (hip)
    "knee": ("thigh", "shank"),  # GROOD1983 (knee)
    "ankle": ("shank", "foot"),  # WU2002 (ankle)
    "shoulder": ("thorax", "upper_arm"),
    "elbow": ("upper_arm", "forearm"),  # WU2005 (elbow)
}


def _columns() -> Iterator[str]:
    for joint, angles in MEANINGS.items():
        for side in SIDES:
            for angle in angles:
                yield f"{side}_{joint}_{angle}"


# columns of angles.csv, in order
COLUMNS = tuple(_columns())
# mirrors left and right, in segments' axes
_ACROSS = np.diag([1.0, 1.0, -1.0])
# degrees between an arm and its straight-down or straight-up pose: nearer than this, an
# error of 2 degrees turns the plane by more than ten
NEAR_POLE = 10.0
_LEVEL = 1e-9  # sine of an elevation below which its plane is not determined


def joint_coordinates(proximal: Array, distal: Array) -> Array:
    """Return rotations (..., 3) in radians of a distal about a proximal segment.

    They are about the proximal segment's Z, about the floating axis at right angles to
    both others, and about the distal segment's Y: forwards, inwards, turned inwards.

    Args:
        proximal: Axes (..., 3, 3) of a segment of the right side.
        distal: Axes (..., 3, 3) of the next segment.
    """
    relative = np.swapaxes(proximal, -1, -2) @ distal
    return angles_about((2, 0, 1), relative)  # GROOD1983 (joint coordinate system)


def joint_angles(joint: str, proximal: Array, distal: Array) -> Array:
    """Return the angles (..., 3) of a joint of the right side, in radians.

    Args:
        joint: A key of `MEANINGS`, which also has the order of the angles.
        proximal: Axes (..., 3, 3) of the segment above the joint.
        distal: Axes (..., 3, 3) of the segment below it.
    """
    if joint == "shoulder":
        return shoulder_angles(proximal, distal)
    coordinates = joint_coordinates(proximal, distal)
    if joint == "knee":
        return coordinates * [-1.0, 1.0, 1.0]
    return coordinates


def shoulder_angles(thorax: Array, upper_arm: Array) -> Array:
    """Return the right shoulder's angles (..., 3) in radians.

    They are plane of elevation, elevation and internal rotation. The source counts
    elevation downwards from 0 to -180 degrees; here it is positive. If the arm hangs
    straight down or points straight up, the whole turn is reported as rotation.

    Args:
        thorax: Axes (..., 3, 3).
        upper_arm: Axes (..., 3, 3).
    """
    relative = np.swapaxes(thorax, -1, -2) @ upper_arm
    level = np.hypot(relative[..., 1, 0], relative[..., 1, 2])
    pole = level < _LEVEL
    elevation = np.arctan2(level, relative[..., 1, 1])  # WU2005 (shoulder)
    plane = np.where(pole, 0.0, np.arctan2(-relative[..., 0, 1], -relative[..., 2, 1]))
    rotation_at_pole = np.arctan2(relative[..., 0, 2], relative[..., 0, 0])
    rotation = np.arctan2(-relative[..., 1, 0], relative[..., 1, 2])
    rotation = np.where(pole, rotation_at_pole, rotation)
    return np.stack([plane, elevation, rotation], axis=-1)


def clinical_angles(skeleton: Skeleton, poses: Array) -> dict[str, Array]:
    """Return the clinical angles (T,) of poses in degrees, by the names of `COLUMNS`.

    Angles do not jump by whole turns from one pose to the next; most lie in -180 to
    180. The first and the last angle of a joint are NaN within `NEAR_POLE` degrees of a
    pose in which both turn about the same axis. For the plane and the rotation of a
    shoulder, such poses are an arm that hangs straight down or points straight up.

    Args:
        skeleton: The skeleton.
        poses: Successive poses (T, 66).

    Returns:
        The angles (T,) in degrees by name.

    Example:
        >>> from posefit import clinical_angles, load_motion
        >>> walk = load_motion("16_15")
        >>> angles = clinical_angles(walk.skeleton, walk.poses)
        >>> round(float(angles["left_knee_flexion"].max()), -1)
        70.0
    """
    segments = segment_rotations(skeleton, poses)
    columns: dict[str, Array] = {}
    for side in SIDES:
        axes = {}
        for name, rotation in segments.items():
            # a mirrored left side is a right side
            if side == "left":
                rotation = _ACROSS @ rotation @ _ACROSS
            axes[name.removeprefix(f"{side}_")] = rotation
        for joint, (proximal, distal) in BETWEEN.items():
            values = joint_angles(joint, axes[proximal], axes[distal])  # (T, 3)
            # near 0, the first and the last angle are about the same axis
            apart = np.cos(values[:, 1])
            if joint == "shoulder":
                apart = np.sin(values[:, 1])
            values[apart < np.sin(np.radians(NEAR_POLE))] *= [np.nan, 1.0, np.nan]
            for k, angle in enumerate(MEANINGS[joint]):
                series = _continuous(values[:, k])
                columns[f"{side}_{joint}_{angle}"] = np.degrees(series)
    return {name: columns[name] for name in COLUMNS}


def _continuous(angles: Array) -> Array:
    """Return angles (T,) without jumps, with a median in -pi to pi."""
    series = unwrapped(angles)
    if np.isnan(series).all():
        return series
    turns = np.floor(np.nanmedian(series) / (2.0 * np.pi) + 0.5)
    return np.asarray(series - 2.0 * np.pi * turns)
