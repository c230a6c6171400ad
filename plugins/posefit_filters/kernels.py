"""From costs to weights, and from weights to the particles that survive, in numba: plain functions over arrays."""

import numpy as np

from posefit.arrays import jit

HALVINGS = 60  # ours: bisection steps; a double has 53 bits


@jit
def weigh(costs, beta):
    """Return the weights (n,), exp(-beta cost), which sum to 1. A cost that is nan or infinite weighs nothing."""
    weights = np.zeros(costs.size)
    lowest = np.inf
    for cost in costs:
        if cost < lowest:
            lowest = cost
    if not np.isfinite(lowest):  # nothing is known: all weigh alike
        weights[:] = 1.0 / costs.size
        return weights
    for i in range(costs.size):
        if np.isfinite(costs[i]):
            weights[i] = np.exp(-beta * (costs[i] - lowest))  # GORDON1993 (likelihood)
    return weights / weights.sum()


@jit
def survival(weights):
    """Return the share of particles (0 to 1) that survive resampling: D / n, D = 1 / sum of squared weights.

    D is the effective sample size (ESS) of Kish, the survival diagnostic of MacCormick.
    """
    return 1.0 / (weights**2).sum() / weights.size  # DEUTSCHER2005 (survival)


@jit
def sharpness(costs, wanted):
    """Return the beta at which `wanted`, a share, of the particles survive; 0 where fewer do at any beta.

    The survival rate falls as beta rises, so bisection finds it.
    """
    low, high = 0.0, 1.0
    if survival(weigh(costs, low)) <= wanted:
        return 0.0
    while survival(weigh(costs, high)) > wanted:
        low, high = high, 2.0 * high
        if high > 1e12:  # as many particles as that share the lowest cost
            return high
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        if not low < middle < high:
            break
        if survival(weigh(costs, middle)) > wanted:  # DEUTSCHER2005 (beta)
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


@jit
def systematic(weights, u):
    """Return which rows (n,) survive: as often as their weight asks, one of the two whole numbers next to n times it.

    This is systematic resampling. `u` in [0, 1) is where the comb of n evenly spaced teeth begins.
    """
    rows = np.empty(weights.size, np.int64)
    i, total = 0, weights[0]
    for k in range(weights.size):
        tooth = (k + u) / weights.size
        while total <= tooth and i < weights.size - 1:
            i += 1
            total += weights[i]
        rows[k] = i  # GORDON1993 (resampling)
    return rows
