"""Reads the finished rows of a ledger into a table, which holds a hundred thousand."""

import json
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.errors import InputError, printable
from posefit.reading import quoted, suggestion
from posefit.report.columns import listed
from posefit.report.kind import Kind, Runs
from posefit.report.repeat import LAST_FIELDS, command_head, repeat_command
from posefit.report.searches import SEARCHES
from posefit.report.tracks import TRACKS
from posefit.settings import setting_text, settings_text
from posefit.sweep.cell import cell_from, other_version

if TYPE_CHECKING:
    from posefit.arrays import Array
    from posefit.sweep.ledger import Ledger

KINDS: dict[str, Kind] = {kind.name: kind for kind in (TRACKS, SEARCHES)}
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
        self._numbers: dict[Hashable, int] = {}

    def number(self, value: dict[str, Any]) -> int:
        """Return the number of a value, and add it if it is new."""
        if (key := _frozen(value)) not in self._numbers:
            self._numbers[key] = len(self.values)
            self.values.append(value)
        return self._numbers[key]


def _frozen(value: Any) -> Hashable:
    """Return a hashable key of a JSON value. The keys of 1, 1.0 and true differ."""
    if isinstance(value, dict):
        return tuple(sorted((name, _frozen(inner)) for name, inner in value.items()))
    if isinstance(value, list):
        return tuple(map(_frozen, value))
    if isinstance(value, str):
        return value
    # as 1 == 1.0 == True in Python
    return type(value), value


class _Rows:
    """The finished rows of a ledger in its order.

    Their methods, instances and heads of commands are numbered.

    Raises InputError if the ledger has no row, finished or quarantined, or has both
    tracks and searches.
    """

    def __init__(
        self, ledger: "Ledger", quarantined: Sequence[Mapping[str, Any]]
    ) -> None:
        self.methods = _Distinct()
        self.places = _Distinct()
        self.heads = _Distinct()
        # the numbers of each row's instance, method and head
        self.numbers: list[tuple[int, int, int]] = []
        self.seeds: list[int] = []  # of any size, so not an array
        self.keys: list[str] = []
        self.warnings: list[tuple[str, ...]] = []
        self.measured: list[tuple[Array, tuple[Any, ...]]] = []
        shared: dict[bytes, Any] = {}  # arrays that many rows have in common
        kinds = set[str]()
        for row in chain(ledger.rows(), quarantined):
            kinds.add(row["spec"]["kind"])
            if len(kinds) > 1:
                raise InputError(
                    f"{ledger.path}: expected a ledger of tracks or one of single "
                    "searches, got both in one"
                )
            if row["status"] == "done":
                try:
                    self._add(row, shared)
                # raised if a figure is missing or has another type
                except (ValueError, TypeError, LookupError, AttributeError) as error:
                    raise ledger.damaged_row(row["key"], error) from None
        if not kinds:
            raise InputError(
                f"{ledger.path}: expected a ledger with finished rows, "
                "got one with none"
            )
        self.kind = KINDS[kinds.pop()]

    def _add(self, row: Mapping[str, Any], shared: dict[bytes, Any]) -> None:
        spec = row["spec"]
        place = self.places.number(_place(spec))
        method = self.methods.number(_variant(spec))
        first_fields = dict(spec)
        for name in LAST_FIELDS:
            first_fields.pop(name, None)
        head = self.heads.number(first_fields)
        self.numbers.append((place, method, head))
        self.seeds.append(int(spec["seed"]))
        self.keys.append(row["key"])
        self.warnings.append(tuple(row["warnings"]))
        figures, data = KINDS[spec["kind"]].read(row, shared)
        self.measured.append((figures.astype(float), data))


def runs_of(
    ledger: "Ledger", methods: Sequence[str] = (), *, latest: bool = False
) -> Runs:
    """Return the finished rows of a ledger.

    Their order does not depend on which of them finished first.

    Args:
        ledger: An open ledger, of tracks or of single searches.
        methods: The methods whose runs are returned, by their names in the report or in
            the plan. All if empty.
        latest: Whether to return only one version of each method: the installed one, or
            else the one that was planned last.

    Returns:
        The runs, and the failures. If every cell failed, there are no runs.

    Raises:
        ValueError: The ledger has neither a row nor a failure, or both tracks and
            single searches, or no method has one of the names.
    """
    quarantined = ledger.quarantined()
    rows = _Rows(ledger, quarantined)
    kind = rows.kind
    # methods that only failed have the numbers from here on
    count = len(rows.methods.values)
    failed_method = []
    for cell in quarantined:
        failed_method.append(rows.methods.number(_variant(cell["spec"])))
    variants = rows.methods.values
    numbers = np.array(rows.numbers, dtype=int).reshape(-1, 3)
    figures = np.array([values for values, _ in rows.measured], dtype=float)
    figures = figures.reshape(-1, len(kind.columns))

    chosen = _latest(variants) if latest else range(len(variants))
    scores = figures[:, list(kind.columns).index(kind.score.name)]
    badness = np.nan_to_num(-scores if kind.score.down else scores, nan=np.inf)
    means = [badness[numbers[:, 1] == m].mean() for m in range(count)]
    means += [np.inf] * (len(variants) - count)
    best_first = sorted(
        chosen, key=lambda m: (m >= count, means[m], _text(variants[m]))
    )
    labels = distinct(
        [variants[m]["name"] or variants[m]["method"] for m in best_first],
        [_variation(variants[m]) for m in best_first],
    )
    label_of = dict(zip(best_first, labels, strict=True))
    if methods:
        best_first = _named(methods, best_first, variants, label_of)
    finished = [m for m in best_first if m < count]
    place_of_method = {m: k for k, m in enumerate(finished)}

    # the rows and the quarantined cells of these methods
    retained = []
    for k, (_, method, _) in enumerate(rows.numbers):
        if method in place_of_method:
            retained.append(k)
    cells = []
    for cell, m in zip(quarantined, failed_method, strict=True):
        if m in best_first:
            cells.append((cell, label_of[m]))
    failed = Counter(name for _, name in cells)

    # their instances, in order, with the details that may distinguish equal names
    present = sorted({rows.numbers[k][0] for k in retained})
    values = rows.places.values
    place_order = sorted(
        present, key=lambda i: (kind.rank(values[i]), _text(values[i]))
    )
    places = [values[i] for i in place_order]
    details = []
    for place in places:
        unnamed = {}
        for name, value in place.items():
            if name not in kind.named:
                unnamed[name] = _text(value).strip('"')
        details.append(unnamed)

    # rows that differ only in instance and seed share the beginning of their command
    commands: dict[int, str] = {}
    for k in retained:
        head = rows.numbers[k][2]
        if head not in commands:
            commands[head] = command_head(rows.heads.values[head])
    heads = sorted(set(commands.values()))
    place_of_command = {command: k for k, command in enumerate(heads)}
    place_of_instance = {i: k for k, i in enumerate(place_order)}
    rising = sorted({rows.seeds[k] for k in retained})
    place_of_seed = {seed: k for k, seed in enumerate(rising)}

    def index(row: int) -> tuple[int, int, int, int]:
        """Return the instance, method, seed and command of a row."""
        instance, method, head = rows.numbers[row]
        return (
            place_of_instance[instance],
            place_of_method[method],
            place_of_seed[rows.seeds[row]],
            place_of_command[commands[head]],
        )

    indices = {k: index(k) for k in retained}
    order = sorted(retained, key=indices.__getitem__)
    table = np.array([indices[k] for k in order], dtype=int).reshape(-1, 4).T
    finished_variants = []
    for m in finished:
        settings = printable(", ".join(settings_text(variants[m]["settings"])))
        finished_variants.append({**variants[m], "settings": settings})
    columns = zip(*(rows.measured[k][1] for k in order), strict=True)
    data: dict[str, Any] = {}
    # without rows there are no columns
    for name, column in zip(kind.data, columns, strict=False):
        if isinstance(column[0], np.ndarray):
            data[name] = np.array(column)
        else:
            data[name] = column
    warnings = {}
    for k, row in enumerate(order):
        if rows.warnings[row]:
            warnings[k] = tuple(map(printable, rows.warnings[row]))
    return Runs(
        kind=kind,
        version=ledger.version,
        methods=tuple(label_of[m] for m in finished),
        variants=tuple(finished_variants),
        instances=distinct([kind.place_name(place) for place in places], details),
        places=tuple(places),
        instance=table[0],
        method=table[1],
        seed=table[2],
        head=table[3],
        seeds=tuple(rising),
        keys=tuple(rows.keys[k] for k in order),
        figures=dict(zip(kind.columns, figures[order].T, strict=True)),
        data=data,
        warnings=warnings,
        failures=tuple(_failure(cell, name) for cell, name in cells),
        failed=tuple(failed[label_of[m]] for m in finished),
        unfinished=tuple(label_of[m] for m in best_first if m >= count),
        heads=tuple(heads),
    )


def _latest(variants: Sequence[Mapping[str, Any]]) -> list[int]:
    """Return one version of each method, by their indices.

    It is the installed version, or else the one that was planned last.
    """
    best: dict[Hashable, tuple[bool, int]] = {}
    for m, variant in enumerate(variants):
        versions = variant["version"].split(", ")
        installed = not any(map(other_version, versions))
        other_fields = {**variant, "version": ""}
        key = _frozen(other_fields)
        best[key] = max(best.get(key, (False, -1)), (installed, m))
    return sorted(m for _, m in best.values())


def _named(
    names: Sequence[str],
    numbers: Sequence[int],
    variants: Sequence[Mapping[str, Any]],
    label_of: Mapping[int, str],
) -> list[int]:
    """Return the methods with the given names.

    Raises InputError if no method has one of the names.
    """
    names_of = {}
    for m in numbers:
        name = variants[m]["name"] or variants[m]["method"]
        names_of[m] = {label_of[m], name}
    known = set().union(*names_of.values())
    for name in names:
        if name not in known:
            raise InputError(
                f"--methods must be of {listed(sorted(label_of.values()), 12)}, "
                f"got {quoted(name)}{suggestion(name, known)}"
            )
    return [m for m in numbers if names_of[m] & set(names)]


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
    posefit, *plugins = variant["version"].split(", ")
    texts["posefit"] = posefit
    for plugin in plugins:
        name, _, version = plugin.partition(" ")
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
    return json.dumps(value, sort_keys=True)
