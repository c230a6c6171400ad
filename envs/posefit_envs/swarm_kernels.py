"""How particles move, in numba: plain functions over arrays, shapes checked by the callers.

`swarm` is a tuple: positions (n, d) and their costs (n,), personal bests (n, d) and their costs
(n,), velocities (n, d), the lowest and highest velocities (d,), which coordinates are periodic (d,), and whether
velocities are clamped to their limits; else one outside them breaks a constraint.
"""

import math

from posefit.arrays import inlined, jit

FIRST_REDRAWS = 6  # ours: how many redraws of whole particles are made at once at first; then all that are left


@inlined
def wrap(x):
    """Return a unit coordinate brought into [-1, 1)."""
    return (x + 1.0) % 2.0 - 1.0


@jit
def step(r1, r2, omega, acceleration, x, v, best, swarm_best, low, high, periodic, clamped):
    """Return the next velocity and position of one coordinate of a particle, and whether both are within their limits.

    A periodic coordinate goes the short way round and wraps.
    """
    to_personal, to_swarm = best - x, swarm_best - x
    if periodic:
        to_personal, to_swarm = wrap(to_personal), wrap(to_swarm)
    phi1, phi2 = acceleration * r1, acceleration * r2
    v = omega * v + phi1 * to_personal + phi2 * to_swarm  # SAPSO (1)
    if clamped:
        v = min(max(v, low), high)
    x = x + v  # SAPSO (2)
    if periodic:
        x = wrap(x)
    return v, x, abs(x) <= 1.0 and low <= v <= high


@inlined
def reachable(omega, acceleration, x, v, best, swarm_best, low, high, periodic, clamped):
    """Return whether some rand() in [0, 1] would keep one coordinate, and its velocity, within the limits."""
    to_personal, to_swarm = best - x, swarm_best - x
    if periodic:
        to_personal, to_swarm = wrap(to_personal), wrap(to_swarm)
    a, b = acceleration * to_personal, acceleration * to_swarm
    least = omega * v + min(a, 0.0) + min(b, 0.0)
    most = omega * v + max(a, 0.0) + max(b, 0.0)
    if not clamped and (least > high or most < low):
        return False
    least, most = min(max(least, low), high), min(max(most, low), high)
    return periodic or (x + least <= 1.0 and x + most >= -1.0)


@jit
def move(rows, first, rand, spare, used, redraws, omega, acceleration, swarm_best, swarm, velocities, moved, stopped):
    """Write the next velocities and positions (k, d) of particles `rows` (k,), from the one that is `first` among them.

    The last 2 k d numbers of `rand` are the draws of rand(): one for each coordinate's pull towards the personal best,
    then one for each towards the swarm's. A coordinate beyond its limits has its two drawn again, from `spare` after
    the first `used`, at most `redraws` times. `stopped` (k,) marks particles stopped at the border: no draw could keep
    a coordinate within its limits, and then none is drawn again, or all redraws of one left them.

    Returns `first` and `used` as they are then: the first is k, or whose turn it was when `spare` held too little.
    """
    position, _, best, _, velocity, low, high, periodic, clamped = swarm
    d = low.size
    personal, swarms = rand.size - 2 * rows.size * d, rand.size - rows.size * d
    for k in range(first, rows.size):
        if used + 2 * redraws * d > spare.size:
            return k, used
        i = rows[k]
        inside, hope = True, True
        for j in range(d):
            r1, r2 = rand[personal + k * d + j], rand[swarms + k * d + j]
            x, v, p, g = position[i, j], velocity[i, j], best[i, j], swarm_best[j]
            v, x, within = step(r1, r2, omega, acceleration, x, v, p, g, low[j], high[j], periodic[j], clamped)
            velocities[k, j], moved[k, j] = v, x
            inside &= within
        if not inside:
            for j in range(d):
                x, v, p, g = position[i, j], velocity[i, j], best[i, j], swarm_best[j]
                hope &= reachable(omega, acceleration, x, v, p, g, low[j], high[j], periodic[j], clamped)
        stopped[k] = not hope
        j = 0
        while j < d and not (inside or stopped[k]):
            left = redraws
            within = abs(moved[k, j]) <= 1.0 and low[j] <= velocities[k, j] <= high[j]
            while left > 0 and not within:
                r1, r2 = spare[used], spare[used + 1]
                x, v, p, g = position[i, j], velocity[i, j], best[i, j], swarm_best[j]
                v, x, within = step(r1, r2, omega, acceleration, x, v, p, g, low[j], high[j], periodic[j], clamped)
                velocities[k, j], moved[k, j] = v, x
                left, used = left - 1, used + 2
            stopped[k] = redraws > 0 and not within
            j += 1
        if stopped[k]:
            for j in range(d):
                velocities[k, j], moved[k, j] = 0.0, min(max(moved[k, j], -1.0), 1.0)
    return rows.size, used


@inlined
def update_best(i, position, cost, best, best_costs, leader):
    """Make a position (d,) that costs less the best of particle i; return the row of the best of all."""
    if cost < best_costs[i]:  # SAPSO A1.2b
        for j in range(position.size):
            best[i, j] = position[j]
        best_costs[i] = cost
    return i if best_costs[i] < best_costs[leader] else leader


@jit
def accept(moved, costs, chances, temperature, kept, swarm, accepted):
    """Accept or refuse each move by the annealing rule and update the personal bests; return the swarm's best row.

    The rule is Metropolis' criterion: a rise of the cost is accepted with probability exp(-rise / temperature). The
    first n of `chances` are the draws for it. A particle whose move is refused keeps `kept` times its velocity.
    """
    position, position_costs, best, best_costs, velocity, _, _, _, _ = swarm
    leader = 0
    for i in range(costs.size):
        rise = costs[i] - position_costs[i]
        # true of a first cost, which replaces +inf; false of nan
        same = costs[i] == position_costs[i]  # both may be infinite
        accepted[i] = rise <= 0.0 or same or math.exp(-rise / temperature) > chances[i]  # SAPSO A1.2d
        for j in range(moved.shape[1]):
            if accepted[i]:
                position[i, j] = moved[i, j]
            else:
                velocity[i, j] *= kept
        if accepted[i]:
            position_costs[i] = costs[i]
        leader = update_best(i, position[i], position_costs[i], best, best_costs, leader)
    return leader


@inlined
def repair(broken, works, velocities, moved, velocity, position):
    """Give each broken particle its first attempt that works (rows in equal shares); return those that have none."""
    many, left = works.size // broken.size, 0
    for k in range(broken.size):
        first = 0
        while first < many and not works[k * many + first]:
            first += 1
        if first < many:
            for j in range(velocities.shape[1]):  # numba would compile seven times as long for two rows at once
                velocity[broken[k], j] = velocities[k * many + first, j]
                position[broken[k], j] = moved[k * many + first, j]
        else:
            broken[left] = broken[k]
            left += 1
    return broken[:left].copy()
