"""Reads the finished rows of a ledger into arrays, with room for a million rows."""

from array import array
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError, printable
from posefit.reading import quoted, suggestion
from posefit.report.columns import listed
from posefit.report.contest import Failure, Kind, Row, Runs
from posefit.report.names import distinct
from posefit.report.searches import SEARCHES
from posefit.report.stored import Ordered, Store
from posefit.report.tracks import TRACKS
from posefit.settings import setting_text
from posefit.sweep.cell import cell_from, json_of
from posefit.sweep.repeat import repeat_command
from posefit.sweep.versions import other_version

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from posefit.sweep.ledger import Ledger

KINDS: dict[str, Kind] = {kind.name: kind for kind in (TRACKS, SEARCHES)}
KEY_LENGTH = 8  # characters of a key that distinguish runs on a page
# the fields that define a method; all others except the seed define an instance
METHOD_FIELDS = (
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
        key = json_of(value)
        if key not in self._numbers:
            self._numbers[key] = len(self.values)
            self.values.append(value)
        return self._numbers[key]


class _Ranked(NamedTuple):
    """Distinct numbers in an order, and for each value (n,) its rank among them."""

    numbers: list[int]
    ranks: Array


class _Rows:
    """The rows of a ledger, all of one kind, in its order.

    The values of finished rows are in arrays, because objects for a million rows would
    fill the memory.
    """

    def __init__(self, kind: Kind) -> None:
        self.kind = kind
        self.methods = _Distinct()  # the fields that define each method
        self.instances = _Distinct()  # the fields that define each instance
        self.seeds: dict[int, int] = {}  # each seed, of any size, with its number
        # each quarantined cell with the number of its method
        self.quarantined: list[tuple[int, Row]] = []
        # of each finished row: the numbers of its method, instance and seed
        self.method = array("q")
        self.instance = array("q")
        self.seed = array("q")
        self.keys = bytearray()  # eight characters each
        self.warnings: dict[int, tuple[str, ...]] = {}  # by the row's index
        self.figures = {name: array("d") for name in kind.columns}
        self.data: dict[str, Store] = {}
        for name, store in kind.data.items():
            self.data[name] = store()

    def add(self, row: Row) -> None:
        """Add a row, finished or quarantined."""
        spec = row["spec"]
        method = self.methods.number(_variant(spec))
        if row["status"] != "done":
            self.quarantined.append((method, row))
            return
        figures, data = self.kind.read(row)
        if warnings := tuple(map(printable, row["warnings"])):
            self.warnings[len(self.method)] = warnings
        for column, figure in zip(self.figures.values(), figures.tolist(), strict=True):
            column.append(figure)
        for name, store in self.data.items():
            store.append(data[name])
        self.method.append(method)
        self.instance.append(self.instances.number(_instance_fields(spec)))
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
    rows = _read(ledger)
    kind = rows.kind
    label_of = _labels(rows, latest)
    chosen = _named(methods, label_of, rows) if methods else list(label_of)
    variants = rows.methods.values
    seeds = list(rows.seeds)

    def instance_key(number: int) -> tuple[Any, ...]:
        fields = rows.instances.values[number]
        return kind.instance_order(fields), json_of(fields)

    # the rows of these methods, sorted by instance, method and seed
    method_of_row = np.array(rows.method, dtype=np.int64)
    numbers = np.flatnonzero(np.isin(method_of_row, chosen))
    method = _ranked(method_of_row[numbers], chosen.index)
    instance = _ranked(np.array(rows.instance)[numbers], instance_key)
    seed = _ranked(np.array(rows.seed)[numbers], seeds.__getitem__)
    order = np.lexsort((seed.ranks, method.ranks, instance.ranks))
    numbers = numbers[order]

    figures = {}
    for name in kind.columns:
        # one at a time, because two copies of all take much memory
        figures[name] = np.array(rows.figures.pop(name), dtype=np.float64)[numbers]
    data = {}
    for name, store in rows.data.items():
        data[name] = Ordered(store, numbers)
    warnings = {}
    if rows.warnings:
        for k, number in enumerate(numbers.tolist()):
            if number in rows.warnings:
                warnings[k] = rows.warnings[number]
    failures = []
    for m, cell in rows.quarantined:
        if m in chosen:
            failures.append(_failure(cell, label_of[m]))
    instance_fields = [rows.instances.values[number] for number in instance.numbers]
    return Runs(
        kind=kind,
        version=ledger.version,
        methods=tuple(label_of[m] for m in method.numbers),
        variants=tuple(variants[m] for m in method.numbers),
        instances=_instance_names(kind, instance_fields),
        instance_fields=tuple(instance_fields),
        method=method.ranks[order],
        instance=instance.ranks[order],
        seed=seed.ranks[order],
        seeds=tuple(seeds[k] for k in seed.numbers),
        keys=np.frombuffer(rows.keys, f"S{KEY_LENGTH}")[numbers],
        figures=figures,
        data=data,
        warnings=warnings,
        failures=tuple(failures),
        chosen=frozenset(json_of(variants[m]) for m in chosen),
    )


def is_of(runs: Runs, spec: Mapping[str, Any]) -> bool:
    """Return whether a cell's method is one of a report's."""
    return json_of(_variant(spec)) in runs.chosen


def _ranked(values: "NDArray[np.int64]", key: Callable[[int], Any]) -> _Ranked:
    """Return the distinct ones of some numbers (n,) in the order of a key."""
    distinct_values, number = np.unique(values, return_inverse=True)
    ordered = sorted(distinct_values.tolist(), key=key)
    rank = np.empty(len(ordered), dtype=np.int64)
    rank[np.searchsorted(distinct_values, ordered)] = np.arange(len(ordered))
    return _Ranked(ordered, np.asarray(rank[number]))


def _read(ledger: "Ledger") -> _Rows:
    """Return the rows of a ledger.

    Raises InputError if it has no row, finished or quarantined, or has both tracks and
    searches.
    """
    rows: _Rows | None = None
    for row in ledger.all_rows():
        kind = KINDS[row["spec"]["kind"]]
        if rows is None:
            rows = _Rows(kind)
        if kind is not rows.kind:
            raise InputError(
                f"{ledger.path}: expected a ledger of either tracks or single "
                "searches, got both"
            )
        try:
            rows.add(row)
        # raised if a value is missing or has another type
        except (ValueError, TypeError, LookupError, AttributeError) as error:
            raise ledger.damaged_row(row["key"], error) from None
    if rows is None:
        raise InputError(
            f"{ledger.path}: expected a ledger with finished rows, got none"
        )
    return rows


def _labels(rows: _Rows, latest: bool) -> dict[int, str]:
    """Return the distinct names of methods by their numbers, the best first.

    Methods that only failed are last.
    """
    variants = rows.methods.values
    score = rows.kind.score
    scores = np.array(rows.figures[score.name], dtype=np.float64)
    badness = np.nan_to_num(score.badness(scores), nan=np.inf)
    method = np.array(rows.method, dtype=np.int64)

    def order(m: int) -> tuple[bool, float, str]:
        """Return a key that is lower for better methods."""
        of_method = badness[method == m]
        mean = float(of_method.mean()) if len(of_method) else 0.0
        return not len(of_method), mean, json_of(variants[m])

    best_first = sorted(
        _latest(variants) if latest else range(len(variants)), key=order
    )
    names = distinct(
        [_planned_name(variants[m]) for m in best_first],
        [_variation(variants[m]) for m in best_first],
    )
    return dict(zip(best_first, names, strict=True))


def _instance_names(kind: Kind, instances: Sequence[dict[str, Any]]) -> tuple[str, ...]:
    """Return the distinct names of instances, which are given by their fields."""
    details = []
    for fields in instances:
        texts = {}
        for name, value in fields.items():
            texts[name] = value if isinstance(value, str) else json_of(value)
        details.append(texts)
    return distinct([kind.instance_name(fields) for fields in instances], details)


def _latest(variants: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return one version of each method, by their indices.

    It is the installed version, or else the one planned last.
    """
    best: dict[str, tuple[bool, int]] = {}
    for m, variant in enumerate(variants):
        versions = variant["version"].split(", ")
        installed = not any(map(other_version, versions))
        key = json_of({**variant, "version": ""})
        best[key] = max(best.get(key, (False, -1)), (installed, m))
    return sorted(m for _, m in best.values())


def _named(names: Sequence[str], label_of: Mapping[int, str], rows: _Rows) -> list[int]:
    """Return the methods with the given names, in the order of their labels.

    Raises InputError if no method has one of the names.
    """
    names_of = {}
    for m, label in label_of.items():
        names_of[m] = {label, _planned_name(rows.methods.values[m])}
    known = set().union(*names_of.values())
    for name in names:
        if name not in known:
            raise InputError(
                f"--methods must name some of {listed(sorted(label_of.values()), 12)}, "
                f"got {quoted(name)}{suggestion(name, known)}"
            )
    return [m for m in label_of if names_of[m] & set(names)]


def _planned_name(variant: Mapping[str, Any]) -> str:
    """Return a method's name in the plan."""
    return str(variant["name"] or variant["method"])


def _failure(cell: Mapping[str, Any], name: str) -> Failure:
    """Return a quarantined cell of a method with this name."""
    return Failure(
        name=printable(str(cell_from({**cell["spec"], "name": name}))),
        method=name,
        key=cell["key"][:KEY_LENGTH],
        reasons=tuple(map(printable, dict.fromkeys(cell["reasons"]))),
        command=repeat_command(cell["spec"]),
    )


def _variant(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that define a method.

    Searches have a budget per dimension instead of their evaluations.
    """
    fields = {name: spec[name] for name in METHOD_FIELDS if name in spec}
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


def _instance_fields(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that define an instance."""
    fields = {}
    for name, value in spec.items():
        if name not in (*METHOD_FIELDS, "kind", "seed"):
            fields[name] = value
    return fields
