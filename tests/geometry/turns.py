"""Rotations about one axis, written out, and joints by forward kinematics."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import PARENTS


def about(axis: int, angle: float) -> Array:
    """Return the rotation about x, y or z by radians."""
    c = np.cos(angle)
    s = np.sin(angle)
    x = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]]
    y = [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]]
    z = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]
    return np.array((x, y, z)[axis])


Arrays = Sequence[Array]


def chained(
    root: Array, place: Array, turns: Arrays, axes: Arrays, offsets: Arrays
) -> Array:
    """Return joints (27, 3) straight from Acclaim's definition: a bone's local rotation is C M C^-1.

    C is its axis and M its motion; its end is its start plus its offset.
    """
    frames = [root]
    joints = [place]
    for parent, turn, axis, offset in zip(
        PARENTS[1:], turns, axes, offsets, strict=True
    ):
        frames.append(frames[parent] @ axis @ turn @ axis.T)
        joints.append(joints[parent] + frames[-1] @ offset)
    return np.array(joints)
