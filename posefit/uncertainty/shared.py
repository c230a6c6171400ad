"""What joints of footage are off in all frames alike: the build, joint centres, the calibration, and depth.

A posterior's samples share these errors with the reported pose. `docs/studies/bodies.py` learned them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, kind
from posefit.uncertainty.calibration import LEVELS, Recalibration

PARTS: Mapping[str, Sequence[str]] = {  # joints, named after the bones that end in them
    "pelvis": ("root",),
    "hips": ("hipjoint", "lowerback"),
    "knees": ("femur",),
    "feet": ("tibia", "foot", "toes"),
    "shoulders": ("upperback", "thorax", "lowerneck", "clavicle"),
    "head": ("upperneck", "head"),
    "arms": ("humerus", "radius", "wrist", "hand"),
}
# Standard deviations of each axis in millimetres by 1, 2, and 3 or more cameras: about the root, and in the world.
SHARED_MM: Mapping[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "pelvis": ((0, 0, 0), (30, 30, 30)),
    "hips": ((20, 20, 20), (30, 30, 30)),
    "knees": ((20, 20, 20), (30, 30, 30)),
    "feet": ((20, 20, 20), (30, 30, 30)),
    "shoulders": ((20, 20, 20), (30, 30, 30)),
    "head": ((20, 20, 20), (30, 30, 30)),
    "arms": ((20, 20, 20), (30, 30, 30)),
}
DEPTH = 0.05  # of the distance from a camera that is alone


def in_footage(model: Recalibration, cameras: int) -> Recalibration:
    """Return corrections of what so many cameras show, which are right about the errors of single frames."""
    shared, placed = (shared_spreads(cameras, world) for world in (False, True))
    spreads = np.hypot(model.joint_spreads, shared), np.hypot(model.joint_spreads, placed)
    return replace(model, joint_spreads=spreads[0], place_spreads=spreads[1])


def shared_spreads(cameras: int, world: bool = False) -> Array:
    """Return by how much joints (27,) are off, metres on each axis: about the root, or in the world but for depth."""
    part_of = {name: part for part, names in PARTS.items() for name in names}
    return np.array([1e-3 * SHARED_MM[part_of[kind(joint)]][world][min(cameras, 3) - 1] for joint in JOINTS])


def depth_halves(cameras: Sequence[Camera], place: Array) -> Array:
    """Return how far (levels, 1) a root at `place` (3,) may be off, metres, as one camera alone shows no depth."""
    from scipy.special import ndtri

    depth = float(cameras[0].project(place)[1]) if len(cameras) == 1 else 0.0
    return np.asarray(DEPTH * depth * ndtri(0.5 + 0.5 * np.array(LEVELS))[:, None])
