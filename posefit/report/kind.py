"""What a report knows of runs: their table, what their kind says of it, and the contest of methods that share them."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.report.columns import Column, Score
from posefit.statistics.intervals import MIN_RESAMPLES, RESAMPLES
from posefit.statistics.pairing import Shared
from posefit.statistics.ranks import PairedTest, wilcoxon

BOOTSTRAP_SEED = 2013
WORK = 1e8  # numbers that the resamples of one study may come to

Place = Mapping[str, Any]  # the fields of a plan that make an instance


class Kind(NamedTuple):
    """A kind of runs, tracks or single searches: the figures and words that a report has of them."""

    name: str
    noun: str
    title: str
    columns: Mapping[str, Column]
    named: tuple[str, ...]  # the fields that an instance's name says
    data: tuple[str, ...]  # what a row has besides its figures
    baselines: Mapping[str, str]
    score: Score
    # the figures of a row and its other data, given a table for arrays that many rows have
    read: Callable[[Mapping[str, Any], dict[bytes, Any]], tuple[Array, tuple[Any, ...]]]
    rank: Callable[[Place], tuple[Any, ...]]  # what instances are sorted by
    place_name: Callable[[Place], str]
    # the errors (methods, blocks, 1) that tests compare
    tested_errors: Callable[["Contest"], Array]
    # what each method's row has besides averages
    board: Callable[["Contest"], dict[int, dict[str, Any]]]
    # on the same runs as the methods
    baseline_rows: Callable[["Contest"], list[dict[str, Any]]]
    place_words: Callable[["Contest"], str]  # what a contest was on
    # how the best baseline compares with the leader, given its row and those of the baselines
    baseline_sentences: Callable[[Mapping[str, Any], Sequence[Any]], list[str]]
    facts: Callable[["Runs"], dict[str, Any]]  # what was run


@dataclass(frozen=True, eq=False, repr=False)
class Runs:
    """All rows of a ledger, sorted by instance, method and seed. Names are distinct, and printable on one line.

    Methods differ in name, settings, budget and version, and in what else a method chooses; instances differ in all
    other fields but the seed.
    """

    kind: Kind
    version: str
    methods: tuple[str, ...]  # the lowest mean error first
    variants: tuple[dict[str, Any], ...]  # the fields that make each method
    instances: tuple[str, ...]
    places: tuple[dict[str, Any], ...]  # the fields that make each instance
    method: Array  # (n,) index of each row, as the next two
    instance: Array  # (n,)
    seed: Array  # (n,)
    seeds: tuple[int, ...]  # rising
    keys: tuple[str, ...]
    # name -> (n,), nan where a row has none; a lower `error` is better
    figures: dict[str, Array]
    # what else each row has, by the names of `kind.data`: an array, or a tuple
    data: dict[str, Any]
    warnings: Mapping[int, tuple[str, ...]]  # row -> its warnings, if any
    # quarantined cells: name, method, reasons, command
    failures: tuple[dict[str, Any], ...]
    failed: tuple[int, ...]  # quarantined cells of each method
    unfinished: tuple[str, ...]  # names of methods whose every cell is in quarantine
    heads: tuple[str, ...]  # the beginnings of the commands that run rows again
    head: Array  # (n,)

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def table_figures(self) -> list[str]:
        """The figures that tables show: optional ones only if a row has them."""
        return [
            name
            for name, column in self.kind.columns.items()
            if column.in_tables
            and not (column.optional and np.isnan(self.figures[name]).all())
        ]

    def values(self, field: str) -> list[Any]:
        """Return the values of a field of methods or instances, rising."""
        return sorted(
            {
                fields[field]
                for fields in (*self.variants, *self.places)
                if field in fields
            }
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Contest(Shared):
    """The runs that some methods share, paired by instance and seed: `rows` and `blocks` are indices of `runs`."""

    runs: Runs

    def of(self, figure: str) -> Array:
        """Return a figure of all runs (methods, instances, seeds)."""
        return np.asarray(self.runs.figures[figure][self.rows])

    def rows_of(self, method: int) -> NDArray[np.int64]:
        """Return the rows (k,) of a method that count: those shared, or all its own if it does not take part."""
        if method in self.methods:
            return np.asarray(self.rows[self.methods.index(method)].ravel())
        return np.flatnonzero(self.runs.method == method).astype(np.int64)

    def places(self) -> list[dict[str, Any]]:
        """Return the fields of a plan that make each instance."""
        return [self.runs.places[i] for i in self.instances]

    def tested_errors(self) -> Array:
        """Return the errors (methods, blocks, 1) that tests compare."""
        return self.runs.kind.tested_errors(self)

    @property
    def testable(self) -> bool:
        """Whether there are methods and blocks enough for a paired test."""
        return bool(min(self.tested_errors().shape[:2]) > 1)

    @cached_property
    def comparisons(self) -> list[PairedTest]:
        """The paired tests of all methods, by their places in `methods`; none where too few runs are shared."""
        return wilcoxon(self.tested_errors()) if self.testable else []

    def rng(self) -> np.random.Generator:
        """Return what resamples are drawn by."""
        return np.random.default_rng(BOOTSTRAP_SEED)

    def resamples(self, numbers: int) -> int:
        """Return how many bootstrap resamples so many numbers may have."""
        return int(np.clip(WORK / max(numbers, 1), MIN_RESAMPLES, RESAMPLES))

    def fewer(self, points: int) -> Self:
        """Return the contest on so few seeds and instances that intervals at so many points are little work.

        These are the first seeds, and every second, third, ... instance.
        """
        # runs of a method
        most = int(WORK / (MIN_RESAMPLES * max(points, 1) * len(self.methods)))
        _, instances, seeds = self.rows.shape
        seeds = min(seeds, max(2, most // instances))
        step = -(-instances * seeds // most)
        return replace(
            self, instances=self.instances[::step], rows=self.rows[:, ::step, :seeds]
        )
