"""CMA-ES within a box and a prior's constraint, in numba: functions over arrays, shapes checked by the callers."""

import numpy as np

from posefit.arrays import inlined, jit
from posefit.evolution.kernels import learn, sample, stagnant
from posefit.fitting.kernels import evaluate, feasible, repair, wrap


@inlined
def ask(constraint, rng, periodic, redraws, home, sigma, state, proposals):
    """Write the next population (n, d) as `CMAES.ask` does."""
    mean, scaled, n, left = state[0], state[6], proposals.shape[0], 0
    allowed, broken = np.empty(n, np.bool_), np.empty(n, np.int64)
    sample(rng, mean, sigma, scaled, proposals)
    wrap(periodic, proposals)
    if not feasible(constraint, proposals, allowed):
        for k in range(n):
            if not allowed[k]:
                broken[left] = k
                left += 1
    if left and redraws:
        again, works, count, left = np.empty((left * redraws, mean.size)), np.empty(left * redraws, np.bool_), left, 0
        sample(rng, mean, sigma, scaled, again)
        wrap(periodic, again)
        feasible(constraint, again, works)
        for k in range(count):
            chosen = k * redraws
            while chosen < (k + 1) * redraws and not works[chosen]:
                chosen += 1
            if chosen < (k + 1) * redraws:
                for j in range(mean.size):
                    proposals[broken[k], j] = again[chosen, j]
            else:
                broken[left] = broken[k]
                left += 1
    if left:
        points = np.empty((2, mean.size))
        first, last = points[:1], points[1:]
        for j in range(mean.size):
            points[0, j], points[1, j] = mean[j], home[j]
        repair(constraint, periodic, first, np.arange(1), last)
        repair(constraint, periodic, proposals, broken[:left], first)


@jit
def search(objective, rng, periodic, how, home, generation, sigma, ending, state, worst, searched):
    """Ask, evaluate and tell as `CMAES` does, up to so many populations as `searched` has room for.

    Written to it are the proposals (k, n, d) and their costs (k, n), and to `home` (d,) the best of the last ones.

    Returns how many there are, the step size, and whether the search has come to an end with the last of them.
    """
    redraws, weights, rates, every = how
    mean, (n, d), turns = state[0], searched[0].shape[1:], False
    finite, moved = np.empty(n), np.empty((n, d))
    for j in range(d):
        turns |= periodic[j]
    for g in range(searched[1].shape[0]):
        proposals, costs = searched[0][g], searched[1][g]
        ask(objective.constraint, rng, periodic, redraws, home, sigma, state, proposals)
        if not evaluate(objective, proposals, costs):
            return g, sigma, False
        best = 0
        for k in range(n):
            finite[k] = worst if np.isnan(costs[k]) else min(max(costs[k], -worst), worst)
            best = k if finite[k] < finite[best] else best
            for j in range(d):
                moved[k, j] = proposals[k, j] - mean[j]
        wrap(periodic, moved)
        for j in range(d):
            home[j] = proposals[best, j]
            for k in range(n):
                moved[k, j] = moved[k, j] + mean[j] if turns else proposals[k, j]
        sigma = learn(moved, finite, weights, rates, every, generation + g + 1, sigma, state)
        if stagnant(generation + g + 1, sigma, state, ending[0], ending[1]):
            return g + 1, sigma, True
    return searched[1].shape[0], sigma, False
