"""How particles fly, in numba: plain functions over arrays, shapes checked by the callers."""

import math

import numpy as np

from posefit.arrays import jit


@jit
def fly(rows, rand, omega, acceleration, position, velocity, best, swarm_best, low, high, periodic, flown, moved):
    """Write the next velocities and positions (k, d) of particles `rows` (k,), velocities kept within low and high.

    `rand` (2, k, d) scales the accelerations towards the personal and the swarm's best; a periodic coordinate flies the
    short way round and wraps.
    """
    for k in range(rows.size):
        i = rows[k]
        for j in range(low.size):
            x = position[i, j]
            to_personal, to_swarm = best[i, j] - x, swarm_best[j] - x
            if periodic[j]:
                to_personal, to_swarm = wrap(to_personal), wrap(to_swarm)
            phi1, phi2 = acceleration * rand[0, k, j], acceleration * rand[1, k, j]
            v = omega * velocity[i, j] + phi1 * to_personal + phi2 * to_swarm  # SAPSO (1)
            v = min(max(v, low[j]), high[j])
            flown[k, j] = v
            moved[k, j] = wrap(x + v) if periodic[j] else x + v  # SAPSO (2)


@jit
def wrap(x):
    """Return a unit coordinate brought into [-1, 1)."""
    return (x + 1.0) % 2.0 - 1.0


@jit
def redrawable(broken, omega, acceleration, position, velocity, best, swarm_best, low, high, periodic):
    """Return those of the broken particles that some rand() in [0, 1] would keep within the box."""
    left = 0
    kept = np.empty_like(broken)
    for i in broken:
        hope = True
        for j in range(low.size):
            if not periodic[j]:
                x, v = position[i, j], omega * velocity[i, j]
                a, b = acceleration * (best[i, j] - x), acceleration * (swarm_best[j] - x)
                least = min(max(v + min(a, 0.0) + min(b, 0.0), low[j]), high[j])
                most = min(max(v + max(a, 0.0) + max(b, 0.0), low[j]), high[j])
                hope &= x + least <= 1.0 and x + most >= -1.0
        if hope:
            kept[left] = i
            left += 1
    return kept[:left]


@jit
def mend(broken, works, flown, moved, velocity, position):
    """Give each broken particle its first attempt that works (rows in equal shares); return those that have none."""
    many, left = works.size // broken.size, 0
    for k in range(broken.size):
        first = 0
        while first < many and not works[k * many + first]:
            first += 1
        if first < many:
            velocity[broken[k]] = flown[k * many + first]
            position[broken[k]] = moved[k * many + first]
        else:
            broken[left] = broken[k]
            left += 1
    return broken[:left].copy()


@jit
def settle(moved, costs, chances, temperature, position, position_costs, best, best_costs, accepted):
    """Accept or refuse each move by the annealing rule and update the personal bests; return the swarm's best row.

    The rule is Metropolis' criterion: a rise of the cost is accepted with probability exp(-rise / temperature).
    """
    for i in range(costs.size):
        rise = costs[i] - position_costs[i]
        # true of a first cost, which replaces +inf; false of nan
        same = costs[i] == position_costs[i]  # both may be infinite
        accepted[i] = rise <= 0.0 or same or math.exp(-rise / temperature) > chances[i]  # SAPSO A1.2d
        if accepted[i]:
            position[i] = moved[i]
            position_costs[i] = costs[i]
        if position_costs[i] < best_costs[i]:  # SAPSO A1.2b
            best[i] = position[i]
            best_costs[i] = position_costs[i]
    return best_costs.argmin()
