"""The finished rows of a ledger as one table, small enough for a hundred thousand of them."""

import json
import marshal
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError, printable
from posefit.report.kind import Kind, Runs
from posefit.report.repeat import LAST_FIELDS, command_head, repeat_command
from posefit.report.searches import Searches
from posefit.report.tracks import Tracks
from posefit.settings import setting_text, settings_text
from posefit.sweep.cell import cell_from

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

KINDS: dict[str, Kind] = {kind.name: kind for kind in (Tracks(), Searches())}
# what a method chooses; all else but the seed makes an instance
_METHOD_FIELDS = ("method", "name", "settings", "evaluations", "hypotheses", "infeasible", "version")


class _Row(NamedTuple):
    """A finished row: its place, method and head as texts, and what `Runs` has of it."""

    place: str
    method: str
    head: str
    seed: int  # of any size
    key: str
    warnings: tuple[str, ...]
    figures: Array
    data: tuple[Any, ...]


def runs_of(ledger: "Ledger") -> Runs:
    """Return the finished rows of a ledger, in an order that does not depend on which of them finished first.

    If every cell failed there are no rows, but failures. Raises ValueError where there is neither, and where it holds
    both tracks and single searches.
    """
    quarantined = ledger.quarantined()
    rows: list[_Row] = []
    kinds: set[str] = set()
    shared: dict[bytes, Any] = {}  # arrays that many rows have
    places: dict[tuple[bytes, int], str] = {}  # by a spec without instance and seed, and the instance
    heads: dict[bytes, tuple[str, str]] = {}  # method and head of a spec without instance and seed
    for row in chain(ledger.rows(), quarantined):
        spec = row["spec"]
        kinds.add(spec["kind"])
        if len(kinds) > 1:
            raise InputError(f"{ledger.path}: expected a ledger of tracks or one of single searches, got both in one")
        if row["status"] != "done":
            continue
        fields = marshal.dumps({**spec, **dict.fromkeys(LAST_FIELDS)}, 2)
        if fields not in heads:
            heads[fields] = _text(_variant(spec)), command_head(spec)
        if (place := (fields, spec["instance"])) not in places:
            places[place] = sys.intern(_text(_place(spec)))
        measured = KINDS[spec["kind"]].read(row, shared)
        rows.append(_Row(places[place], *heads[fields], spec["seed"], row["key"], tuple(row["warnings"]), *measured))
    if not kinds:
        raise InputError(f"{ledger.path}: expected a ledger with finished rows, got one with none")
    return _sorted_runs(ledger.version, KINDS[kinds.pop()], rows, quarantined)


def _sorted_runs(version: str, kind: Kind, rows: list[_Row], quarantined: Sequence[Mapping[str, Any]]) -> Runs:
    error = list(kind.columns).index("error")
    errors: dict[str, list[float]] = {}
    for row in rows:
        errors.setdefault(row.method, []).append(np.nan_to_num(row.figures[error], nan=np.inf))
    failed = Counter(_text(_variant(cell["spec"])) for cell in quarantined)
    methods = sorted(errors, key=lambda text: (np.mean(errors[text]), text))
    every = [*methods, *sorted(failed.keys() - errors.keys())]
    variants = [json.loads(text) for text in every]
    labels = distinct([fields["name"] or fields["method"] for fields in variants], map(_variation, variants))
    names = dict(zip(every, labels, strict=True))
    by_text = {text: json.loads(text) for text in {row.place for row in rows}}
    texts = sorted(by_text, key=lambda text: (kind.rank(by_text[text]), text))
    places = [by_text[text] for text in texts]
    details = [{name: _text(v).strip('"') for name, v in place.items() if name not in kind.named} for place in places]
    heads, seeds = sorted({row.head for row in rows}), sorted({row.seed for row in rows})
    rank = {value: k for values in (methods, texts, heads, seeds) for k, value in enumerate(values)}
    rows.sort(key=lambda row: (rank[row.place], rank[row.method], row.seed))
    method, instance, head, seed = (
        np.array([[rank[name] for name in (row.method, row.place, row.head, row.seed)] for row in rows], dtype=int)
        .reshape(-1, 4)
        .T
    )
    figures = np.array([row.figures for row in rows], dtype=float).reshape(-1, len(kind.columns))
    data = dict(zip(kind.data, zip(*(row.data for row in rows), strict=True), strict=False))  # none without rows
    return Runs(
        kind=kind,
        version=version,
        methods=tuple(names[text] for text in methods),
        variants=tuple(
            {**v, "settings": printable(", ".join(settings_text(v["settings"])))} for v in variants[: len(methods)]
        ),
        instances=distinct([kind.place_name(place) for place in places], details),
        places=tuple(places),
        method=method,
        instance=instance,
        seed=seed,
        seeds=tuple(seeds),
        keys=tuple(row.key for row in rows),
        figures=dict(zip(kind.columns, figures.T, strict=True)),
        data={name: np.array(own) if isinstance(own[0], np.ndarray) else own for name, own in data.items()},
        warnings={k: tuple(map(printable, row.warnings)) for k, row in enumerate(rows) if row.warnings},
        failures=tuple(_failure(cell, names[_text(_variant(cell["spec"]))]) for cell in quarantined),
        failed=tuple(failed[text] for text in methods),
        unfinished=tuple(names[text] for text in every[len(methods) :]),
        heads=tuple(heads),
        head=head,
    )


def _failure(cell: Mapping[str, Any], name: str) -> dict[str, Any]:
    return {
        "name": printable(str(cell_from({**cell["spec"], "name": name}))),
        "method": name,
        "reasons": [*map(printable, dict.fromkeys(cell["reasons"]))],
        "command": repeat_command(cell["spec"]),
    }


def _variant(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return what makes a method; the budget of a search is that of each dimension."""
    fields = {name: spec[name] for name in _METHOD_FIELDS if name in spec}
    if "dimension" in spec:
        fields["budget"] = fields.pop("evaluations") / spec["dimension"]
    return fields


def _variation(variant: Mapping[str, Any]) -> dict[str, str]:
    """Return what may distinguish a method from others of the same name: values by the names of what is chosen."""
    chosen = {name: setting_text(value) for name, value in variant["settings"].items()}
    for name in ("method", "evaluations", "budget", "hypotheses", "infeasible"):
        if name in variant:
            chosen[name] = variant[name] if isinstance(variant[name], str) else f"{variant[name]:.12g}"
    posefit, *plugins = variant["version"].split(", ")
    return {**chosen, "posefit": posefit, **{name: version for name, _, version in (p.partition(" ") for p in plugins)}}


def _place(spec: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in spec.items() if name not in (*_METHOD_FIELDS, "kind", "seed")}


def distinct(names: Sequence[str], details: Iterable[Mapping[str, str]]) -> tuple[str, ...]:
    """Return distinct names; those that occur twice have in brackets what differs: `sapso@pca (cooling 0.9)`.

    A setting stands without its plugin, `sapso.cooling`, where no other that differs has the same name; a number tells
    apart what no detail does.
    """
    by_name: dict[str, list[Mapping[str, str]]] = {}
    for name, values in zip(names, details := list(details), strict=True):
        by_name.setdefault(name, []).append(values)
    differing = {name: _differing(several) for name, several in by_name.items()}
    longer: dict[str, None] = {}
    for name, values in zip(names, details, strict=True):
        words = [f"{short} {values[field]}" for field, short in differing[name].items() if field in values]
        plain = unique = printable(f"{name} ({', '.join(words)})" if words else name)
        number = 1
        while unique in longer:
            number += 1
            unique = f"{plain} ({number})"
        longer[unique] = None
    return tuple(longer)


def _differing(several: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Return the fields whose values are not the same in all mappings, with the short names of these fields."""
    fields = dict.fromkeys(field for values in sorted(several, key=len, reverse=True) for field in values)
    differ = [field for field in fields if len({values.get(field) for values in several}) > 1]
    plain = [field.rpartition(".")[2] for field in differ]
    return {field: short if plain.count(short) == 1 else field for field, short in zip(differ, plain, strict=True)}


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)
