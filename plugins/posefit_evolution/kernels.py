"""CMA-ES within a box and a prior's constraint, in numba: functions over arrays, shapes checked by the callers."""

import numpy as np

from posefit.arrays import jit
from posefit.evolution.kernels import learn, sample, stagnant
from posefit.fitting.kernels import evaluate, feasible, repair, wrap


@jit
def ask(objective, rng, periodic, redraws, home, sigma, state, proposals):
    """Write the next population (n, d) as `CMAES.ask` does."""
    mean, scaled = state[0], state[6]
    allowed = np.empty(proposals.shape[0], np.bool_)
    sample(rng.standard_normal(proposals.shape), mean, sigma, scaled, proposals)
    wrap(periodic, proposals)
    if feasible(objective, proposals, allowed):
        return
    broken = np.flatnonzero(~allowed)
    if redraws:
        again, works = np.empty((broken.size * redraws, mean.size)), np.empty(broken.size * redraws, np.bool_)
        sample(rng.standard_normal(again.shape), mean, sigma, scaled, again)
        wrap(periodic, again)
        feasible(objective, again, works)
        left = 0
        for k in range(broken.size):
            chosen = k * redraws
            while chosen < (k + 1) * redraws and not works[chosen]:
                chosen += 1
            if chosen < (k + 1) * redraws:
                for j in range(mean.size):
                    proposals[broken[k], j] = again[chosen, j]
            else:
                broken[left] = broken[k]
                left += 1
        broken = broken[:left]
    if broken.size:
        middle = np.empty((1, mean.size))
        for j in range(mean.size):
            middle[0, j] = mean[j]
        repair(objective, periodic, middle, np.zeros(1, np.int64), home.reshape(1, -1))
        repair(objective, periodic, proposals, broken, middle)


@jit
def search(objective, rng, periodic, how, home, generation, sigma, ending, state, worst, searched):
    """Ask, evaluate and tell as `CMAES` does, up to so many populations as `searched` has room for.

    Written to it are the proposals (k, n, d) and their costs (k, n), and to `home` (d,) the best of the last ones.

    Returns how many there are, the step size, and whether the search has come to an end with the last of them.
    """
    redraws, weights, rates, every = how
    proposals, costs = searched
    mean, finite, moved = state[0], np.empty(costs.shape[1]), np.empty(proposals.shape[1:])
    for g in range(costs.shape[0]):
        ask(objective, rng, periodic, redraws, home, sigma, state, proposals[g])
        if not evaluate(objective, proposals[g], costs[g]):
            return g, sigma, False
        best = 0
        for k in range(finite.size):
            cost = costs[g, k]
            finite[k] = worst if np.isnan(cost) else min(max(cost, -worst), worst)
            best = k if finite[k] < finite[best] else best
            for j in range(mean.size):
                moved[k, j] = proposals[g, k, j] - mean[j]
        home[:] = proposals[g, best]
        if periodic.any():
            wrap(periodic, moved)
            for k in range(finite.size):
                for j in range(mean.size):
                    moved[k, j] += mean[j]
        else:
            moved[:] = proposals[g]
        sigma = learn(moved, finite, weights, rates, every, generation + g + 1, sigma, state)
        if stagnant(generation + g + 1, sigma, state, ending[0], ending[1]):
            return g + 1, sigma, True
    return costs.shape[0], sigma, False
