"""A walker made by hand, whose steps are known: legs are stiff pendulums that swing forwards faster than back."""

from collections.abc import Mapping

import numpy as np

from posefit.geometry.skeleton import ANGLES, JOINTS, angle_index
from posefit.motion import built_in
from posefit.motion.motion import Motion

# seconds, share, m/s, radians
STRIDE = 1.2
STANCE = 0.62
SPEED = 1.0
SWING = np.radians(25.0)
FIRST = {"l": 0.3, "r": 0.9}  # seconds at which a foot strikes first
SWINGS = {"l": SWING, "r": SWING}


def angle(name: str, axis: str) -> int:
    return angle_index(JOINTS.index(name)) + "xyz".index(axis)


def ahead(seconds: np.ndarray) -> np.ndarray:
    """Return 1 where a foot strikes and -1 where it lifts off, of times since a strike."""
    share = (seconds / STRIDE) % 1.0
    back = share < STANCE
    return np.where(
        back,
        np.cos(np.pi * share / STANCE),
        -np.cos(np.pi * (share - STANCE) / (1.0 - STANCE)),
    )


def walker(
    seconds: float = 4.2,
    fps: float = 100.0,
    speed: float = SPEED,
    yaw: float = 0.0,
    first: Mapping[str, float] = FIRST,
    swing: Mapping[str, float] = SWINGS,
) -> Motion:
    times = np.arange(round(seconds * fps)) / fps
    poses = np.zeros((len(times), ANGLES))
    poses[:, 0] = yaw
    for side in "lr":
        # apart in the pose of rest
        poses[:, angle(f"{side}femur", "z")] = np.radians(
            -20.0 if side == "l" else 20.0
        )
        poses[:, angle(f"{side}femur", "x")] = -swing[side] * ahead(times - first[side])
    way = speed * times[:, None] * [np.sin(yaw), 0.0, np.cos(yaw)]
    return Motion("walker", built_in.motion("walk", frames=1).skeleton, poses, way, fps)
