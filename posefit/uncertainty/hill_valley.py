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
    proposals, costs = proposals[order], costs[order]
    away = np.linalg.norm(displacement(landscape.box, proposals[:, None], proposals), axis=2)
    ranks = (np.argsort(away[k, :k], kind="stable") for k in range(count))
    better = [nearest[: dimensions + 1].tolist() for nearest in ranks]  # MAREE2018 (nearest better)
    pairs = np.array([(k, other) for k in range(count) for other in better[k]], dtype=np.int64).reshape(-1, 2)
    edges = away[pairs[:, 0], pairs[:, 1]] / edge_length(dimensions, max(count, 1))
    probes = least + edges.astype(np.int64)  # MAREE2018 (test points)
    joined = iter(same_valley(landscape, proposals, costs, pairs, probes, tolerance).tolist())
    labels, lowest = np.full(count, -1, dtype=np.int64), list[int]()
    for k, others in enumerate(better):
        each = [(int(labels[other]), joins) for other, joins in zip(others, joined, strict=False)]
        nearest = dict(reversed(each))  # of a valley the nearest alone counts: there is a hill before its others
        labels[k] = next((valley for valley, _ in each if nearest[valley]), len(lowest))
        if labels[k] == len(lowest):
            lowest.append(k)
    by_row = np.empty_like(labels)
    by_row[order] = labels
    return Valleys(by_row, order[np.array(lowest, dtype=np.int64)])
