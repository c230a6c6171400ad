"""Reads the finished rows of a ledger into arrays, which hold a hundred thousand."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError, printable
from posefit.reading import quoted, suggestion
from posefit.report.columns import listed
from posefit.report.contest import Failure, Kind, Runs
from posefit.report.names import distinct
from posefit.report.searches import SEARCHES
from posefit.report.tracks import TRACKS
from posefit.settings import setting_text
from posefit.sweep.cell import cell_from, json_of, other_version
from posefit.sweep.repeat import repeat_command

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

KINDS: dict[str, Kind] = {kind.name: kind for kind in (TRACKS, SEARCHES)}
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


class _Run(NamedTuple):
    """A finished row, with the numbers of its instance and method."""

    place: int
    method: int
    seed: int  # of any size
    key: str
    warnings: tuple[str, ...]
    figures: Array
    data: Mapping[str, Any]


class _Rows(NamedTuple):
    """The rows of a ledger in its order."""

    kind: Kind
    variants: list[dict[str, Any]]  # the fields that define each method
    places: list[dict[str, Any]]  # the fields that define each instance
    runs: list[_Run]
    # each quarantined cell with the number of its method
    quarantined: list[tuple[int, Mapping[str, Any]]]

    @property
    def finished(self) -> set[int]:
        """The numbers of the methods with a finished row."""
        return {run.method for run in self.runs}


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
    finished = rows.finished
    method_of = {m: k for k, m in enumerate(m for m in chosen if m in finished)}
    runs = [run for run in rows.runs if run.method in method_of]
    numbers = sorted(
        {run.place for run in runs},
        key=lambda i: (kind.rank(rows.places[i]), json_of(rows.places[i])),
    )
    instance_of = {i: k for k, i in enumerate(numbers)}
    seeds = sorted({run.seed for run in runs})
    seed_of = {seed: k for k, seed in enumerate(seeds)}
    runs.sort(key=lambda run: (instance_of[run.place], method_of[run.method], run.seed))
    figures = np.array([run.figures for run in runs]).reshape(-1, len(kind.columns))
    data = {}
    for name in runs[0].data if runs else ():
        data[name] = [run.data[name] for run in runs]
    failures = []
    for m, cell in rows.quarantined:
        if m in chosen:
            failures.append(_failure(cell, label_of[m]))
    places = [rows.places[i] for i in numbers]
    return Runs(
        kind=kind,
        version=ledger.version,
        methods=tuple(label_of[m] for m in method_of),
        variants=tuple(rows.variants[m] for m in method_of),
        instances=_instance_names(kind, places),
        places=tuple(places),
        method=np.array([method_of[run.method] for run in runs], dtype=int),
        instance=np.array([instance_of[run.place] for run in runs], dtype=int),
        seed=np.array([seed_of[run.seed] for run in runs], dtype=int),
        seeds=tuple(seeds),
        keys=tuple(run.key for run in runs),
        figures=dict(zip(kind.columns, figures.T, strict=True)),
        data=data,
        warnings={k: run.warnings for k, run in enumerate(runs) if run.warnings},
        failures=tuple(failures),
    )


def _read(ledger: "Ledger") -> _Rows:
    """Return the rows of a ledger.

    Raises InputError if it has no row, finished or quarantined, or has both tracks and
    searches.
    """
    variants = _Distinct()
    places = _Distinct()
    runs = []
    quarantined = list[tuple[int, Mapping[str, Any]]]()
    kinds = set[str]()
    shared: dict[bytes, Any] = {}  # arrays that many rows have in common
    for row in ledger.all_rows():
        spec = row["spec"]
        kinds.add(spec["kind"])
        if len(kinds) > 1:
            raise InputError(
                f"{ledger.path}: expected a ledger of either tracks or single "
                "searches, got both"
            )
        try:
            method = variants.number(_variant(spec))
            if row["status"] != "done":
                quarantined.append((method, row))
                continue
            figures, data = KINDS[spec["kind"]].read(row, shared)
            run = _Run(
                place=places.number(_place(spec)),
                method=method,
                seed=int(spec["seed"]),
                key=row["key"],
                warnings=tuple(map(printable, row["warnings"])),
                figures=figures,
                data=data,
            )
        # raised if a value is missing or has another type
        except (ValueError, TypeError, LookupError, AttributeError) as error:
            raise ledger.damaged_row(row["key"], error) from None
        runs.append(run)
    if not kinds:
        raise InputError(
            f"{ledger.path}: expected a ledger with finished rows, got none"
        )
    kind = KINDS[kinds.pop()]
    return _Rows(kind, variants.values, places.values, runs, quarantined)


def _labels(rows: _Rows, latest: bool) -> dict[int, str]:
    """Return the distinct names of methods by their numbers, the best first.

    Methods that only failed are last.
    """
    variants = rows.variants
    score = list(rows.kind.columns).index(rows.kind.score.name)
    sign = -1.0 if rows.kind.score.down else 1.0
    badness: list[list[float]] = [[] for _ in variants]
    for run in rows.runs:
        badness[run.method].append(sign * float(run.figures[score]))

    def order(m: int) -> tuple[bool, float, str]:
        """Return a key that is lower for better methods."""
        mean = (
            float(np.nan_to_num(badness[m], nan=np.inf).mean()) if badness[m] else 0.0
        )
        return not badness[m], mean, json_of(variants[m])

    best_first = sorted(
        _latest(variants) if latest else range(len(variants)), key=order
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
        texts = {}
        for name, value in place.items():
            texts[name] = value if isinstance(value, str) else json_of(value)
        details.append(texts)
    return distinct([kind.place_name(place) for place in places], details)


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
        names_of[m] = {label, _planned_name(rows.variants[m])}
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


def _failure(cell: Mapping[str, Any], name: str) -> Failure:
    """Return a quarantined cell of a method with this name."""
    return Failure(
        name=printable(str(cell_from({**cell["spec"], "name": name}))),
        method=name,
        key=cell["key"][:8],
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


def _place(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields that define an instance."""
    fields = {}
    for name, value in spec.items():
        if name not in (*METHOD_FIELDS, "kind", "seed"):
            fields[name] = value
    return fields
