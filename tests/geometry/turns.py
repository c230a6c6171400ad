"""Rotations about one axis, written out."""

import numpy as np

from posefit.arrays import Array


def about(axis: int, angle: float) -> Array:
    """Return the rotation about x, y or z by radians."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(
        [
            [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
            [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
            [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
        ][axis]
    )
