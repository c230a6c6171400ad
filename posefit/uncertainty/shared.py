"""What joints of footage are off in all frames alike: the build, joint centres, the calibration, and depth.

A posterior's samples share these errors with the reported pose. `docs/studies/bodies.py` learned them from 160
tracks.
"""

import math
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
# Standard deviations of each axis in millimetres, by one camera, by two and by more: about the root, and in the world.
SHARED_MM: Mapping[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "pelvis": ((0, 0, 0), (0, 35, 25)),
    "hips": ((0, 15, 15), (0, 35, 25)),
    "knees": ((0, 20, 20), (0, 50, 35)),
    "feet": ((0, 30, 25), (0, 60, 35)),
    "shoulders": ((15, 20, 20), (0, 40, 25)),
    "head": ((15, 20, 15), (0, 35, 20)),
    "arms": ((0, 25, 30), (0, 50, 40)),
}
# of the distance from a camera that is alone, where the person's height is given
DEPTH = 0.015
# of adults' height; a person who is a tenth taller than assumed is a tenth farther away
STATURE = 0.054


def in_footage(model: Recalibration, cameras: int, height_known: bool) -> Recalibration:
    """Return corrections of what so many cameras show, which are right about the errors of single frames."""
    depth = 0.0 if cameras > 1 else math.hypot(DEPTH, 0.0 if height_known else STATURE)
    shared, placed = (shared_spreads(cameras, world) for world in (False, True))
    spreads = (
        np.hypot(model.joint_spreads, shared),
        np.hypot(model.joint_spreads, placed),
    )
    return replace(
        model, joint_spreads=spreads[0], place_spreads=spreads[1], depth=depth
    )


_PART_OF = {name: part for part, names in PARTS.items() for name in names}
_PARTS_OF_JOINTS = [_PART_OF[kind(joint)] for joint in JOINTS]


def shared_spreads(cameras: int, world: bool = False) -> Array:
    """Return by how much joints (27,) are off, metres on each axis: about the root, or in the world but for depth."""
    column = min(cameras, 3) - 1
    return np.array(
        [1e-3 * SHARED_MM[part][world][column] for part in _PARTS_OF_JOINTS]
    )


def depth_halves(model: Recalibration, camera: Camera, place: Array) -> Array:
    """Return how far (levels, 1) a root at `place` (3,) may be nearer or farther than a camera alone shows, metres."""
    from scipy.special import ndtri

    deviation = model.depth * float(camera.project(place)[1])
    return np.asarray(deviation * ndtri(0.5 + 0.5 * np.array(LEVELS))[:, None])
