"""Several searches of one problem become modes with weights, whatever optimiser they are made by.

Hill-valley clustering tells which valleys were found in what they evaluated, and a tempered sampler that starts there
tells how much of exp(-cost / temperature) each valley holds: a deep one may be narrow, and weigh less than a shallow
one that is wide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.posterior.hill_valley import valleys
from posefit.posterior.landscape import Landscape
from posefit.posterior.mixture import WIDEST, NormalMixture
from posefit.posterior.smc import CHAIN, PARTICLES, reweighed, systematic_rows, tempered

EACH = 8  # ours: of each search, so many of its best proposals are sorted into valleys
PROBES = 3  # ours: of a pair, at the least, as these valleys may be narrow
MOST = 16  # ours: valleys that the sampler starts in, the deepest
REACH = 10.0  # ours: in temperatures above the least cost: what is not as deep weighs nothing worth a start
BROAD = 0.3  # ours: the share of particles that start anywhere
WIDTHS = 0.5 ** np.arange(7, 0, -1)  # ours: how wide a valley may be, in half-ranges of the box
WIDER = np.array([1.0, 3.0])  # ours: particles start as wide, and wider, as coordinates may change together

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
    particles: int = PARTICLES,
    chain: int = CHAIN,
) -> Weighed:
    """Return weighted proposals of the density exp(-cost / temperature), found from what several searches evaluated.

    Hills lower than a `temperature` part no valleys: silhouettes are made of pixels, and have many that mean nothing.
    Raises ValueError where no search has met a finite cost.
    """
    before = landscape.evaluations
    proposals, costs = best_of_each(landscape, searched, EACH)
    found = valleys(landscape, proposals, costs, tolerance=temperature, least=PROBES)
    lowest = found.lowest[costs[found.lowest] <= costs.min() + REACH * temperature][:MOST]
    modes = proposals[lowest]
    spreads = WIDER[:, None, None] * widths(landscape, modes, costs[lowest], temperature)
    centres = np.broadcast_to(modes, spreads.shape)
    start = NormalMixture(_rows(centres), np.minimum(_rows(spreads), WIDEST), BROAD)
    sample = tempered(landscape, start, temperature, rng, particles=particles, chain=chain)
    groups = start.nearest(landscape.box, sample.proposals) % len(modes)
    shares: Array = np.bincount(groups, sample.weights, len(modes)).astype(np.float64)
    spent = landscape.evaluations - before
    return Weighed(sample.proposals, sample.weights, sample.costs, groups, modes, shares, spent)


def _rows(several: Array) -> Array:
    """Return what has the shape (s, k, d) as (s k, d)."""
    return several.reshape(-1, several.shape[-1])


def best_of_each(landscape: Landscape, searched: Sequence[Searched], each: int) -> Searched:
    """Return the best `each` of the different feasible proposals of every search, and their costs.

    Raises ValueError where none of them has a finite cost.
    """
    chosen, known = [], []
    for proposals, costs in searched:
        usable = np.flatnonzero(np.isfinite(costs))
        order = usable[np.argsort(costs[usable], kind="stable")][: 4 * each]
        order = order[landscape.box.feasible(proposals[order])] if len(order) else order
        _, first = np.unique(proposals[order], axis=0, return_index=True)
        rows = order[np.sort(first)][:each]
        chosen.append(proposals[rows])
        known.append(costs[rows])
    if not sum(map(len, known)):
        raise ValueError(f"searches must meet a finite cost, got none in {len(searched)} searches")
    return np.concatenate(chosen), np.concatenate(known)


def likelihoods(costs: Array, temperature: float) -> Array:
    """Return weights (n,) exp(-cost / temperature), which sum to 1; all weigh alike where no cost is finite."""
    rises = np.where(np.isfinite(costs), -costs / temperature, -np.inf)
    if rises.max() == -np.inf:
        return np.full(len(costs), 1.0 / len(costs))
    return reweighed(rises, 1.0)[0]


def widths(landscape: Landscape, modes: Array, costs: Array, temperature: float) -> Array:
    """Return how wide each mode (k, d) is along each coordinate (k, d), in half-ranges of the box.

    That is the least of some widths at which the cost has risen by half a temperature on both sides, as it has one
    standard deviation from the mode of a normal distribution. All are probed in one call.
    """
    count, dimensions = modes.shape
    steps = np.stack([WIDTHS, -WIDTHS])[:, :, None, None] * np.eye(dimensions)  # (2, w, d, d)
    probes = landscape.box.wrap(modes[:, None, None, None] + steps)
    found = landscape.costs(probes.reshape(-1, dimensions)).reshape(count, 2, len(WIDTHS), dimensions)
    risen = found.min(axis=1) > costs[:, None, None] + 0.5 * temperature  # (k, w, d)
    return np.asarray(np.where(np.any(risen, axis=1), WIDTHS[risen.argmax(axis=1)], WIDTHS[-1]))
