"""Scales: what the numbers of actions stand for, how a cost shows, and what it earns when it falls."""

from typing import TypeVar

import numpy as np

from posefit.arrays import Array

DEAREST = 100.0  # the cost that shows as 1

Number = TypeVar("Number", float, Array)


def scaled(bounds: tuple[float, float], number: Number) -> Number:
    """Return the value that a number from -1 to 1 stands for, where -1 stands for the first bound and 1 the second."""
    return bounds[0] + 0.5 * (number + 1.0) * (bounds[1] - bounds[0])


def unscaled(bounds: tuple[float, float], value: float) -> float:
    """Return the number from -1 to 1 that stands for a value between two bounds, but for rounding."""
    return float(2.0 * (value - bounds[0]) / (bounds[1] - bounds[0]) - 1.0)


def priced(cost: Number) -> Number:
    """Return how a cost shows, 0 to 1: ln(1 + cost) / ln 101."""
    shown: Number = np.log1p(cost) / np.log1p(DEAREST)
    return shown


def gained(before: float, after: float) -> float:
    """Return the reward of a best cost that falls: ln((1 + before) / (1 + after))."""
    return float(np.log1p(before) - np.log1p(after))
