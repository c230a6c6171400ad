"""Weighted proposals that are distributed as exp(-cost / temperature) over a box: a tempered, waste-free sampler.

H.-D. Dau, N. Chopin, Waste-free sequential Monte Carlo, Journal of the Royal Statistical Society B 84(1), 2022.
Constants of our own are marked.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.uncertainty.landscape import Box, Landscape, displacement, wrap

PARTICLES = 2048  # N, ours
CHAIN = 8  # P, ours: of N = M P particles, M survive and each becomes a chain of P
SURVIVAL = 0.5  # alpha: the share of the particles that the next temperature leaves
HALVINGS = 24  # ours: bisection steps, to a ten millionth of what is left
ACCEPTANCE = 0.234  # ours: the share of accepted moves that is aimed at, best for long random walks
STEPS = 500  # ours: temperatures, at most
REDRAWS = 100  # Interpretation S7
SPARE = 8  # ours: proposals that are drawn beyond those that are expected to be enough
WIDEST = 0.5  # ours: a wrapped normal of this deviation is its three nearest images to nine digits


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """The start of a sampler: normal distributions around `centres`, cut off at the box, and a uniform share `broad`.

    They wrap around where a coordinate is periodic.
    """

    centres: Array  # (k, d)
    spreads: Array  # (k, d) standard deviations, at most 0.5
    broad: float  # between 0 and 1

    def __post_init__(self) -> None:
        if not ((self.spreads > 0.0) & (self.spreads <= WIDEST)).all():
            raise InputError(f"spreads must be above 0 and at most {WIDEST}, got {self.spreads.ravel()[:3]}")

    def draw(self, box: Box, rng: np.random.Generator, count: int) -> Array:
        """Return feasible proposals (count, d).

        Where 100 attempts give too few, those are repeated. Raises ValueError where they give none.
        """
        accepted, tried, total, more = list[Array](), 0, 0, count
        for _ in range(REDRAWS):
            drawn = self._drawn(box, rng, more)
            accepted.append(drawn[box.feasible(drawn)])
            tried, total = tried + more, total + len(accepted[-1])
            if total >= count:
                break
            more = min(count, (count - total) * tried // max(total, 1) + SPARE)
        if not total:
            raise InputError(f"the box must be feasible somewhere, got nothing in {REDRAWS} x {count} draws")
        drawn = np.concatenate(accepted)
        return (drawn if total >= count else drawn[rng.integers(0, total, count)])[:count]

    def log_density(self, box: Box, proposals: Array) -> Array:
        """Return the logarithm (n,) of the density of proposals (n, d), over that of the uniform distribution."""
        parts = self._log_parts(box, proposals)
        top = parts.max(axis=1)
        near = top + np.log(np.exp(parts - top[:, None]).mean(axis=1))
        return np.asarray(np.logaddexp(near + math.log(1.0 - self.broad), math.log(self.broad)))

    def nearest(self, box: Box, proposals: Array) -> NDArray[np.int64]:
        """Return the densest normal distribution (n,) at each of proposals (n, d)."""
        return np.asarray(self._log_parts(box, proposals).argmax(axis=1))

    def _log_parts(self, box: Box, proposals: Array) -> Array:
        """Return the logarithms (n, k) of each normal density, over that of the uniform distribution."""
        from scipy.special import ndtr

        flat, turning, spreads = ~box.periodic, np.flatnonzero(box.periodic), self.spreads
        centres, precise = self.centres[:, flat], spreads[:, flat] ** -2
        inside = ndtr((1.0 - centres) / spreads[:, flat]) - ndtr((-1.0 - centres) / spreads[:, flat])
        logs = proposals[:, flat] @ (precise * centres).T - 0.5 * proposals[:, flat] ** 2 @ precise.T
        logs -= 0.5 * (precise * centres**2).sum(axis=1) + np.log(inside).sum(axis=1)
        for k in turning.tolist():
            away = (proposals[:, k, None] - self.centres[:, k] + 1.0) % 2.0 - 1.0
            near, *images = (0.5 * ((away + turn) / spreads[:, k]) ** 2 for turn in (0.0, -2.0, 2.0))
            logs += np.log1p(sum(np.exp(near - far) for far in images)) - near
        return np.asarray(logs - np.log(0.5 * math.sqrt(2.0 * math.pi) * spreads).sum(axis=1))

    def _drawn(self, box: Box, rng: np.random.Generator, count: int) -> Array:
        drawn = rng.uniform(-1.0, 1.0, (count, box.dimensions))
        near = np.flatnonzero(rng.random(count) >= self.broad)
        which = rng.integers(0, len(self.centres), len(near))
        means, spreads = self.centres[which], self.spreads[which]
        mine = wrap(box, means + spreads * rng.standard_normal(means.shape))
        rows, columns = np.nonzero(np.abs(mine) > 1.0)
        while len(rows):  # around a mean in the box at least a third of the draws stay inside
            redrawn = means[rows, columns] + spreads[rows, columns] * rng.standard_normal(len(rows))
            mine[rows, columns] = redrawn
            outside = np.abs(redrawn) > 1.0
            rows, columns = rows[outside], columns[outside]
        drawn[near] = mine
        return drawn


@dataclass(frozen=True, eq=False)
class Sampled:
    """Weighted proposals of a density over the box."""

    proposals: Array  # (n, d)
    weights: Array  # (n,), which sum to 1
    costs: Array  # (n,)


def tempered(
    landscape: Landscape,
    start: NormalMixture,
    temperature: float,
    rng: np.random.Generator,
    *,
    particles: int = PARTICLES,
    chain: int = CHAIN,
    evaluations: int | None = None,
) -> Sampled:
    """Return weighted proposals of the density that exp(-cost / temperature) has in the feasible box.

    The particles begin at `start` and go in steps to that density, on the geometric path between both: each step
    leaves the half of them, by effective sample size. Some survive, and each becomes a chain of `chain`
    random-walk moves, all of which are particles. With a budget of `evaluations`, steps are long enough to end within
    it, and the last particles are weighed by the rest. Raises ValueError where a setting makes no sense, or where
    nothing is feasible.
    """
    if not temperature > 0.0:
        raise InputError(f"temperature must be above 0, got {temperature}")
    if not (chain >= 2 and particles >= 2 * chain):
        raise InputError(f"particles must be at least 2 chains of 2 or more, got {particles} and chains of {chain}")
    before, moved = landscape.evaluations, particles // chain * (chain - 1)
    proposals = start.draw(landscape.box, rng, particles)
    costs, starts = landscape.costs(proposals), start.log_density(landscape.box, proposals)
    exponent, factor = 0.0, 1.0
    for number in range(STEPS):
        rises = -costs / temperature - starts
        rounds = np.inf  # of moves within what is left of the budget
        if evaluations is not None:
            rounds = max(evaluations - (landscape.evaluations - before), 0) // moved
        step = left = 1.0 - exponent
        if rounds and number < STEPS - 1:
            step = max(next_step(rises, left, SURVIVAL), left / (1 + rounds))
        weights = reweighed(rises, step)
        exponent = 1.0 if step >= left else exponent + step
        if exponent == 1.0:
            break
        rows = systematic_rows(weights, rng.random(), particles // chain)
        walk = factor * _walk(start, landscape, proposals, weights)
        state = (proposals[rows], costs[rows], starts[rows])
        states, moves = [state], 0.0
        for _ in range(chain - 1):
            state, share = _moved(landscape, start, state, walk, exponent, temperature, rng)
            states.append(state)
            moves += share / (chain - 1)
        factor = float(np.clip(factor * np.exp(2.0 * (moves - ACCEPTANCE)), 0.01, 1.0))
        proposals, costs, starts = (np.concatenate(part) for part in zip(*states, strict=True))  # DAU2022 (waste-free)
    return Sampled(proposals, weights, costs)


def next_step(rises: Array, left: float, survival: float) -> float:
    """Return the longest step, `left` at most, at which weights exp(step rise) leave a share `survival`.

    The share is the effective sample size of the weights over the number of particles that have any. It falls as the
    step grows: bisection.
    """
    alive = rises[rises > -np.inf]

    def enough(step: float) -> bool:
        weights = np.exp(step * (alive - alive.max()))
        return bool(weights.sum() ** 2 / (weights @ weights) >= survival * len(alive))

    if not len(alive) or enough(left):
        return left
    low, high = 0.0, left
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if enough(middle) else (low, middle)
    return high  # DAU2022 (exponent)


def reweighed(rises: Array, step: float) -> Array:
    """Return weights (n,) exp(step rise), which sum to 1.

    Raises ValueError where all weigh nothing.
    """
    highest = rises.max()
    if highest == -np.inf:
        raise InputError(f"costs must be finite somewhere, got infinite ones for all {len(rises)} proposals")
    weights = np.exp(step * (rises - highest))
    return np.asarray(weights / weights.sum())


def systematic_rows(weights: Array, u: float, count: int) -> NDArray[np.int64]:
    """Return `count` rows, each as often as its weight times `count`, rounded up or down: systematic resampling.

    `u` in [0, 1) is the offset of the evenly spaced points.
    """
    rows = weights.cumsum().searchsorted((np.arange(count) + u) / count, side="right")
    return np.asarray(np.minimum(rows, np.flatnonzero(weights)[-1]))


def _walk(start: NormalMixture, landscape: Landscape, proposals: Array, weights: Array) -> Array:
    """Return the root (d, d) of a random walk's covariance, in proportion to that within the modes of the start."""
    proposals, weights, dimensions = proposals[weights > 0.0], weights[weights > 0.0], proposals.shape[1]
    groups = start.nearest(landscape.box, proposals)
    around = displacement(landscape.box, start.centres[groups], proposals)
    for group in np.unique(groups):
        rows = groups == group
        around[rows] -= np.average(around[rows], axis=0, weights=weights[rows])
    covariance = (weights[:, None] * around).T @ around + 1e-12 * np.eye(dimensions)
    return np.asarray(2.38 / np.sqrt(dimensions) * np.linalg.cholesky(covariance))  # DAU2022 (random walk)


_State = tuple[Array, Array, Array]  # proposals (m, d), costs (m,), log densities of the start (m,)


def _moved(
    landscape: Landscape,
    start: NormalMixture,
    state: _State,
    walk: Array,
    exponent: float,
    temperature: float,
    rng: np.random.Generator,
) -> tuple[_State, float]:
    (proposals, costs, starts), box = state, landscape.box
    tried = wrap(box, proposals + rng.standard_normal(proposals.shape) @ walk.T)
    new_costs, new_starts = landscape.costs(tried), start.log_density(box, tried)
    rises = exponent * (costs - new_costs) / temperature + (1.0 - exponent) * (new_starts - starts)
    moves = np.log1p(-rng.random(len(tried))) < rises
    moved = np.where(moves[:, None], tried, proposals)
    return (moved, np.where(moves, new_costs, costs), np.where(moves, new_starts, starts)), float(moves.mean())
