"""From costs to weights, and from weights to the particles that survive."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array


def weigh(costs: Array, beta: float) -> Array:
    """Return the weights (n,), exp(-beta cost), which sum to 1. A cost that is nan or infinite weighs nothing."""
    known = np.isfinite(costs)
    if not known.any():  # nothing is known: all weigh alike
        return np.full(costs.size, 1.0 / costs.size)
    rises = np.where(known, costs, np.inf) - costs[known].min()
    weights: Array = np.exp(-beta * rises) if beta else known.astype(np.float64)  # GORDON1993 (likelihood)
    return np.asarray(weights / weights.sum())


def systematic(weights: Array, u: float) -> NDArray[np.int64]:
    """Return which rows (n,) survive: as often as their weight asks, one of the two whole numbers next to n times it.

    This is systematic resampling. `u` in [0, 1) is where the comb of n evenly spaced teeth begins.
    """
    teeth = (np.arange(weights.size) + u) / weights.size
    rows = weights.cumsum().searchsorted(teeth, side="right")  # GORDON1993 (resampling)
    return np.minimum(rows, weights.size - 1)
