"""Errors of joints that all frames of footage share.

They come from the build, the joint centres, the calibration, and depth. The samples of
a posterior and the reported pose share them as well, so the samples do not show them.
`docs/studies/bodies.py` learned them from 160 tracks.
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
# Standard deviations along each axis in millimetres, about the root and in the world.
# The three numbers are for one camera, for two, and for more.
SHARED_MM: Mapping[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "pelvis": ((0, 0, 0), (0, 35, 25)),
    "hips": ((0, 15, 15), (0, 35, 25)),
    "knees": ((0, 20, 20), (0, 50, 35)),
    "feet": ((0, 30, 25), (0, 60, 35)),
    "shoulders": ((15, 20, 20), (0, 40, 25)),
    "head": ((15, 20, 15), (0, 35, 20)),
    "arms": ((0, 25, 30), (0, 50, 40)),
}
# Standard deviation of the distance from a single camera, as a share, if the person's
# height is given.
DEPTH = 0.015
# Standard deviation of adults' height, as a share. A person who is a tenth taller than
# assumed is a tenth farther away.
STATURE = 0.054


def in_footage(model: Recalibration, cameras: int, height_known: bool) -> Recalibration:
    """Return corrections that include the errors shared by all frames of footage.

    Args:
        model: Corrections of the errors of single frames.
        cameras: The number of cameras.
        height_known: Whether the person's height is given.

    Returns:
        The corrections.
    """
    depth = 0.0
    if cameras < 2:
        depth = math.hypot(DEPTH, 0.0 if height_known else STATURE)
    about_root = np.hypot(model.joint_spreads, shared_spreads(cameras))
    in_world = np.hypot(model.joint_spreads, shared_spreads(cameras, world=True))
    return replace(model, joint_spreads=about_root, place_spreads=in_world, depth=depth)


_PART_OF = dict[str, str]()
for _part, _kinds in PARTS.items():
    _PART_OF.update(dict.fromkeys(_kinds, _part))
_PARTS_OF_JOINTS = [_PART_OF[kind(joint)] for joint in JOINTS]


def shared_spreads(cameras: int, world: bool = False) -> Array:
    """Return the standard deviations (27,) of joints' shared errors, in metres.

    They are along each axis about the root, or in the world without the error of depth.
    """
    column = min(cameras, 3) - 1
    return np.array(
        [1e-3 * SHARED_MM[part][world][column] for part in _PARTS_OF_JOINTS]
    )


def depth_halves(model: Recalibration, camera: Camera, place: Array) -> Array:
    """Return how much nearer or farther a root may be than a single camera shows.

    Args:
        model: The corrections.
        camera: The camera.
        place: The estimated place of the root (3,) in metres.

    Returns:
        The distances (levels, 1) in metres, for each of the `LEVELS`.
    """
    from scipy.special import ndtri

    deviation = model.depth * float(camera.project(place)[1])
    return np.asarray(deviation * ndtri(0.5 + 0.5 * np.array(LEVELS))[:, None])
