"""The runs of a sweep, their kind, and the contest of the methods that share some.

`Runs` are all runs of a ledger. Their `Kind`, tracks or single searches, knows what
differs between these two. A `Contest` has the runs that the methods share.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
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
from posefit.statistics.means import Intervals, block_means
from posefit.statistics.paired import PairedTest, paired_tests
from posefit.statistics.pairing import Shared, most_shared

# A method that lost some tracks, but fewer than these, has no interval. So few losses
# say little about their frequency: an interval would contain the truth in 86 to 92 % of
# studies instead of 95 %.
MIN_LOST = 3

InstanceFields = Mapping[str, Any]  # the fields of a plan that define an instance
Row = Mapping[str, Any]  # a row of a ledger
Indices = Array | NDArray[np.int64]  # indices of rows


@dataclass(frozen=True)
class Baseline:
    """A baseline, on the same runs as the methods.

    Attributes:
        name: Its name in rows.
        title: Its name on the page.
        figures: Its figures by name, None if unknown.
    """

    name: str
    title: str
    figures: Mapping[str, float | None]

    def as_dict(self) -> dict[str, Any]:
        """Return everything by name."""
        return {"baseline": self.name, "title": self.title, **self.figures}


class Kind(Protocol):
    """A kind of runs: `posefit.report.tracks.Tracks` or `.searches.Searches`.

    Attributes:
        name: The kind's name, in the singular.
        noun: Its runs, in the plural.
        title: The title of the page.
        columns: Its figures by name.
        score: The figure that orders the methods.
        data: What stores a row's other data, by their names.
    """

    name: str
    noun: str
    title: str
    columns: Mapping[str, Column]
    score: Score
    data: Mapping[str, Callable[[], Store]]

    def computed(self, row: Row, /) -> dict[str, float]:
        """Return the figures that a row of a ledger does not have itself."""
        ...

    def read(self, row: Row, /) -> tuple[Array, dict[str, Any]]:
        """Return the figures of a row, and its other data by the names of `data`."""
        ...

    def instance_order(self, fields: InstanceFields) -> tuple[Any, ...]:
        """Return the key by which instances are sorted."""
        ...

    def instance_name(self, fields: InstanceFields) -> str:
        """Return an instance's name."""
        ...

    def facts(self, runs: "Runs") -> dict[str, Any]:
        """Return the facts about the runs by their titles."""
        ...

    def tested_errors(self, contest: "Contest") -> Array:
        """Return the errors (methods, blocks, 1) for tests. Lower is better."""
        ...

    def figures(self, runs: "Runs", rows: Indices) -> dict[str, float | None]:
        """Return the average of each figure over some rows, given by their indices."""
        ...

    def interval(self, contest: "Contest", index: int) -> tuple[float, float]:
        """Return the ends of the 95 % interval of a method's score, nan if unknown.

        The method is given by its index among those that take part.
        """
        ...

    def baselines(self, contest: "Contest") -> list[Baseline]:
        """Return the baselines, on the same runs as the methods."""
        ...

    def instance_words(self, contest: "Contest") -> str:
        """Return what the instances of a contest are, in words."""
        ...

    def baseline_sentences(
        self, contest: "Contest", first: int, baselines: Sequence[Baseline]
    ) -> Sequence[str]:
        """Return sentences that compare the best baseline with the first method."""
        ...

    def page(self, runs: "Runs", contest: "Contest | None", /) -> dict[str, Any]:
        """Return the data that only pages of this kind have, with their `sections`."""
        ...


@dataclass(frozen=True)
class Failure:
    """A quarantined cell.

    Attributes:
        name: Its method, instance and seed.
        method: The name of its method.
        key: The first digits of its key.
        reasons: Why its attempts failed.
        command: A command that runs it again.
    """

    name: str
    method: str
    key: str
    reasons: tuple[str, ...]
    command: str


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
        instance_fields: The fields that define each instance.
        method: The index (n,) of each row's method.
        instance: The index (n,) of each row's instance.
        seed: The index (n,) of each row's seed.
        seeds: The seeds, in ascending order.
        keys: The first eight characters of each row's key (n,).
        figures: Each figure (n,) by name, nan if a row does not have it.
        data: The other data of each row, by the names of `Kind.data`.
        warnings: The warnings of each row that has some, by its index.
        failures: The quarantined cells.
        chosen: The JSON texts of the fields that define each method of the report, even
            if all its cells failed.
    """

    kind: Kind
    version: str
    methods: tuple[str, ...]
    variants: tuple[dict[str, Any], ...]
    instances: tuple[str, ...]
    instance_fields: tuple[dict[str, Any], ...]
    method: Array
    instance: Array
    seed: Array
    seeds: tuple[int, ...]
    keys: NDArray[np.bytes_]
    figures: dict[str, Array]
    data: Mapping[str, Sequence[Any]]
    warnings: Mapping[int, tuple[str, ...]]
    failures: tuple[Failure, ...]
    chosen: frozenset[str]

    def __len__(self) -> int:
        return len(self.keys)

    @cached_property
    def settings(self) -> list[str]:
        """The settings of each method, as a text."""
        return [
            printable(", ".join(settings_text(variant["settings"])))
            for variant in self.variants
        ]

    @cached_property
    def failed(self) -> Counter[str]:
        """The number of quarantined cells by the name of their method."""
        return Counter(failure.method for failure in self.failures)

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

    def averages(self, rows: Indices) -> dict[str, float | None]:
        """Return the average of each figure over some rows, given by their indices."""
        averages = {}
        for name, column in self.kind.columns.items():
            averages[name] = column.average(self.figures[name][rows])
        return averages

    def lost_tracks(self, rows: Indices) -> int | None:
        """Return how many of some rows lost frames; None if nothing can be lost."""
        if "lost_rate" not in self.figures:
            return None
        return int((self.figures["lost_rate"][rows] > 0.0).sum())

    def values(self, field: str) -> list[Any]:
        """Return the distinct values of a field of methods or instances, sorted."""
        definitions = (*self.variants, *self.instance_fields)
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

    def data(self, name: str, rows: Indices) -> Sequence[Any]:
        """Return the other data of rows, which are indices of any shape, in order."""
        return Ordered(self.runs.data[name], rows.ravel().astype(np.int64))

    def rows_of(self, method: int) -> NDArray[np.int64]:
        """Return the indices (k,) of the runs on which a method's figures are averaged.

        They are the shared runs, or all its runs if the method does not take part.
        """
        if method in self.methods:
            return np.asarray(self.blocks[self.methods.index(method)])
        return np.flatnonzero(self.runs.method == method).astype(np.int64)

    def means(self, index: int, values: Array) -> Intervals:
        """Return the mean of each row of values (rows, blocks) of a method's runs.

        Intervals are for other seeds of the same instances. Their ends are nan if the
        method, which is given by its index in `methods`, lost one or two tracks.
        """
        means = block_means(values, self.instance)
        lost = self.runs.lost_tracks(self.blocks[index]) or 0
        if 0 < lost < MIN_LOST:
            means.low[:] = np.nan
            means.high[:] = np.nan
        return means

    @cached_property
    def instances(self) -> tuple[int, ...]:
        """The indices of the shared instances, in ascending order."""
        return tuple(np.unique(self.instance).tolist())

    def instance_field(self, name: str) -> Array:
        """Return a field of the plan (blocks,) for each block's instance."""
        values = np.array([fields[name] for fields in self.runs.instance_fields])
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
        """The paired tests of all pairs of methods, by their indices in `methods`.

        There are none without two methods and two blocks.
        """
        if min(self.tested_errors.shape[:2]) < 2:
            return []
        return paired_tests(self.tested_errors)

    def tests_against(self, method: int) -> Iterator[tuple[int, PairedTest]]:
        """Yield each other method that takes part, and its test against one method.

        A difference above 0 means that the other method is worse.
        """
        index = self.methods.index(method)
        for test in self.comparisons:
            if test.second == index:
                yield self.methods[test.first], test
            elif test.first == index:
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
