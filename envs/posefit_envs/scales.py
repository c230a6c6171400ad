"""Scales: from actions to settings, from costs to observations and rewards."""

from typing import TypeVar

import numpy as np

from posefit.arrays import Array

LOG_HIGHEST_COST = np.log1p(100.0)

Number = TypeVar("Number", float, Array)


def scaled(bounds: tuple[float, float], number: Number) -> Number:
    """Return the value between two bounds at a number from -1, the first bound, to 1, the second."""
    return bounds[0] + 0.5 * (number + 1.0) * (bounds[1] - bounds[0])


def unscaled(bounds: tuple[float, float], value: float) -> float:
    """Return the number from -1 to 1 whose scaled value this is, but for rounding."""
    return float(2.0 * (value - bounds[0]) / (bounds[1] - bounds[0]) - 1.0)


def log_cost(cost: Number) -> Number:
    """Return a cost of 0 to 100 on a logarithmic scale of 0 to 1: ln(1 + cost) / ln 101."""
    shown: Number = np.log1p(cost) / LOG_HIGHEST_COST
    return shown


def log_improvement(before: Array, after: Array) -> Array:
    """Return the rewards of best costs that fall: ln((1 + before) / (1 + after))."""
    return np.log1p(before) - np.log1p(after)
