"""Modes with weights from several searches of one problem, by any optimiser.

Hill-valley clustering sorts their proposals into valleys, and a tempered sampler that starts there estimates the share
of exp(-cost / temperature) in each: a deep valley may be narrow, and weigh less than a shallow and wide one.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.uncertainty.hill_valley import valleys
from posefit.uncertainty.landscape import Box, Landscape, displacement
from posefit.uncertainty.smc import WIDEST, NormalMixture, reweighed, systematic_rows, tempered

MAX_OF_SEARCH = 8  # ours: proposals of each search, its best, that are sorted into valleys
PAIR_EVALUATIONS = 12.0  # ours: for each pair of them, so that they take about one in eight of a budget at most
PROBES = 2  # ours: of a pair at least, as valleys may be narrow
MAX_VALLEYS = 16  # ours: the deepest, in which the sampler starts
REACH = 20.0  # ours: temperatures above the least cost: a shallower valley has no weight
BROAD = 0.3  # ours: the share of particles that start anywhere
NARROWEST = 2.0**-7  # ours: half-ranges of the box: the least width of a valley
ENOUGH = 3  # ours: proposals a coordinate from which a valley's own width is estimated
WIDTH_SAMPLE = 300  # ours: proposals from which widths are estimated, evenly over the searches
RIDGE = 1e-3  # of the slopes of costs, as a share of their scale
WIDER = np.array([1.0, 3.0])  # ours: factors on the widths of the start, as coordinates may change together
EVALUATIONS = 10_000  # ours
CHAIN = 3  # P, ours: each survivor becomes so many particles
ROUNDS = 1  # ours: of moves, that a budget holds

Searched = tuple[Array, Array]  # all that one search evaluated: proposals (n, d), costs (n,)


@dataclass(frozen=True, eq=False)
class Weighed:
    """Weighted proposals of one problem, and their modes."""

    proposals: Array  # (n, d)
    weights: Array  # (n,), which sum to 1
    costs: Array  # (n,)
    groups: NDArray[np.int64]  # (n,) the mode of each, a row of `modes`
    modes: Array  # (k, d) the lowest proposals of the valleys, the deepest first

    def even(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return proposals (count, d) of equal weights (count,): each mode has its share, rounded up or down."""
        order = np.lexsort([self.costs, self.groups])
        rows = order[systematic_rows(self.weights[order], rng.random(), count)]
        return self.proposals[rows], np.full(count, 1.0 / count)


def weighed(
    landscape: Landscape,
    searched: Sequence[Searched],
    temperature: float,
    rng: np.random.Generator,
    *,
    evaluations: int = EVALUATIONS,
) -> Weighed:
    """Return weighted proposals of the density exp(-cost / temperature), from the evaluations of several searches.

    Hills lower than a `temperature` separate no valleys: pixels cause many meaningless ones. It takes about
    `evaluations` more. Raises ValueError where no search has a finite cost.
    """
    before = landscape.evaluations
    each = min(max(int(np.sqrt(evaluations / PAIR_EVALUATIONS) / len(searched)), 1), MAX_OF_SEARCH)
    proposals, costs = best_of_each(landscape, searched, each)
    clusters = valleys(landscape, proposals, costs, tolerance=temperature, least=PROBES)
    lowest = clusters.lowest[costs[clusters.lowest] <= costs.min() + REACH * temperature][:MAX_VALLEYS]
    modes = proposals[lowest]
    valley_widths = widths(landscape.box, searched, modes, costs[lowest], temperature)
    spreads = np.concatenate([np.minimum(factor * valley_widths, WIDEST) for factor in WIDER])
    start = NormalMixture(np.tile(modes, (len(WIDER), 1)), spreads, BROAD)
    left = max(evaluations - (landscape.evaluations - before), 0)
    particles = max(int(left / (CHAIN + ROUNDS * (CHAIN - 1))), 2) * CHAIN
    sample = tempered(landscape, start, temperature, rng, particles=particles, chain=CHAIN, evaluations=left)
    groups = start.nearest(landscape.box, sample.proposals) % len(modes)
    return Weighed(sample.proposals, sample.weights, sample.costs, groups, modes)


def best_of_each(landscape: Landscape, searched: Sequence[Searched], each: int) -> Searched:
    """Return the best `each` of the different feasible proposals of every search, and their costs.

    Raises ValueError where none of them has a finite cost.
    """
    chosen, chosen_costs = [], []
    for proposals, costs in searched:
        order = np.flatnonzero(np.isfinite(costs))
        order = order[np.argsort(costs[order], kind="stable")][: 4 * each]
        order = order[landscape.box.feasible(proposals[order])] if len(order) else order
        order = order[np.sort(np.unique(proposals[order], axis=0, return_index=True)[1])[:each]]
        chosen.append(proposals[order])
        chosen_costs.append(costs[order])
    if not sum(map(len, chosen)):
        raise InputError(f"searches must have a finite cost, got none in {len(searched)} searches")
    return np.concatenate(chosen), np.concatenate(chosen_costs)


def boltzmann_weights(costs: Array, temperature: float) -> Array:
    """Return weights (n,) exp(-cost / temperature), which sum to 1; all the same where no cost is finite."""
    rises = np.where(np.isfinite(costs), -costs / temperature, -np.inf)
    if rises.max() == -np.inf:
        return np.full(len(costs), 1.0 / len(costs))
    return reweighed(rises, 1.0)


def widths(box: Box, searched: Sequence[Searched], modes: Array, costs: Array, temperature: float) -> Array:
    """Return the widths (k, d) of modes (k, d) along each coordinate, in half-ranges of the box.

    A width is the standard deviation of exp(-cost / temperature) where the cost rises from the mode as a sum of
    squares, fitted by least squares to the proposals nearest to the mode, or where those are few, to all.
    """
    proposals, known = (np.concatenate(part) for part in zip(*searched, strict=True))
    usable = np.flatnonzero(known <= costs.min() + REACH * temperature)
    usable = usable[:: max(len(usable) // WIDTH_SAMPLE, 1)]
    proposals, known = proposals[usable], known[usable]
    away = np.array([displacement(box, mode, proposals) ** 2 for mode in modes])  # (k, n, d)
    owners = away.sum(axis=2).argmin(axis=0)
    away, rises = away[owners, np.arange(len(known))], known - costs[owners]
    per_mode = np.tile(_width(away, rises, temperature), (len(modes), 1))
    for k in np.flatnonzero(np.bincount(owners, minlength=len(modes)) >= ENOUGH * modes.shape[1]):
        per_mode[k] = _width(away[owners == k], rises[owners == k], temperature)
    return per_mode


def _width(squares: Array, rises: Array, temperature: float) -> Array:
    """Return the standard deviations (d,) for costs that rise (n,) over squared distances (n, d)."""
    gram = squares.T @ squares
    gram += (RIDGE * np.trace(gram) / len(gram) + np.finfo(float).tiny) * np.eye(len(gram))
    slopes = np.linalg.solve(gram, squares.T @ rises)
    return np.asarray(np.clip(np.sqrt(0.5 * temperature / np.maximum(slopes, temperature)), NARROWEST, WIDEST))
