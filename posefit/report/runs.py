"""Reads the finished rows of a ledger into a table, which holds a hundred thousand."""

import json
from array import array
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.errors import InputError, printable
from posefit.reading import quoted, suggestion
from posefit.report.columns import listed
from posefit.report.contest import Kind, Runs
from posefit.report.repeat import repeat_command
from posefit.report.searches import SEARCHES
from posefit.report.stored import Ordered, Store
from posefit.report.tracks import TRACKS
from posefit.settings import setting_text
from posefit.sweep.cell import cell_from, other_version

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from posefit.arrays import Array
    from posefit.sweep.ledger import Ledger

KINDS: dict[str, Kind] = {kind.name: kind for kind in (TRACKS, SEARCHES)}
KEY_LENGTH = 8  # characters of a key that distinguish runs on a page
# the fields that define a method; all others except the seed define an instance
_METHOD_FIELDS = (
    "method",
    "name",
    "settings",
    "evaluations",
    "hypotheses",
    "infeasible",
    "version",
)


class _Distinct:
    """Distinct values, numbered in the order in which they are added."""

    def __init__(self) -> None:
        self.values: list[dict[str, Any]] = []
        self._numbers: dict[str, int] = {}

    def number(self, value: dict[str, Any]) -> int:
        """Return the number of a value, and add it if it is new."""
        key = _text(value)
        if key not in self._numbers:
            self._numbers[key] = len(self.values)
            self.values.append(value)
        return self._numbers[key]


class _Rows:
    """The rows of a ledger in its order, with numbered methods and instances.

    Raises InputError if the ledger has no row, finished or quarantined, or has both
    tracks and searches.
    """

    def __init__(self, ledger: "Ledger") -> None:
        self.methods = _Distinct()
        self.places = _Distinct()
        # of each finished row; arrays, because there may be a million
        self.method = array("q")
        self.place = array("q")
        self.seed = array("q")  # its place in `seeds`
        self.keys = bytearray()  # eight characters each
        self.figures: dict[str, array[float]] = {}
        self.data: dict[str, Store] = {}
        self.seeds: dict[int, int] = {}  # in their order, of any size
        self.warnings: dict[int, tuple[str, ...]] = {}  # by the row's index
        self.quarantined = ledger.quarantined()
        kinds = set[str]()
        for row in chain(ledger.rows(), self.quarantined):
            kinds.add(row["spec"]["kind"])
            if not self.figures:
                kind = KINDS[row["spec"]["kind"]]
                self.figures = {name: array("d") for name in kind.columns}
                self.data = {name: store() for name, store in kind.data.items()}
            if len(kinds) > 1:
                raise InputError(
                    f"{ledger.path}: expected a ledger of either tracks or single "
                    "searches, got both"
                )
            if row["status"] == "done":
                try:
                    self._add(row)
                # raised if a figure is missing or has another type
                except (ValueError, TypeError, LookupError, AttributeError) as error:
                    raise ledger.damaged_row(row["key"], error) from None
        if not kinds:
            raise InputError(
                f"{ledger.path}: expected a ledger with finished rows, got none"
            )
        self.kind = KINDS[kinds.pop()]
        # methods that only failed have the numbers from here on
        self.finished_methods = len(self.methods.values)
        self.failed_method = [
            self.methods.number(_variant(cell["spec"])) for cell in self.quarantined
        ]

    def _add(self, row: Mapping[str, Any]) -> None:
        spec = row["spec"]
        figures, data = KINDS[spec["kind"]].read(row)
        warnings = tuple(map(printable, row["warnings"]))
        if warnings:
            self.warnings[len(self.method)] = warnings
        for column, figure in zip(self.figures.values(), figures.tolist(), strict=True):
            column.append(figure)
        for stored, value in zip(self.data.values(), data, strict=True):
            stored.append(value)
        self.method.append(self.methods.number(_variant(spec)))
        self.place.append(self.places.number(_place(spec)))
        seed = int(spec["seed"])
        self.seed.append(self.seeds.setdefault(seed, len(self.seeds)))
        key = row["key"].encode("ascii", "replace")
        self.keys += key[:KEY_LENGTH].ljust(KEY_LENGTH, b"\0")


def runs_of(
    ledger: "Ledger", methods: Sequence[str] = (), *, latest: bool = False
) -> Runs:
    """Return the finished rows of a ledger.

    Their order does not depend on which of them finished first.

    Args:
        ledger: An open ledger, of tracks or of single searches.
        methods: The methods whose runs are returned, by their names in the report or in
            the plan. All if empty.
        latest: Whether to return only one version of each method: the installed
            version, or else the one planned last.

    Returns:
        The runs, and the failures. If every cell failed, there are no runs.

    Raises:
        ValueError: The ledger has neither a row nor a failure, or both tracks and
            single searches, or no method has one of the names.
    """
    rows = _Rows(ledger)
    kind = rows.kind
    score = np.array(rows.figures[kind.score.name], dtype=np.float64)
    label_of = _labels(rows, score, latest)
    chosen = _named(methods, label_of, rows) if methods else list(label_of)
    finished = [m for m in chosen if m < rows.finished_methods]

    # the rows of these methods, sorted by instance, method and seed
    method_of_row = np.array(rows.method, dtype=np.int64)
    numbers = np.flatnonzero(np.isin(method_of_row, finished))
    place_of_row = np.array(rows.place, dtype=np.int64)[numbers]
    seed_of_row = np.array(rows.seed, dtype=np.int64)[numbers]
    places = rows.places.values
    place_order = sorted(
        np.unique(place_of_row).tolist(),
        key=lambda i: (kind.rank(places[i]), _text(places[i])),
    )
    all_seeds = list(rows.seeds)
    seed_order = sorted(np.unique(seed_of_row).tolist(), key=all_seeds.__getitem__)
    instance = _ranks(place_of_row, place_order)
    method = _ranks(method_of_row[numbers], finished)
    seed = _ranks(seed_of_row, seed_order)
    order = np.lexsort((seed, method, instance))
    numbers = numbers[order]

    figures = {}
    for name in list(rows.figures):
        # one at a time, because two copies of all take much memory
        figures[name] = np.array(rows.figures.pop(name), dtype=np.float64)[numbers]
    warnings = {}
    if rows.warnings:
        for place, k in enumerate(numbers.tolist()):
            if k in rows.warnings:
                warnings[place] = rows.warnings[k]
    failures = []
    for cell, m in zip(rows.quarantined, rows.failed_method, strict=True):
        if m in chosen:
            failures.append(_failure(cell, label_of[m]))
    return Runs(
        kind=kind,
        version=ledger.version,
        methods=tuple(label_of[m] for m in finished),
        variants=tuple(rows.methods.values[m] for m in finished),
        instances=_instance_names(kind, [places[i] for i in place_order]),
        places=tuple(places[i] for i in place_order),
        method=method[order],
        instance=instance[order],
        seed=seed[order],
        seeds=tuple(all_seeds[k] for k in seed_order),
        keys=np.frombuffer(rows.keys, f"S{KEY_LENGTH}")[numbers],
        figures=figures,
        data={name: Ordered(store, numbers) for name, store in rows.data.items()},
        warnings=warnings,
        failures=tuple(failures),
    )


def _ranks(values: "NDArray[np.int64]", order: Sequence[int]) -> "Array":
    """Return the places of values (n,) in an order of all that occur."""
    rank = np.zeros(max(order, default=-1) + 1, dtype=np.int64)
    rank[order] = np.arange(len(order))
    return np.asarray(rank[values])


def _labels(rows: _Rows, score: "Array", latest: bool) -> dict[int, str]:
    """Return the distinct names of methods by their numbers, the best first.

    Methods that only failed are last.
    """
    variants = rows.methods.values
    method = np.array(rows.method)
    badness = np.nan_to_num(-score if rows.kind.score.down else score, nan=np.inf)
    means = [badness[method == m].mean() for m in range(rows.finished_methods)]
    means += [np.inf] * (len(variants) - len(means))
    best_first = sorted(
        _latest(variants) if latest else range(len(variants)),
        key=lambda m: (m >= rows.finished_methods, means[m], _text(variants[m])),
    )
    names = distinct(
        [_planned_name(variants[m]) for m in best_first],
        [_variation(variants[m]) for m in best_first],
    )
    return dict(zip(best_first, names, strict=True))


def _instance_names(kind: Kind, places: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the distinct names of instances."""
    details = []
    for place in places:
        unnamed = {}
        for name, value in place.items():
            if name not in kind.named:
                unnamed[name] = _text(value).strip('"')
        details.append(unnamed)
    return distinct([kind.place_name(place) for place in places], details)


def _latest(variants: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return one version of each method, by their indices.

    It is the installed version, or else the one planned last.
    """
    best: dict[str, tuple[bool, int]] = {}
    for m, variant in enumerate(variants):
        versions = variant["version"].split(", ")
        installed = not any(map(other_version, versions))
        other_fields = {**variant, "version": ""}
        key = _text(other_fields)
        best[key] = max(best.get(key, (False, -1)), (installed, m))
    return sorted(m for _, m in best.values())


def _named(names: Sequence[str], label_of: Mapping[int, str], rows: _Rows) -> list[int]:
    """Return the methods with the given names, in the order of their labels.

    Raises InputError if no method has one of the names.
    """
    variants = rows.methods.values
    names_of = {m: {label, _planned_name(variants[m])} for m, label in label_of.items()}
    known = set().union(*names_of.values())
    for name in names:
        if name not in known:
            raise InputError(
                f"--methods must be of {listed(sorted(label_of.values()), 12)}, "
                f"got {quoted(name)}{suggestion(name, known)}"
            )
    return [m for m in label_of if names_of[m] & set(names)]


def _planned_name(variant: Mapping[str, Any]) -> str:
    """Return a method's name in the plan."""
    return str(variant["name"] or variant["method"])


def _failure(cell: Mapping[str, Any], name: str) -> dict[str, Any]:
    """Return the page's data of a quarantined cell of a method with this name."""
    return {
        "name": printable(str(cell_from({**cell["spec"], "name": name}))),
        "method": name,
        "key": cell["key"][:8],
        "reasons": [*map(printable, dict.fromkeys(cell["reasons"]))],
        "command": repeat_command(cell["spec"]),
    }


def _variant(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that define a method.

    Searches have a budget per dimension instead of their evaluations.
    """
    fields = {name: spec[name] for name in _METHOD_FIELDS if name in spec}
    fields["settings"] = dict(sorted(spec["settings"].items()))
    if "dimension" in spec:
        fields["budget"] = fields.pop("evaluations") / spec["dimension"]
    return fields


def _variation(variant: Mapping[str, Any]) -> dict[str, str]:
    """Return the texts that may distinguish a method from others of the same name."""
    texts = {name: setting_text(value) for name, value in variant["settings"].items()}
    for name in ("method", "evaluations", "budget", "hypotheses", "infeasible"):
        if name in variant:
            value = variant[name]
            texts[name] = value if isinstance(value, str) else f"{value:.12g}"
    for part in variant["version"].split(", "):
        name, _, version = part.partition(" ")
        texts[name] = version
    return texts


def _place(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that define an instance."""
    fields = {}
    for name, value in spec.items():
        if name not in (*_METHOD_FIELDS, "kind", "seed"):
            fields[name] = value
    return fields


def distinct(
    names: Sequence[str], details: Iterable[Mapping[str, str]]
) -> tuple[str, ...]:
    """Return distinct names.

    If a name occurs several times, the details that differ follow in brackets:
    `sapso@pca (cooling 0.9)`. The setting `sapso.cooling` is shortened to `cooling` if
    no other differing setting has that name. If no detail differs, a number is added.

    Args:
        names: The names.
        details: The details of each by their names.

    Returns:
        The distinct names in the same order.
    """
    details = list(details)
    by_name: dict[str, list[Mapping[str, str]]] = {}
    for name, values in zip(names, details, strict=True):
        by_name.setdefault(name, []).append(values)
    differing = {name: _differing(several) for name, several in by_name.items()}
    longer: dict[str, None] = {}  # an ordered set
    for name, values in zip(names, details, strict=True):
        words = []
        for field, short in differing[name].items():
            if field in values:
                words.append(f"{short} {values[field]}")
        text = name
        if words:
            text = f"{name} ({', '.join(words)})"
        plain = printable(text)
        unique = plain
        number = 1
        while unique in longer:
            number += 1
            unique = f"{plain} ({number})"
        longer[unique] = None
    return tuple(longer)


def _differing(several: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Return the fields whose values differ between the mappings, with short names."""
    fields: dict[str, None] = {}  # an ordered set
    # the mapping with the most fields decides their order
    for values in sorted(several, key=len, reverse=True):
        fields |= dict.fromkeys(values)
    differing = []
    for field in fields:
        if len({values.get(field) for values in several}) > 1:
            differing.append(field)
    short_names = [field.rpartition(".")[2] for field in differing]
    names = {}
    for field, short in zip(differing, short_names, strict=True):
        is_unique = short_names.count(short) == 1
        names[field] = short if is_unique else field
    return names


def _text(value: Any) -> str:
    """Return the JSON text of a value. Those of 1, 1.0 and true differ."""
    return json.dumps(value, sort_keys=True)
