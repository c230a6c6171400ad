"""What a report knows of runs: their table, what their kind says of it, and the contest of methods that share them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.report.columns import Column, Score
from posefit.statistics.paired import PairedTest, paired_tests
from posefit.statistics.pairing import Shared

Place = Mapping[str, Any]  # the fields of a plan that make an instance
Row = Mapping[str, Any]


class Kind(Protocol):
    """A kind of runs, tracks or single searches: the figures, names and words that a report has of them."""

    name: str
    noun: str
    title: str
    columns: Mapping[str, Column]
    score: Score
    named: tuple[str, ...]  # the fields that an instance's name says
    data: tuple[str, ...]  # what a row has besides its figures
    baselines: Mapping[str, str]

    def read(
        self, row: Row, shared: dict[bytes, Any], /
    ) -> tuple[Array, tuple[Any, ...]]:
        """Return the figures of a row and its other data, given a table for arrays that many rows have."""
        ...

    def rank(self, place: Place) -> tuple[Any, ...]:
        """Return what instances are sorted by."""
        ...

    def place_name(self, place: Place) -> str:
        """Return an instance's name."""
        ...

    def facts(self, runs: "Runs") -> dict[str, Any]:
        """Return what was run."""
        ...

    def tested_errors(self, contest: "Contest") -> Array:
        """Return the errors (methods, blocks, 1) that tests compare; lower is better."""
        ...

    def board(self, contest: "Contest") -> dict[int, dict[str, Any]]:
        """Return what each method's row has besides averages."""
        ...

    def baseline_rows(self, contest: "Contest") -> list[dict[str, Any]]:
        """Return the baselines' rows, on the same runs as the methods."""
        ...

    def place_words(self, contest: "Contest") -> str:
        """Return what a contest was on."""
        ...

    def baseline_sentences(self, first: Row, baselines: Sequence[Row]) -> list[str]:
        """Return how the best baseline compares with the first method, given their rows."""
        ...

    def page(self, runs: "Runs", contest: "Contest | None", /) -> dict[str, Any]:
        """Return what the page has of this kind alone, and its list of `sections`."""
        ...


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
    # name -> (n,), nan where a row has none
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

    @property
    def scores(self) -> Array:
        """The figure (n,) that methods are ordered by."""
        return self.figures[self.kind.score.name]

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
    """The runs that some methods share: `blocks` are indices of `runs`, a row a method."""

    runs: Runs

    def of(self, figure: str) -> Array:
        """Return a figure of all shared runs (methods, blocks)."""
        return np.asarray(self.runs.figures[figure][self.blocks])

    @property
    def scores(self) -> Array:
        """The figure (methods, blocks) that methods are ordered by."""
        return self.of(self.runs.kind.score.name)

    def rows_of(self, method: int) -> NDArray[np.int64]:
        """Return the rows (k,) of a method that count: those shared, or all its own if it does not take part."""
        if method in self.methods:
            return np.asarray(self.blocks[self.methods.index(method)])
        return np.flatnonzero(self.runs.method == method).astype(np.int64)

    @cached_property
    def instances(self) -> tuple[int, ...]:
        """The instances that are shared, rising."""
        return tuple(np.unique(self.instance).tolist())

    def place_field(self, name: str) -> Array:
        """Return a field of the plan (blocks,) for each block's instance."""
        values = np.array([place[name] for place in self.runs.places])
        return np.asarray(values[self.instance])

    @property
    def seed_words(self) -> str:
        """How many seeds the instances have."""
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
        """The paired tests of all methods, by their places in `methods`; none without two methods and two blocks."""
        if min(self.tested_errors.shape[:2]) < 2:
            return []
        return paired_tests(self.tested_errors)
