"""CMA-ES within a box and a prior's constraint, in numba: functions over arrays, shapes checked by the callers."""

import numpy as np

from posefit.arrays import jit
from posefit.evolution.kernels import learn, sample, stagnant
from posefit.fitting.kernels import evaluate, feasible


@jit
def wrap(periodic, proposals):
    """Bring the periodic coordinates of proposals (n, d) into [-1, 1)."""
    for j in range(periodic.size):
        if periodic[j]:
            for k in range(proposals.shape[0]):
                proposals[k, j] = (proposals[k, j] + 1.0) % 2.0 - 1.0


@jit
def repair(objective, periodic, steps, proposals, rows, homes):
    """Move proposals (n, d) in some rows (k,) into the box, and infeasible ones towards homes (k or 1, d).

    As `posefit.fitting.box.repair` does it, by the farthest feasible one of `steps` points on the line between them.
    """
    d = proposals.shape[1]
    within, allowed = np.empty((rows.size, d)), np.empty(rows.size, np.bool_)
    for k in range(rows.size):
        for j in range(d):
            within[k, j] = proposals[rows[k], j]
    wrap(periodic, within)
    for k in range(rows.size):
        for j in range(d):
            x = min(max(within[k, j], -1.0), 1.0)
            within[k, j] = x if np.isfinite(x) else homes[k % homes.shape[0], j]
    feasible(objective, within, allowed)
    way, line, works = np.empty((1, d)), np.empty((steps - 1, d)), np.empty(steps - 1, np.bool_)
    for k in range(rows.size):
        home = homes[k % homes.shape[0]]
        if not allowed[k]:
            for j in range(d):
                way[0, j] = within[k, j] - home[j]
            wrap(periodic, way)
            for s in range(steps - 1):
                for j in range(d):
                    line[s, j] = (steps - 1 - s) / steps * way[0, j]
            for s in range(steps - 1):  # by itself: the product is rounded before the sum, as NumPy does it
                for j in range(d):
                    line[s, j] += home[j]
            wrap(periodic, line)
            for s in range(steps - 1):
                for j in range(d):
                    line[s, j] = min(max(line[s, j], -1.0), 1.0)
            feasible(objective, line, works)
            for j in range(d):
                within[k, j] = home[j]
            for s in range(steps - 2, -1, -1):
                if works[s]:
                    for j in range(d):
                        within[k, j] = line[s, j]
        for j in range(d):
            proposals[rows[k], j] = within[k, j]


@jit
def ask(objective, rng, periodic, redraws, steps, home, sigma, state, proposals):
    """Write the next population (n, d) as `CMAES.ask` does."""
    mean, scaled = state[0], state[6]
    allowed = np.empty(proposals.shape[0], np.bool_)
    sample(rng.standard_normal(proposals.shape), mean, sigma, scaled, proposals)  # HANSEN2016 (38)
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
        repair(objective, periodic, steps, middle, np.zeros(1, np.int64), home.reshape(1, -1))
        repair(objective, periodic, steps, proposals, broken, middle)


@jit
def search(objective, rng, periodic, how, home, generation, sigma, ending, state, worst, searched):
    """Ask, evaluate and tell as `CMAES` does, up to so many populations as `searched` has room for.

    Written to it are the proposals (k, n, d) and their costs (k, n), and to `home` (d,) the best of the last ones.

    Returns how many there are, the step size, and whether the search has come to an end with the last of them.
    """
    redraws, steps, weights, rates, every = how
    proposals, costs = searched
    mean, finite, moved = state[0], np.empty(costs.shape[1]), np.empty(proposals.shape[1:])
    for g in range(costs.shape[0]):
        ask(objective, rng, periodic, redraws, steps, home, sigma, state, proposals[g])
        if not evaluate(objective, proposals[g], costs[g]):
            return g, sigma, False
        best = 0
        for k in range(finite.size):
            cost = costs[g, k]
            finite[k] = worst if np.isnan(cost) else min(max(cost, -worst), worst)
            best = k if finite[k] < finite[best] else best
            for j in range(mean.size):
                home[j] = proposals[g, best, j]
                moved[k, j] = proposals[g, k, j] - mean[j]
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
