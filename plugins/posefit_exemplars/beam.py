"""The states that a frame may be in, and the choice of the best few of them.

A state is a pose of the exemplars with a yaw. Its total is the cost of the best path to
it: the sum of the costs of silhouettes, steps and jumps.
"""

from dataclasses import dataclass, field

import numpy as np

from posefit.arrays import Array
from posefit_exemplars import kernels
from posefit_exemplars.exemplars import YAWS, Exemplars
from posefit_exemplars.kernels import Rows


@dataclass(frozen=True, eq=False)
class Beam:
    """The states of one frame, and the costs of the best paths to them."""

    states: Rows  # (n,) poses of the exemplars
    yaws: Array  # (n,) radians
    totals: Array  # (n,)
    places: Array = field(repr=False)  # (n, 3) metres: the root, aligned or expected

    def __len__(self) -> int:
        return len(self.states)

    def rows(self, rows: Rows) -> "Beam":
        """Return the states in these rows."""
        return Beam(
            self.states[rows], self.yaws[rows], self.totals[rows], self.places[rows]
        )


def diverse_best(
    exemplars: Exemplars, states: Rows, yaws: Array, totals: Array, count: int
) -> Rows:
    """Return the rows of the `count` states of least totals, with few similar ones.

    Of states with equal poses and yaw bins only the cheapest is kept. Of the states of
    one large group with similar yaws only the best few are kept, an equal share: the
    right alternative often costs more for a while, until later silhouettes confirm it.

    Args:
        exemplars: The poses of clips.
        states: (n,) poses of the exemplars.
        yaws: (n,) radians.
        totals: (n,) the cost of the best path to each state.
        count: How many states, at most.
    """
    bins = yaw_bins(yaws)
    order = np.argsort(totals, kind="stable")
    keys = states * YAWS + bins
    kinds = exemplars.coarse_groups[states] * YAWS + bins
    share = group_share(exemplars, count)
    rows: Rows = kernels.first_distinct(order, keys, kinds, share, count)
    return rows


def group_share(exemplars: Exemplars, count: int) -> int:
    """Return how many of `count` states may be of one large group and yaw bin."""
    return max(count // exemplars.coarse_count, 1)


def joined(*beams: Beam) -> Beam:
    """Return the states of all beams."""
    arrays = zip(
        *((beam.states, beam.yaws, beam.totals, beam.places) for beam in beams),
        strict=True,
    )
    return Beam(*map(np.concatenate, arrays))


def yaw_bins(yaws: Array) -> Rows:
    """Return the bin of each yaw."""
    turns = yaws * (YAWS / (2.0 * np.pi))
    bins: Rows = np.round(turns).astype(np.int64) % YAWS
    return bins
