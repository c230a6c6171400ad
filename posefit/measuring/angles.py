"""Clinical joint angles, in degrees: of hip, knee and ankle, of shoulder and elbow.

Each is counted from the anatomical position, where it is zero, and has one sign for both sides of the body. The axes
are those of `posefit.measuring.segments`. The shoulder's plane and rotation mean nothing where the arm hangs straight
down, as longitudes do at a pole; near it they are left out.
"""

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import angles_about, unwrapped
from posefit.geometry.skeleton import Skeleton
from posefit.measuring.segments import SIDES, segment_rotations

# Each joint's angles, with what a positive one is.
MEANINGS = {
    "hip": {
        "flexion": "thigh forwards",
        "adduction": "thigh inwards",
        "internal_rotation": "knee inwards",
    },
    "knee": {
        "flexion": "heel to the seat",
        "adduction": "shank inwards (varus)",
        "internal_rotation": "toes inwards",
    },
    "ankle": {
        "dorsiflexion": "toes up",
        "inversion": "sole inwards",
        "internal_rotation": "toes inwards",
    },
    "shoulder": {
        "plane": "of elevation: 0 sideways (abduction), 90 forwards (flexion)",
        "elevation": "arm away from hanging, 0 to 180",
        "internal_rotation": "of the arm about itself",
    },
    "elbow": {
        "flexion": "hand to the shoulder",
        "adduction": "forearm inwards",
        "pronation": "palm backwards",
    },
}
BETWEEN = {  # the segments of each, the proximal first
    "hip": ("pelvis", "thigh"),  # WU2002 (hip)
    "knee": ("thigh", "shank"),  # GROOD1983 (knee)
    "ankle": ("shank", "foot"),  # WU2002 (ankle)
    "shoulder": ("thorax", "upper_arm"),
    "elbow": ("upper_arm", "forearm"),  # WU2005 (elbow)
}
COLUMNS = tuple(
    f"{side}_{joint}_{angle}"
    for joint, angles in MEANINGS.items()
    for side in SIDES
    for angle in angles
)  # of angles.csv, in its order
# the mirror between left and right, in segments' axes
_ACROSS = np.diag([1.0, 1.0, -1.0])
# degrees from hanging or pointing straight up: 2 degrees of error turn the plane by
# more than ten
NEAR_POLE = 10.0
_LEVEL = 1e-9  # the sine of an elevation, below which its plane is not determined


def joint_coordinates(proximal: Array, distal: Array) -> Array:
    """Return rotations (..., 3) in radians of a distal about a proximal segment of the right side, both (..., 3, 3).

    They are about the proximal segment's Z, about the floating axis at right angles to both others, and about the
    distal segment's Y: forwards, inwards, and turned inwards.
    """
    relative = np.swapaxes(proximal, -1, -2) @ distal
    return angles_about((2, 0, 1), relative)  # GROOD1983 (joint coordinate system)


def joint_angles(joint: str, proximal: Array, distal: Array) -> Array:
    """Return the angles (..., 3) of a joint of the right side, in the order of `MEANINGS`, in radians."""
    if joint == "shoulder":
        return shoulder_angles(proximal, distal)
    return joint_coordinates(proximal, distal) * (
        [-1.0, 1.0, 1.0] if joint == "knee" else 1.0
    )


def shoulder_angles(thorax: Array, upper_arm: Array) -> Array:
    """Return plane of elevation, elevation and internal rotation (..., 3) of the right shoulder, in radians.

    The source counts elevation downwards from 0 to -180 degrees; here it is positive. Where the arm hangs straight
    down or points straight up, all of the turn is reported as rotation.
    """
    relative = np.swapaxes(thorax, -1, -2) @ upper_arm
    level = np.hypot(relative[..., 1, 0], relative[..., 1, 2])
    pole = level < _LEVEL
    elevation = np.arctan2(level, relative[..., 1, 1])  # WU2005 (shoulder)
    plane = np.where(pole, 0.0, np.arctan2(-relative[..., 0, 1], -relative[..., 2, 1]))
    alone = np.arctan2(relative[..., 0, 2], relative[..., 0, 0])
    rotation = np.where(
        pole, alone, np.arctan2(-relative[..., 1, 0], relative[..., 1, 2])
    )
    return np.stack([plane, elevation, rotation], axis=-1)


def clinical_angles(skeleton: Skeleton, poses: Array) -> dict[str, Array]:
    """Return the angles (T,) in degrees of poses (T, 66), by the names of `COLUMNS`.

    Poses are successive, and angles have no jumps of whole turns from one to the next; most lie in -180 to 180. A
    joint's first and last angles are NaN within `NEAR_POLE` degrees of where they are about one axis, such as the plane
    and the rotation of a shoulder that hangs or points straight up.
    """
    segments = segment_rotations(skeleton, poses)
    columns: dict[str, Array] = {}
    for side in SIDES:
        # a left side is measured as the right one that it is in the mirror
        axes = {
            name.removeprefix(f"{side}_"): _ACROSS @ rotation @ _ACROSS
            if side == "left"
            else rotation
            for name, rotation in segments.items()
        }
        by_joint = {
            joint: joint_angles(joint, *(axes[segment] for segment in pair))
            for joint, pair in BETWEEN.items()
        }
        for joint, values in by_joint.items():
            level = (
                np.sin(values[:, 1]) if joint == "shoulder" else np.cos(values[:, 1])
            )
            values[level < np.sin(np.radians(NEAR_POLE))] *= [np.nan, 1.0, np.nan]
            for k, angle in enumerate(MEANINGS[joint]):
                columns[f"{side}_{joint}_{angle}"] = np.degrees(
                    _continuous(values[:, k])
                )
    return {name: columns[name] for name in COLUMNS}


def _continuous(angles: Array) -> Array:
    """Return angles (T,) without jumps, shifted by whole turns so that their median lies in -pi to pi."""
    series = unwrapped(angles)
    if np.isnan(series).all():
        return series
    return np.asarray(
        series - 2.0 * np.pi * np.floor(np.nanmedian(series) / (2.0 * np.pi) + 0.5)
    )
