"""Which proposals lie in one valley of the cost: hill-valley clustering.

R. K. Ursem, Multinational evolutionary algorithms, CEC 1999: two points are in different valleys where a point between
them costs more than both. S. C. Maree, T. Alderliesten, D. Thierens, P. A. N. Bosman, Real-valued evolutionary
multi-modal optimization driven by hill-valley clustering, GECCO 2018: clusters by that test, here of all pairs in one
call.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.uncertainty.landscape import Landscape, displacement, wrap


@dataclass(frozen=True, eq=False)
class Valleys:
    """Which valley each of some proposals lies in; valleys are numbered by their least cost."""

    labels: NDArray[np.int64]  # (n,)
    lowest: NDArray[np.int64]  # (k,) the row of each valley's least cost


def edge_length(dimensions: int, count: int) -> float:
    """Return the distance of neighbours among `count` proposals spread evenly over the box [-1, 1]^d."""
    return float(2.0 * count ** (-1.0 / dimensions))  # MAREE2018 (edge length)


def same_valley(
    landscape: Landscape,
    proposals: Array,
    costs: Array,
    pairs: NDArray[np.int64],
    probes: NDArray[np.int64],
    tolerance: float = 0.0,
) -> NDArray[np.bool_]:
    """Return which pairs (p, 2) of proposals (n, d) lie in one valley (p,): there is no hill between them.

    The `probes` (p,) are spaced evenly between the two, the short way round where a coordinate is periodic. A hill
    costs more than both by more than `tolerance`, or is infeasible. All are evaluated at once.
    """
    origins, ways = proposals[pairs[:, 0]], displacement(landscape.box, proposals[pairs[:, 0]], proposals[pairs[:, 1]])
    owner = np.repeat(np.arange(len(pairs)), probes)
    number = np.arange(len(owner)) - np.repeat(probes.cumsum() - probes, probes) + 1
    share = number / (probes[owner] + 1.0)
    between = wrap(landscape.box, origins[owner] + share[:, None] * ways[owner])
    rim = costs[pairs].max(axis=1) + tolerance
    hill = landscape.costs(between) > rim[owner]  # URSEM1999 (hill valley)
    return np.asarray(np.bincount(owner[hill], minlength=len(pairs)) == 0)


def valleys(landscape: Landscape, proposals: Array, costs: Array, *, tolerance: float = 0.0, least: int = 1) -> Valleys:
    """Return the valleys of proposals (n, d) whose costs (n,) are known.

    Each, the best first, joins the valley of the nearest better one unless there is a hill between them; then that of
    the next nearest, of d + 1 at most. One that joins none begins a valley. A pair is probed `least` times (1 in the
    source) and once more for every edge length between them. Raises ValueError where a cost is not finite.
    """
    if not np.isfinite(costs).all():
        raise InputError(f"costs must be finite, got {costs[~np.isfinite(costs)][0]}")
    count, dimensions = proposals.shape
    order = np.argsort(costs, kind="stable")
    pairs, probes = _pairs(landscape, proposals, order, edge_length(dimensions, max(count, 1)), least)
    joined = same_valley(landscape, proposals, costs, pairs, probes, tolerance)
    labels, lowest = np.full(count, -1, dtype=np.int64), list[int]()
    first = np.concatenate([[0], np.minimum(np.arange(count), dimensions + 1).cumsum()])
    for place, row in enumerate(order):
        tried: set[int] = set()
        for k in range(first[place], first[place + 1]):
            valley = int(labels[pairs[k, 1]])
            if valley in tried:  # there is a hill before another of its proposals
                continue
            if joined[k]:
                labels[row] = valley
                break
            tried.add(valley)
        if labels[row] < 0:
            labels[row] = len(lowest)
            lowest.append(int(row))
    return Valleys(labels, np.array(lowest, dtype=np.int64))


def _pairs(
    landscape: Landscape, proposals: Array, order: NDArray[np.int64], edge: float, least: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return each proposal with those that are better (p, 2), nearest first, and how often to probe them (p,)."""
    most, ranked = proposals.shape[1] + 1, proposals[order]
    away = np.linalg.norm(displacement(landscape.box, ranked[:, None], ranked), axis=2)
    pairs, far = [np.empty((0, 2), dtype=np.int64)], [np.empty(0)]
    for place in range(1, len(order)):
        nearest = np.argsort(away[place, :place], kind="stable")[:most]  # MAREE2018 (nearest better)
        pairs.append(np.stack([np.full(len(nearest), order[place]), order[nearest]], axis=1))
        far.append(away[place, nearest])
    probes = least + (np.concatenate(far) / edge).astype(np.int64)  # MAREE2018 (test points)
    return np.concatenate(pairs), probes
