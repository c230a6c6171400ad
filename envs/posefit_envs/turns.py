"""The turns of Configure-v0 in numba: functions over arrays, which do what `population.Population` does, bit for bit.

`swarm` is as in `posefit_swarm.kernels`. A sum of a product and of what is there already is two loops: NumPy rounds the
product first, and a compiled loop might not.
"""

from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, jit
from posefit.fitting.kernels import evaluate, feasible, repair, wrap
from posefit_swarm.kernels import accept, advance
from posefit_swarm.kernels import repair as repair_first


class Turns(NamedTuple):
    """What a step does with a population."""

    evaluations: int
    wanted: int  # particles that move at a time
    shares: tuple[float, float]  # of the swarm, and of differential evolution
    strides: Array  # (every,) of each iteration
    temperatures: Array  # (every,)
    kick: Array  # (d,) standard deviations of a random kick; empty where there is none
    acceleration: float
    leaders: float  # the share of the bests that attract
    crossover: float
    elite: float  # the share of the bests that a normal distribution is estimated from
    neutral: float  # the stride at which it is drawn from as it is
    redraws: int  # of a kick, a particle and a coordinate
    batch: int  # redraws of a kick at a time


@jit
def fold(periodic, proposals):
    """Fold proposals (n, d) into the box."""
    for k in range(proposals.shape[0]):
        for j in range(periodic.size):
            if not periodic[j]:
                proposals[k, j] = abs((proposals[k, j] + 3.0) % 4.0 - 2.0) - 1.0
    wrap(periodic, proposals)


@jit
def add(origins, steps):
    """Add origins (n or 1, d) to steps (n, d)."""
    for k in range(steps.shape[0]):
        for j in range(steps.shape[1]):
            steps[k, j] += origins[k % origins.shape[0], j]


@jit
def products(normal, offsets, steps):
    """Write the matrix product (n, d) of draws (n, m) and offsets (m, d)."""
    for k in range(normal.shape[0]):
        for j in range(offsets.shape[1]):
            steps[k, j] = 0.0
        for i in range(offsets.shape[0]):
            for j in range(offsets.shape[1]):
                steps[k, j] += normal[k, i] * offsets[i, j]


@jit
def differential(constraint, rng, turns, points, bests, order, weight, periodic, trials):
    """Write trials (k, d) for points (k, d), as `population.differential` does."""
    (k, d), n, home = points.shape, bests.shape[0], bests[order[0]].copy().reshape(1, -1)
    leaders = rng.integers(0, max(1, round(turns.leaders * n)), size=k)
    others = rng.integers(0, n, size=2 * k)
    step, difference = np.empty((k, d)), np.empty((k, d))
    for i in range(k):
        for j in range(d):
            step[i, j] = bests[order[leaders[i]], j] - points[i, j]
            difference[i, j] = bests[others[i], j] - bests[others[k + i], j]
    wrap(periodic, step)
    wrap(periodic, difference)
    crossed, always = rng.random((k, d)), rng.integers(0, d, size=k)
    for i in range(k):
        for j in range(d):
            moves = crossed[i, j] < turns.crossover or j == always[i]
            trials[i, j] = weight * (step[i, j] + difference[i, j]) if moves else 0.0
    add(points, trials)
    fold(periodic, trials)
    repair(constraint, periodic, trials, np.arange(k), home)


@jit
def draw_elite(constraint, rng, turns, bests, order, stride, periodic, drawn):
    """Write draws (k, d) from the distribution of the better bests, as `population.normal` does."""
    m, d = max(2, round(turns.elite * order.size)), drawn.shape[1]
    m = min(m, order.size)
    offsets, middle = np.empty((m, d)), np.zeros((1, d))
    for i in range(m):
        for j in range(d):
            offsets[i, j] = bests[order[i], j] - bests[order[0], j]
    wrap(periodic, offsets)
    for i in range(m):
        for j in range(d):
            middle[0, j] += offsets[i, j]
    for j in range(d):
        middle[0, j] /= m
        for i in range(m):
            offsets[i, j] -= middle[0, j]
        middle[0, j] += bests[order[0], j]
    products(rng.standard_normal((drawn.shape[0], m)), offsets, drawn)
    for k in range(drawn.shape[0]):
        for j in range(d):
            drawn[k, j] = stride / turns.neutral * (drawn[k, j] / np.sqrt(m))
    add(middle, drawn)
    fold(periodic, drawn)
    repair(constraint, periodic, drawn, np.arange(drawn.shape[0]), bests[order[0]].copy().reshape(1, -1))


@jit
def kick(constraint, rng, turns, periodic, moved):
    """Move proposals (n, d) by a normal draw each, as `posefit.fitting.box.sample_normal` does."""
    (n, d), spread = moved.shape, turns.kick
    drawn, works = rng.standard_normal((n, d)), np.empty(n, np.bool_)
    for i in range(n):
        for j in range(d):
            drawn[i, j] *= spread[j]
    add(moved, drawn)
    fold(periodic, drawn)
    feasible(constraint, drawn, works)
    broken, left = np.flatnonzero(~works), turns.redraws - 1
    while left > 0 and broken.size:
        many = min(left, turns.batch)
        rows = np.repeat(broken, many)
        again, works = rng.standard_normal((rows.size, d)), np.empty(rows.size, np.bool_)
        for i in range(rows.size):
            for j in range(d):
                again[i, j] *= spread[j]
        add(moved[rows], again)
        fold(periodic, again)
        feasible(constraint, again, works)
        broken = repair_first(broken, works, again, again, drawn, drawn)
        left -= many
    for row in broken:
        for j in range(d):
            drawn[row, j] = moved[row, j]
    moved[:] = drawn


@jit
def move_part(constraint, rng, turns, stride, spare, used, best_costs, bests, part, moved):
    """Move the particles (k, d) of a part, each share with its optimiser; return how much of `spare` is used."""
    position, _, own, _, velocity, low, high, periodic, _ = part
    count, d = moved.shape
    known = np.flatnonzero(np.isfinite(best_costs))
    bests, order = bests[known], np.argsort(best_costs[known], kind="mergesort")
    swarmed = round(turns.shares[0] * count)
    apart = min(swarmed + round(turns.shares[1] * count), count)
    if swarmed:
        moves = np.empty((count, d)), moved, np.empty(count, np.bool_)
        pull, redraws = (stride, turns.acceleration, bests[order[0]].copy()), turns.redraws
        rand = rng.random(2 * count * d)
        used = advance(constraint, rng, rand, redraws, redraws, pull, spare, used, part, moves)
        velocity[:] = moves[0]
    if swarmed < apart:
        points, trials = own[swarmed:apart], moved[swarmed:apart]
        differential(constraint, rng, turns, points, bests, order, stride, periodic, trials)
    if apart < count:
        draw_elite(constraint, rng, turns, bests, order, stride, periodic, moved[apart:])
    if swarmed < count:
        way = moved[swarmed:] - position[swarmed:]
        wrap(periodic, way)
        for i in range(swarmed, count):
            for j in range(d):
                velocity[i, j] = min(max(way[i - swarmed, j], low[j]), high[j])
    if turns.kick.size:
        kick(constraint, rng, turns, periodic, moved)
    return used


@jit
def take_turns(objective, rng, turns, spare, used, best, leader, swarm, moved, costs, accepted):
    """Ask, evaluate and tell until the step's evaluations are used.

    Written are the costs (k,) of all turns, which moves were accepted (k,), and the `leader` (d,) that costs `best`.
    Returns how much of `spare` is used, -1 where a proposal is not finite, and the best cost.
    """
    position, cost, bests, best_costs, velocity, low, high, periodic, clamped = swarm
    (n, d), done = moved.shape, 0
    while done < turns.evaluations:
        left = turns.evaluations - done
        count = min(turns.wanted, left % n if left % n else n)
        rows = np.arange(n)
        if count < n:
            ranks = np.empty(n)
            for i in range(n):
                ranks[i] = -1.0 if np.isinf(best_costs[i]) else best_costs[i]
            rows = np.argsort(ranks, kind="mergesort")[:count].copy()
        there, fresh, some = moved[rows], np.isinf(best_costs[rows]), costs[done : done + count]
        part = position[rows], cost[rows], bests[rows], best_costs[rows], velocity[rows], low, high, periodic, clamped
        if not fresh.all():
            used = move_part(
                objective.constraint, rng, turns, turns.strides[done // n], spare, used, best_costs, bests, part, there
            )
        for i in range(count):
            for j in range(d if fresh[i] else 0):
                there[i, j], part[4][i, j] = part[2][i, j], 0.0
        if not evaluate(objective, there, some):
            return -1, best
        least = np.argmin(some)
        if some[least] < best:
            best = some[least]
            leader[:] = there[least]
        chances, taken = rng.random(count), accepted[done : done + count]
        accept(there, some, chances, turns.temperatures[done // n], 1.0, part, taken)
        for i in range(count):
            row = rows[i]
            cost[row], best_costs[row] = part[1][i], part[3][i]
            for j in range(d):
                moved[row, j], position[row, j], bests[row, j] = there[i, j], part[0][i, j], part[2][i, j]
                velocity[row, j] = part[4][i, j]
        done += count
    return used, best
