"""The methods of a sweep on the runs that they share."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.report.runs import Runs
from posefit.statistics.means import Intervals, block_means
from posefit.statistics.paired import PairedTest, paired_tests
from posefit.statistics.pairing import Shared, most_shared

# A method that lost some tracks, but fewer than these, has no interval. So few losses
# say little about their frequency: an interval would hold the truth in 86 to 92 % of
# studies instead of 95 %.
MIN_LOST = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Contest(Shared):
    """The runs that some methods share, whose indices are `blocks`."""

    runs: Runs

    def of(self, figure: str) -> Array:
        """Return a figure of all shared runs (methods, blocks)."""
        return np.asarray(self.runs.figures[figure][self.blocks])

    @property
    def scores(self) -> Array:
        """The figure (methods, blocks) that orders the methods."""
        return self.of(self.runs.kind.score.name)

    def data(self, name: str, rows: Array | NDArray[np.int64]) -> list[Any]:
        """Return the other data of rows, which are indices of any shape, in order."""
        data = self.runs.data[name]
        return [data[k] for k in map(int, rows.ravel())]

    def rows_of(self, method: int) -> NDArray[np.int64]:
        """Return the indices (k,) of the runs on which a method's figures are averaged.

        They are the shared runs, or all its runs if the method does not take part.
        """
        if method in self.methods:
            return np.asarray(self.blocks[self.methods.index(method)])
        return np.flatnonzero(self.runs.method == method).astype(np.int64)

    def means(self, place: int, values: Array) -> Intervals:
        """Return the mean of each row of values (rows, blocks) of a method's runs.

        Intervals are for other seeds of the same instances. Their ends are nan if the
        method, which is given by its place in `methods`, lost one or two tracks.
        """
        means = block_means(values, self.instance)
        lost = self.runs.lost_tracks(self.blocks[place]) or 0
        if 0 < lost < MIN_LOST:
            means.low[:] = np.nan
            means.high[:] = np.nan
        return means

    @cached_property
    def instances(self) -> tuple[int, ...]:
        """The indices of the shared instances, rising."""
        return tuple(np.unique(self.instance).tolist())

    def place_field(self, name: str) -> Array:
        """Return a field of the plan (blocks,) for each block's instance."""
        values = np.array([place[name] for place in self.runs.places])
        return np.asarray(values[self.instance])

    @property
    def seed_words(self) -> str:
        """The number of seeds of an instance, in words."""
        counts = np.unique(self.instance, return_counts=True)[1]
        least = int(counts.min())
        most = int(counts.max())
        if least < most:
            return f"{least} to {most} seeds each"
        return "one seed" if most == 1 else f"{most} seeds each"

    @cached_property
    def tested_errors(self) -> Array:
        """The errors (methods, blocks, 1) that tests compare."""
        return self.runs.kind.tested_errors(self)

    @cached_property
    def comparisons(self) -> list[PairedTest]:
        """The paired tests of all pairs of methods, given by their places in `methods`.

        There are none without two methods and two blocks.
        """
        if min(self.tested_errors.shape[:2]) < 2:
            return []
        return paired_tests(self.tested_errors)

    def tests_against(self, method: int) -> Iterator[tuple[int, PairedTest]]:
        """Yield each other method that takes part, and its test against one method.

        A difference above 0 means that the other method is worse.
        """
        place = self.methods.index(method)
        for test in self.comparisons:
            if test.second == place:
                yield self.methods[test.first], test
            elif test.first == place:
                yield self.methods[test.second], test.turned


def contest_of(runs: Runs) -> Contest | None:
    """Return the contest of the methods that share enough runs.

    A method does not take part if it would leave less than half of the runs that the
    others share.

    Args:
        runs: All runs of a ledger.

    Returns:
        The contest, or None if no run has an error.
    """
    shared = most_shared(runs.method, runs.instance, runs.seed, runs.scores)
    return None if shared is None else Contest(**vars(shared), runs=runs)
