"""Several searches of one problem become modes with weights, whatever optimiser they are made by.

Hill-valley clustering sorts what they evaluated into valleys, and a tempered sampler that starts there estimates how
much of exp(-cost / temperature) each valley holds: a deep one may be narrow, and weigh less than a shallow one that is
wide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.uncertainty.hill_valley import valleys
from posefit.uncertainty.landscape import Box, Landscape, displacement
from posefit.uncertainty.mixture import WIDEST, NormalMixture
from posefit.uncertainty.smc import reweighed, systematic_rows, tempered

EACH = 8  # ours: of each search, so many of its best proposals are sorted into valleys, at most
TOUCHED = 12.0  # ours: evaluations for each pair of them that is; of a budget, no more than about one in eight
PROBES = 2  # ours: of a pair, at the least, as these valleys may be narrow
MOST = 16  # ours: valleys that the sampler starts in, the deepest
REACH = 20.0  # ours: in temperatures above the least cost: what is not as deep weighs nothing worth a start
BROAD = 0.3  # ours: the share of particles that start anywhere
NARROWEST = 2.0**-7  # ours: how narrow a valley may be, in half-ranges of the box
ENOUGH = 3  # ours: proposals a coordinate from which a valley's own width is estimated
LOOKED_AT = 300  # ours: of those, about so many, evenly over the searches
RIDGE = 1e-3  # of how fast costs rise, as a share of what is known of them
WIDER = np.array([1.0, 3.0])  # ours: particles start as wide, and wider, as coordinates may change together
EVALUATIONS = 10_000  # ours
CHAIN = 3  # P, ours: each survivor becomes so many particles
ROUNDS = 1  # ours: of moves, that a budget holds

Searched = tuple[Array, Array]  # all that one search evaluated: proposals (n, d), costs (n,)


@dataclass(frozen=True, eq=False)
class Weighed:
    """Weighted proposals of one problem, and the modes that they belong to."""

    proposals: Array  # (n, d)
    weights: Array  # (n,), which sum to 1
    costs: Array  # (n,)
    groups: NDArray[np.int64]  # (n,) the mode of each, a row of `modes`
    modes: Array  # (k, d) the lowest proposals of the valleys, the deepest first
    mode_weights: Array  # (k,), which sum to 1
    evaluations: int  # beyond those of the searches

    def even(self, count: int, rng: np.random.Generator) -> tuple[Array, Array]:
        """Return proposals (count, d) of equal weights (count,): each mode has its share, as nearly as it goes."""
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
    """Return weighted proposals of the density exp(-cost / temperature), from what several searches evaluated.

    Hills lower than a `temperature` part no valleys: pixels cause many meaningless ones.
    It takes about so many `evaluations` more. Raises ValueError where no search has met a finite cost.
    """
    before = landscape.evaluations
    proposals, costs = best_of_each(landscape, searched, _each(evaluations, len(searched)))
    clusters = valleys(landscape, proposals, costs, tolerance=temperature, least=PROBES)
    lowest = clusters.lowest[costs[clusters.lowest] <= costs.min() + REACH * temperature][:MOST]
    modes = proposals[lowest]
    spreads = WIDER[:, None, None] * widths(landscape.box, searched, modes, costs[lowest], temperature)
    centres = np.broadcast_to(modes, spreads.shape)
    start = NormalMixture(_rows(centres), np.minimum(_rows(spreads), WIDEST), BROAD)
    left = max(evaluations - (landscape.evaluations - before), 0)
    particles = max(int(left / (CHAIN + ROUNDS * (CHAIN - 1))), 2) * CHAIN
    sample = tempered(landscape, start, temperature, rng, particles=particles, chain=CHAIN, evaluations=left)
    groups = start.nearest(landscape.box, sample.proposals) % len(modes)
    shares: Array = np.bincount(groups, sample.weights, len(modes)).astype(np.float64)
    spent = landscape.evaluations - before
    return Weighed(sample.proposals, sample.weights, sample.costs, groups, modes, shares, spent)


def _each(evaluations: int, searches: int) -> int:
    """Return how many of the best proposals of each search are sorted into valleys."""
    return min(max(int(np.sqrt(evaluations / TOUCHED) / searches), 1), EACH)


def _rows(several: Array) -> Array:
    """Return what has the shape (s, k, d) as (s k, d)."""
    return several.reshape(-1, several.shape[-1])


def best_of_each(landscape: Landscape, searched: Sequence[Searched], each: int) -> Searched:
    """Return the best `each` of the different feasible proposals of every search, and their costs.

    Raises ValueError where none of them has a finite cost.
    """
    chosen, known = [], []
    for proposals, costs in searched:
        order = np.flatnonzero(np.isfinite(costs))
        if len(order) > 4 * each:
            order = order[costs[order] <= np.partition(costs[order], 4 * each)[4 * each]]
        order = order[np.argsort(costs[order], kind="stable")][: 4 * each]
        order = order[landscape.box.feasible(proposals[order])] if len(order) else order
        different: dict[bytes, int] = {}
        for row in order.tolist():
            different.setdefault(proposals[row].tobytes(), row)
        rows = np.array(list(different.values())[:each], dtype=np.int64)
        chosen.append(proposals[rows])
        known.append(costs[rows])
    if not sum(map(len, known)):
        raise InputError(f"searches must meet a finite cost, got none in {len(searched)} searches")
    return np.concatenate(chosen), np.concatenate(known)


def boltzmann_weights(costs: Array, temperature: float) -> Array:
    """Return weights (n,) exp(-cost / temperature), which sum to 1; all the same where no cost is finite."""
    rises = np.where(np.isfinite(costs), -costs / temperature, -np.inf)
    if rises.max() == -np.inf:
        return np.full(len(costs), 1.0 / len(costs))
    return reweighed(rises, 1.0)[0]


def widths(box: Box, searched: Sequence[Searched], modes: Array, costs: Array, temperature: float) -> Array:
    """Return how wide each mode (k, d) is along each coordinate (k, d), in half-ranges of the box.

    That is the standard deviation of exp(-cost / temperature) where the cost rises from the mode as a sum of squares:
    those sums are fitted, by least squares, to the costs of what was evaluated nearest to the mode, and where that is
    little, of all.
    """
    proposals, known = (np.concatenate(part) for part in zip(*searched, strict=True))
    usable = np.flatnonzero(known <= costs.min() + REACH * temperature)
    usable = usable[:: max(len(usable) // LOOKED_AT, 1)]
    proposals, known = proposals[usable], known[usable]
    away = np.array([displacement(box, mode, proposals) ** 2 for mode in modes])  # (k, n, d)
    owners = away.sum(axis=2).argmin(axis=0)
    away, rises = away[owners, np.arange(len(known))], known - costs[owners]
    if len(modes) == 1:
        return _width(away, rises, temperature)[None]
    per_mode = np.tile(_width(away, rises, temperature), (len(modes), 1))
    for k in np.flatnonzero(np.bincount(owners, minlength=len(modes)) >= ENOUGH * modes.shape[1]):
        per_mode[k] = _width(away[owners == k], rises[owners == k], temperature)
    return per_mode


def _width(squares: Array, rises: Array, temperature: float) -> Array:
    """Return the standard deviations (d,) that go with costs that rise (n,) over squared distances (n, d)."""
    gram = squares.T @ squares
    gram += (RIDGE * np.trace(gram) / len(gram) + np.finfo(float).tiny) * np.eye(len(gram))
    slopes = np.linalg.solve(gram, squares.T @ rises)
    return np.asarray(np.clip(np.sqrt(0.5 * temperature / np.maximum(slopes, temperature)), NARROWEST, WIDEST))
