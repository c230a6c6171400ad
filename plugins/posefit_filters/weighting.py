"""From costs to weights, how sharply costs are weighed, and resampling by weights."""

import math

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, jit


def weigh(costs: Array, beta: float) -> Array:
    """Return the weights (n,), exp(-beta cost), which sum to 1. A cost that is nan or infinite weighs nothing."""
    known = np.isfinite(costs)
    if not known.any():  # no cost is known: equal weights
        return np.full(costs.size, 1.0 / costs.size)
    rises = np.where(known, costs, np.inf) - costs[known].min()
    weights: Array = np.exp(-beta * rises) if beta else known.astype(np.float64)  # GORDON1993 (likelihood)
    return np.asarray(weights / weights.sum())


def systematic_rows(weights: Array, u: float, count: int) -> NDArray[np.int64]:
    """Return `count` rows, each as often as its weight times `count`, rounded up or down: systematic resampling.

    `u` in [0, 1) is the offset of the evenly spaced points.
    """
    rows = weights.cumsum().searchsorted((np.arange(count) + u) / count, side="right")
    return np.asarray(np.minimum(rows, np.flatnonzero(weights)[-1]))


HALVINGS = 60  # ours: bisection steps; a double has 53 bits


@jit
def survival(costs, beta):
    """Return the share of particles (0 to 1) that survives resampling by weights exp(-beta cost): D / n.

    D = 1 / sum of the squared weights, which sum to 1, is the effective sample size (ESS) of Kish; the share is the
    survival diagnostic of MacCormick. A cost that is nan or infinite has no weight; where all are, all have the same.
    """
    lowest = math.inf
    for i in range(costs.size):
        if math.isfinite(costs[i]) and costs[i] < lowest:
            lowest = costs[i]
    total, squares = 0.0, 0.0
    for i in range(costs.size):
        if math.isfinite(costs[i]):
            weight = math.exp(-beta * (costs[i] - lowest))
            total += weight
            squares += weight * weight
    return total * total / squares / costs.size if squares > 0.0 else 1.0  # DEUTSCHER2005 (survival)


@jit
def sharpness(costs, wanted):
    """Return the beta at which `wanted`, a share, of the particles survive; 0 where fewer do at any beta.

    The survival rate falls as beta rises, so bisection finds it.
    """
    low, high = 0.0, 1.0
    if survival(costs, low) <= wanted:
        return 0.0
    while survival(costs, high) > wanted:
        low, high = high, 2.0 * high
        if high > 1e12:  # as many particles as that share the lowest cost
            return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if survival(costs, middle) > wanted:  # DEUTSCHER2005 (beta)
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
