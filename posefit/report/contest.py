"""The table of a report's runs, the protocol of their kind, and their contest."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import printable
from posefit.report.columns import Column, Score
from posefit.report.stored import Ordered, Store
from posefit.settings import settings_text
from posefit.statistics.paired import PairedTest, paired_tests
from posefit.statistics.pairing import Shared

Place = Mapping[str, Any]  # the fields of a plan that define an instance
Row = Mapping[str, Any]


class Kind(Protocol):
    """A kind of runs, tracks or single searches: its figures, names and texts.

    Attributes:
        name: The kind's name, in the singular.
        noun: Its runs, in the plural.
        title: The title of the page.
        columns: Its figures by name.
        score: The figure that orders the methods.
        named: The fields that an instance's name contains.
        data: What stores a row's other data, by their names.
        baselines: The label of each baseline by name.
    """

    name: str
    noun: str
    title: str
    columns: Mapping[str, Column]
    score: Score
    named: tuple[str, ...]
    data: Mapping[str, Callable[[], Store]]
    baselines: Mapping[str, str]

    def computed(self, row: Row, /) -> dict[str, float]:
        """Return the figures that a row of a ledger does not have itself."""
        ...

    def read(self, row: Row, /) -> tuple[Array, tuple[Any, ...]]:
        """Return the figures of a row and its other data."""
        ...

    def rank(self, place: Place) -> tuple[Any, ...]:
        """Return the key by which instances are sorted."""
        ...

    def place_name(self, place: Place) -> str:
        """Return an instance's name."""
        ...

    def facts(self, runs: "Runs") -> dict[str, Any]:
        """Return the facts about the runs by their titles."""
        ...

    def tested_errors(self, contest: "Contest") -> Array:
        """Return the errors (methods, blocks, 1) for tests. Lower is better."""
        ...

    def board(self, contest: "Contest") -> dict[int, dict[str, Any]]:
        """Return the entries of each method's leaderboard row besides averages."""
        ...

    def baseline_rows(self, contest: "Contest") -> list[dict[str, Any]]:
        """Return the baselines' rows, on the same runs as the methods."""
        ...

    def place_words(self, contest: "Contest") -> str:
        """Return the instances of a contest in words."""
        ...

    def baseline_sentences(self, first: Row, baselines: Sequence[Row]) -> list[str]:
        """Return sentences that compare the best baseline with the first method.

        The rows of both are given.
        """
        ...

    def page(self, runs: "Runs", contest: "Contest | None", /) -> dict[str, Any]:
        """Return the data that only pages of this kind have, with their `sections`."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Runs:
    """All n finished rows of a ledger, sorted by instance, method and seed.

    Names are distinct, and printable on one line. The name, settings, budget, version
    and other choices of a method distinguish methods. All other fields except the seed
    distinguish instances.

    Attributes:
        kind: The kind of the runs.
        version: The versions of posefit that ran them.
        methods: The names of methods, the best mean score first.
        variants: The fields that define each method.
        instances: The names of instances.
        places: The fields that define each instance.
        method: The index (n,) of each row's method.
        instance: The index (n,) of each row's instance.
        seed: The index (n,) of each row's seed.
        seeds: The seeds, rising.
        keys: The first eight characters of each row's key (n,).
        figures: Each figure (n,) by name, nan if a row does not have it.
        data: The other data of each row, by the names of `Kind.data`.
        warnings: The warnings of each row that has some, by its index.
        failures: The name, method, key, reasons and command of each quarantined cell.
    """

    kind: Kind
    version: str
    methods: tuple[str, ...]
    variants: tuple[dict[str, Any], ...]
    instances: tuple[str, ...]
    places: tuple[dict[str, Any], ...]
    method: Array
    instance: Array
    seed: Array
    seeds: tuple[int, ...]
    keys: NDArray[np.bytes_]
    figures: dict[str, Array]
    data: dict[str, Sequence[Any]]
    warnings: Mapping[int, tuple[str, ...]]
    failures: tuple[dict[str, Any], ...]

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def settings(self) -> list[str]:
        """The settings of each method, as a text."""
        return [
            printable(", ".join(settings_text(variant["settings"])))
            for variant in self.variants
        ]

    @cached_property
    def failed(self) -> Counter[str]:
        """The number of quarantined cells by the name of their method."""
        return Counter(failure["method"] for failure in self.failures)

    @property
    def table_figures(self) -> list[str]:
        """The figures in tables. Optional ones are there only if a row has them."""
        names = []
        for name, column in self.kind.columns.items():
            is_missing = column.optional and np.isnan(self.figures[name]).all()
            if column.in_tables and not is_missing:
                names.append(name)
        return names

    @property
    def scores(self) -> Array:
        """The figure (n,) that orders the methods."""
        return self.figures[self.kind.score.name]

    def values(self, field: str) -> list[Any]:
        """Return the distinct values of a field of methods or instances, rising."""
        definitions = (*self.variants, *self.places)
        return sorted({fields[field] for fields in definitions if field in fields})


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

    def data(self, name: str, rows: Array | NDArray[np.int64]) -> Sequence[Any]:
        """Return the other data of rows, which are indices of any shape, in order."""
        return Ordered(self.runs.data[name], rows.ravel().astype(np.int64))

    def rows_of(self, method: int) -> NDArray[np.int64]:
        """Return the indices (k,) of the runs on which a method's figures are averaged.

        They are the shared runs, or all its runs if the method does not take part.
        """
        if method in self.methods:
            return np.asarray(self.blocks[self.methods.index(method)])
        return np.flatnonzero(self.runs.method == method).astype(np.int64)

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
