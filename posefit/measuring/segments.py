"""Orientation of the body's segments, by the International Society of Biomechanics.

X points forwards, Y up along the segment and Z to the person's right. So all segments
of a person in the anatomical position (upright, knees and elbows straight, arms
hanging, palms forwards) have the same orientation. Wu et al. 2002, 2005.

A bone's axes are defined in the CMU database's rest pose: upright, feet and face
forwards, arms out with the palms down, legs apart, and the soles at right angles to the
shanks.
"""

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import BONES, PARENTS, Skeleton, both

SIDES = ("left", "right")
# in the rest pose the body faces along z, and its right is at -x
TRUNK = np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
FORWARDS = np.array([0.0, 0.0, 1.0])
PALM = np.array([0.0, -1.0, 0.0])
# an elbow bends forwards and 30 degrees up, about the hinge of CMU's skeletons
BENDING = np.array([0.0, 0.5, 0.75**0.5])


def bone_rotations(skeleton: Skeleton, poses: Array) -> Array:
    """Return the turns (T, 27, 3, 3) from rest in the world, of poses (T, 66).

    Entry 0 is the root's, and entry j that of the bone that ends in joint j.
    """
    turned = skeleton.turns(poses)
    for joint in range(1, len(turned)):
        turned[joint] = turned[PARENTS[joint]] @ turned[joint]
    return np.swapaxes(turned, 0, 1)


def segment_rotations(skeleton: Skeleton, poses: Array) -> dict[str, Array]:
    """Return the axes of each segment in the world, by the segment's name.

    Segments are `pelvis`, `thorax`, and for each side `thigh`, `shank`, `foot`,
    `upper_arm` and `forearm`. X, Y and Z are the columns of (T, 3, 3).

    Args:
        skeleton: The skeleton.
        poses: Poses (T, 66).
    """
    turned = bone_rotations(skeleton, poses)

    def of(bone: str) -> Array:
        return np.asarray(turned[:, 1 + BONES.index(bone)])

    def up(bone: str) -> Array:
        return np.asarray(-skeleton.offsets[BONES.index(bone)])

    segments = {"pelvis": turned[:, 0] @ TRUNK, "thorax": of("thorax") @ TRUNK}
    kinds = ("femur", "tibia", "foot", "humerus", "radius", "wrist")
    bones = zip(SIDES, *map(both, kinds), strict=True)
    for side, femur, tibia, foot, humerus, radius, wrist in bones:
        shank = _axes(FORWARDS, up(tibia))
        segments[f"{side}_thigh"] = of(femur) @ _axes(FORWARDS, up(femur))
        segments[f"{side}_shank"] = of(tibia) @ shank
        segments[f"{side}_foot"] = of(foot) @ shank
        segments[f"{side}_upper_arm"] = of(humerus) @ _axes(BENDING, up(humerus))
        # the skeleton turns the hand where a person turns the forearm, so that the
        # forearm's axes follow the palm
        segments[f"{side}_forearm"] = _axes(of(wrist) @ PALM, of(radius) @ up(radius))
    return segments


def _axes(forwards: Array, up: Array) -> Array:
    """Return axes (..., 3, 3): Y along `up`, X as near to `forwards` as possible."""
    y = up / np.linalg.norm(up, axis=-1, keepdims=True)
    x = forwards - (forwards * y).sum(axis=-1, keepdims=True) * y
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=-1)
