"""The turns of Configure-v0 in numba: functions over arrays, which do what `population.Population` does, bit for bit.

`swarm` is as in `posefit_swarm.kernels`. A sum of a product and of what is there already is two loops: NumPy rounds the
product first, and a compiled loop might not.
"""

from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, jit
from posefit.evolution.kernels import rank
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
def rows_of(values, rows):
    """Return some rows (k, d) of values (n, d): numba takes seconds to compile this as an index."""
    some = np.empty((rows.size, values.shape[1]))
    for i in range(rows.size):
        for j in range(values.shape[1]):
            some[i, j] = values[rows[i], j]
    return some


@jit
def differential(constraint, rng, turns, points, bests, order, home, weight, periodic, trials):
    """Write trials (k, d) for points (k, d), as `population.differential` does; `home` (1, d) is the best of all."""
    (k, d), n = points.shape, bests.shape[0]
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
def draw_elite(constraint, rng, turns, bests, order, home, stride, periodic, drawn):
    """Write draws (k, d) from the distribution of the better bests, as `population.normal` does."""
    (k, d), m = drawn.shape, min(max(2, round(turns.elite * order.size)), order.size)
    offsets, middle, normal = np.empty((m, d)), np.empty((1, d)), np.empty((k, m))
    for i in range(m):
        for j in range(d):
            offsets[i, j] = bests[order[i], j] - home[0, j]
    wrap(periodic, offsets)
    for j in range(d):
        middle[0, j] = 0.0
        for i in range(m):
            middle[0, j] += offsets[i, j]
        middle[0, j] /= m
        for i in range(m):
            offsets[i, j] -= middle[0, j]
        middle[0, j] += home[0, j]
    for i in range(k):
        for j in range(m):
            normal[i, j] = rng.standard_normal()
    products(normal, offsets, drawn)
    for i in range(k):
        for j in range(d):
            drawn[i, j] = stride / turns.neutral * (drawn[i, j] / np.sqrt(m))
    add(middle, drawn)
    fold(periodic, drawn)
    repair(constraint, periodic, drawn, np.arange(k), home)


@jit
def scatter(rng, spread, periodic, points, rows, drawn):
    """Write a normal draw (k, d) around points (n, d) in some rows (k,), folded into the box."""
    for i in range(rows.size):
        for j in range(spread.size):
            drawn[i, j] = rng.standard_normal() * spread[j]
    add(rows_of(points, rows), drawn)
    fold(periodic, drawn)


@jit
def kick(constraint, rng, turns, periodic, moved):
    """Move proposals (n, d) by a normal draw each, as `posefit.fitting.box.sample_normal` does."""
    n, d = moved.shape
    drawn, works, broken, count = np.empty((n, d)), np.empty(n, np.bool_), np.empty(n, np.int64), 0
    scatter(rng, turns.kick, periodic, moved, np.arange(n), drawn)
    feasible(constraint, drawn, works)
    for i in range(n):
        if not works[i]:
            broken[count] = i
            count += 1
    broken, left = broken[:count], turns.redraws - 1
    while left > 0 and broken.size:
        many = min(left, turns.batch)
        rows, works = np.empty(broken.size * many, np.int64), np.empty(broken.size * many, np.bool_)
        again = np.empty((rows.size, d))
        for k in range(rows.size):
            rows[k] = broken[k // many]
        scatter(rng, turns.kick, periodic, moved, rows, again)
        feasible(constraint, again, works)
        broken = repair_first(broken, works, again, again, drawn, drawn)
        left -= many
    for j in range(d):
        for k in range(broken.size):
            drawn[broken[k], j] = moved[broken[k], j]
        for i in range(n):
            moved[i, j] = drawn[i, j]


@jit
def move_part(constraint, rng, turns, stride, spare, used, best_costs, bests, part, moved):
    """Move the particles (k, d) of a part, each share with its optimiser; return how much of `spare` is used."""
    position, _, own, _, velocity, low, high, periodic, _ = part
    (count, d), n = moved.shape, 0
    known, costs = np.empty(best_costs.size, np.int64), np.empty(best_costs.size)
    for i in range(best_costs.size):
        if np.isfinite(best_costs[i]):
            known[n], costs[n] = i, best_costs[i]
            n += 1
    bests, order = rows_of(bests, known[:n]), np.empty(n, np.int64)
    rank(costs[:n], order)
    home = rows_of(bests, order[:1])
    swarmed = round(turns.shares[0] * count)
    apart = min(swarmed + round(turns.shares[1] * count), count)
    if swarmed:
        moves, pull = (np.empty((count, d)), moved, np.empty(count, np.bool_)), (stride, turns.acceleration, home[0])
        rand = rng.random(2 * count * d)
        used = advance(constraint, rng, rand, turns.redraws, turns.redraws, pull, spare, used, part, moves)
        for i in range(count):
            for j in range(d):
                velocity[i, j] = moves[0][i, j]
    if swarmed < apart:
        points, trials = own[swarmed:apart], moved[swarmed:apart]
        differential(constraint, rng, turns, points, bests, order, home, stride, periodic, trials)
    if apart < count:
        draw_elite(constraint, rng, turns, bests, order, home, stride, periodic, moved[apart:])
    if swarmed < count:
        way = np.empty((count, d))
        for i in range(count):
            for j in range(d):
                way[i, j] = moved[i, j] - position[i, j]
        wrap(periodic, way)
        for i in range(swarmed, count):
            for j in range(d):
                velocity[i, j] = min(max(way[i, j], low[j]), high[j])
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
    (n, d), done, ranks, all_rows = moved.shape, 0, np.empty(moved.shape[0]), np.empty(moved.shape[0], np.int64)
    while done < turns.evaluations:
        left = turns.evaluations - done
        count = min(turns.wanted, left % n if left % n else n)
        for i in range(n):
            ranks[i], all_rows[i] = -1.0 if np.isinf(best_costs[i]) else best_costs[i], i
        if count < n:
            rank(ranks, all_rows)
        rows, there, some = all_rows[:count], rows_of(moved, all_rows[:count]), costs[done : done + count]
        fresh, own_costs, own_bests, moving = np.empty(count, np.bool_), np.empty(count), np.empty(count), False
        for i in range(count):
            own_costs[i], own_bests[i] = cost[rows[i]], best_costs[rows[i]]
            fresh[i] = np.isinf(own_bests[i])
            moving |= not fresh[i]
        places, own, speeds = rows_of(position, rows), rows_of(bests, rows), rows_of(velocity, rows)
        part = places, own_costs, own, own_bests, speeds, low, high, periodic, clamped
        if moving:
            stride = turns.strides[done // n]
            used = move_part(objective.constraint, rng, turns, stride, spare, used, best_costs, bests, part, there)
        for i in range(count):
            for j in range(d if fresh[i] else 0):
                there[i, j], speeds[i, j] = own[i, j], 0.0
        if not evaluate(objective, there, some):
            return -1, best
        for i in range(count):
            if some[i] < best:
                best = some[i]
                for j in range(d):
                    leader[j] = there[i, j]
        chances, taken = rng.random(count), accepted[done : done + count]
        accept(there, some, chances, turns.temperatures[done // n], 1.0, part, taken)
        for i in range(count):
            row = rows[i]
            cost[row], best_costs[row] = own_costs[i], own_bests[i]
            for j in range(d):
                moved[row, j], position[row, j], bests[row, j] = there[i, j], places[i, j], own[i, j]
                velocity[row, j] = speeds[i, j]
        done += count
    return used, best
