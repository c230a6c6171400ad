"""The loops of the sampler and of modes, in numba: plain functions over arrays, shapes checked by the callers."""

import math

import numpy as np

from posefit.arrays import jit


@jit
def log_parts(proposals, centres, spreads, periodic):
    """Return the logarithms (n, k) of normal densities at proposals (n, d), over that of the uniform distribution.

    They are cut off at the sides of the box [-1, 1]^d, and wrap around where a coordinate is periodic.
    """
    count, d = centres.shape
    logs = np.empty((proposals.shape[0], count))
    for k in range(count):
        constant = 0.0
        for j in range(d):
            usual = 0.5 * spreads[k, j] * math.sqrt(2.0 * math.pi)
            if not periodic[j]:
                above = (1.0 - centres[k, j]) / spreads[k, j] / math.sqrt(2.0)
                below = (-1.0 - centres[k, j]) / spreads[k, j] / math.sqrt(2.0)
                usual *= 0.5 * (math.erf(above) - math.erf(below))
            constant += math.log(usual)
        for i in range(proposals.shape[0]):
            total = -constant
            for j in range(d):
                away = proposals[i, j] - centres[k, j]
                if periodic[j]:
                    away = (away + 1.0) % 2.0 - 1.0
                    scaled, images = away / spreads[k, j], 0.0
                    for turn in (-2.0, 2.0):
                        other = (away + turn) / spreads[k, j]
                        images += math.exp(-0.5 * (other * other - scaled * scaled))
                    total += math.log1p(images) - 0.5 * scaled * scaled
                else:
                    scaled = away / spreads[k, j]
                    total -= 0.5 * scaled * scaled
            logs[i, k] = total
    return logs


@jit
def log_sums(logs, each, least):
    """Return the logarithms (n,) of the sums of exp(each + a row's (n, k)) and of exp(least)."""
    sums = np.empty(logs.shape[0])
    for i in range(logs.shape[0]):
        top = least
        for k in range(logs.shape[1]):
            top = max(top, each + logs[i, k])
        total = math.exp(least - top)
        for k in range(logs.shape[1]):
            total += math.exp(each + logs[i, k] - top)
        sums[i] = top + math.log(total)
    return sums


@jit
def effective(logarithms):
    """Return the effective sample size of weights whose logarithms (n,) are given, the greatest of which is finite."""
    top = -math.inf
    for i in range(logarithms.size):
        top = max(top, logarithms[i])
    total = squares = 0.0
    for i in range(logarithms.size):
        weight = math.exp(logarithms[i] - top)
        total += weight
        squares += weight * weight
    return total * total / squares


@jit
def longest_step(rises, left, wanted, halvings):
    """Return how far to go, at most what is `left`, that weights exp(step rise) (n,) have the size that is wanted."""
    low, high = 0.0, left
    for _ in range(halvings):
        middle = 0.5 * (low + high)
        if effective(middle * rises) > wanted:
            low = middle
        else:
            high = middle
    return high


@jit
def random_walk(proposals, noise, walk, periodic):
    """Return proposals (n, d) moved by standard normal noise (n, d) times a walk (d, d), wrapped where periodic."""
    n, d = proposals.shape
    tried = np.empty((n, d))
    for i in range(n):
        for j in range(d):
            moved = proposals[i, j]
            for k in range(j + 1):  # the walk is a lower triangle
                moved += walk[j, k] * noise[i, k]
            tried[i, j] = (moved + 1.0) % 2.0 - 1.0 if periodic[j] else moved
    return tried


@jit
def accept_moves(proposals, costs, starts, tried, new_costs, new_starts, draws, exponent, temperature):
    """Put what is accepted of moves tried (n, d) in the place of proposals (n, d); return the share that is.

    `costs` and `starts` (n,), the log density of the start, go along; `draws` (n,) in [0, 1) decide.
    """
    count = 0
    for i in range(costs.size):
        rise = exponent * (costs[i] - new_costs[i]) / temperature + (1.0 - exponent) * (new_starts[i] - starts[i])
        if math.log(1.0 - draws[i]) < rise:
            proposals[i], costs[i], starts[i] = tried[i], new_costs[i], new_starts[i]
            count += 1
    return count / costs.size


@jit
def covariance_within(proposals, weights, groups, centres, periodic):
    """Return the covariance (d, d) of weighted proposals (n, d) about the means of their groups (n,).

    `centres` (k, d) is about where each group lies: coordinates that are periodic go the short way from there.
    """
    n, d = proposals.shape
    means, totals, around = np.zeros(centres.shape), np.zeros(centres.shape[0]), np.empty((n, d))
    for i in range(n):
        totals[groups[i]] += weights[i]
        for j in range(d):
            around[i, j] = proposals[i, j] - centres[groups[i], j]
            if periodic[j]:
                around[i, j] = (around[i, j] + 1.0) % 2.0 - 1.0
            means[groups[i], j] += weights[i] * around[i, j]
    covariance = np.zeros((d, d))
    for i in range(n):
        if weights[i] > 0.0:
            for j in range(d):
                around[i, j] -= means[groups[i], j] / totals[groups[i]]
                for m in range(j + 1):
                    covariance[j, m] += weights[i] * around[i, j] * around[i, m]
    for j in range(d):
        for m in range(j):
            covariance[m, j] = covariance[j, m]
    return covariance


@jit
def mean_distances(joints):
    """Return how far joints (n, j, 3) are from each other (n, n), the mean over joints."""
    n, count, _ = joints.shape
    distances = np.zeros((n, n))
    for i in range(n):
        for k in range(i):
            total = 0.0
            for j in range(count):
                x = joints[i, j, 0] - joints[k, j, 0]
                y = joints[i, j, 1] - joints[k, j, 1]
                z = joints[i, j, 2] - joints[k, j, 2]
                total += math.sqrt(x * x + y * y + z * z)
            distances[i, k] = distances[k, i] = total / count
    return distances
