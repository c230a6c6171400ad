"""The finished runs of a ledger as arrays."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import printable
from posefit.report.kind import Indices, Kind
from posefit.settings import settings_text


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
        places: The fields that define each instance.
        method: The index (n,) of each row's method.
        instance: The index (n,) of each row's instance.
        seed: The index (n,) of each row's seed.
        seeds: The seeds, rising.
        keys: The key of each row.
        figures: Each figure (n,) by name, nan if a row does not have it.
        data: The other data of each row by name, see `Kind.read`.
        warnings: The warnings of each row that has some, by its index.
        failures: The quarantined cells.
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
    keys: tuple[str, ...]
    figures: dict[str, Array]
    data: Mapping[str, Sequence[Any]]
    warnings: Mapping[int, tuple[str, ...]]
    failures: tuple[Failure, ...]

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
        """Return the distinct values of a field of methods or instances, rising."""
        definitions = (*self.variants, *self.places)
        return sorted({fields[field] for fields in definitions if field in fields})
