"""The finished rows of a ledger as arrays, small enough for a hundred thousand of them: tracks or single searches."""

import json
import marshal
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import (
    COLUMNS,
    FIGURES,
    SEARCH_COLUMNS,
    SEARCH_SCORE,
    TABLE_FIGURES,
    TRACK_SCORE,
    Column,
)
from posefit.report.repeat import LAST_FIELDS, command_head, repeat_command
from posefit.settings import setting_text, settings_text
from posefit.statistics.profiles import hits
from posefit.suites.running import SuiteRun
from posefit.sweep.table import is_search, search_run
from posefit.uncertainty.calibration import BINS

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

_METHOD_FIELDS = ("method", "name", "settings", "evaluations", "hypotheses", "version")  # of a track's spec
_NAMED_FIELDS = ("motion", "view_degrees", "corruption", "instance")  # that the name of a track's instance has
NO_MODES: Array = np.zeros((BINS, 3), dtype=np.float32)
_PROBLEM_FIELDS = ("function", "dimension", "instance", "suite")  # of a search's spec


@dataclass(frozen=True, eq=False, repr=False)
class Runs:
    """All rows of a ledger, sorted by instance, method and seed.

    Methods differ in name, settings, budget and version, and in what else a method chooses; instances differ in all
    other fields but the seed. Single searches have `searches` and `hits`, tracks what comes after these.
    """

    version: str
    methods: tuple[str, ...]  # distinct names, the lowest mean error first
    variants: tuple[dict[str, Any], ...]  # the fields that make each method
    instances: tuple[str, ...]  # distinct names
    places: tuple[dict[str, Any], ...]  # the fields that make each instance
    method: Array  # (n,) index of each row, as the next two
    instance: Array  # (n,)
    seed: Array  # (n,)
    seeds: tuple[int, ...]  # rising
    keys: tuple[str, ...]
    figures: dict[str, Array]  # name -> (n,), nan where a row has none; a lower `error` is better
    warnings: Mapping[int, tuple[str, ...]]  # row -> its warnings, if any
    failures: tuple[dict[str, Any], ...]  # quarantined cells: name, method, reasons, command
    failed: tuple[int, ...]  # quarantined cells of each method
    unfinished: tuple[str, ...]  # methods whose every cell is in quarantine
    is_search: bool
    searches: tuple[SuiteRun, ...]
    hits: Array  # (n, targets) evaluations, inf for never
    heads: tuple[str, ...]  # the beginnings of the commands that run rows again
    head: Array  # (n,)
    joint_errors: Array  # (n, 27) mm
    modes: Array  # (n, bins, 3): see `_binned`
    traces: tuple[tuple[Array, Array], ...]  # evaluations and best costs (k,) of a row

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def score(self) -> dict[str, Any]:
        """The figure by which methods are ordered, and the texts that depend on it."""
        return SEARCH_SCORE if self.is_search else TRACK_SCORE

    @property
    def columns(self) -> dict[str, Column]:
        """All figures of a row."""
        return SEARCH_COLUMNS if self.is_search else COLUMNS

    @property
    def table_figures(self) -> list[str]:
        """The figures of a track that tables show: optional ones only if a row has them."""
        return [
            name for name in TABLE_FIGURES if not COLUMNS[name].optional or bool(np.isfinite(self.figures[name]).any())
        ]


class _Row(NamedTuple):
    """A finished row: its place, method and head as texts, and what `Runs` has of it."""

    place: str
    method: str
    head: str
    seed: int  # of any size
    key: str
    warnings: tuple[str, ...]
    figures: Array
    data: tuple[Any, ...]  # joint errors, modes and trace of a track; run and hits of a search


def runs_of(ledger: "Ledger") -> Runs:
    """Return the finished rows of a ledger, in an order that does not depend on which of them finished first.

    If every cell failed there are no rows, but failures. Raises ValueError where there is neither, and where it holds
    both tracks and single searches.
    """
    quarantined = ledger.quarantined()
    rows: list[_Row] = []
    kinds: set[bool] = set()
    places: dict[tuple[bytes, int], str] = {}  # by a spec without instance and seed, and the instance
    grids: dict[bytes, Any] = {}  # evaluations of traces, one array for all that have the same
    heads: dict[bytes, tuple[str, str]] = {}  # method and head of a spec without instance and seed
    for row in chain(ledger.rows(), quarantined):
        spec = row["spec"]
        kinds.add(searches := is_search(spec))
        if len(kinds) > 1:
            raise InputError(f"{ledger.path}: expected a ledger of tracks or one of single searches, got both in one")
        if row["status"] != "done":
            continue
        fields = marshal.dumps({**spec, **dict.fromkeys(LAST_FIELDS)}, 2)
        if fields not in heads:
            heads[fields] = _text(_variant(spec)), "" if searches else command_head(spec)
        figures, *data = _search_data(search_run(row)) if searches else _track_data(row, grids)
        place = fields, spec["instance"]
        if place not in places:
            places[place] = sys.intern(_text(_place(spec)))
        texts = (places[place], *heads[fields])
        rows.append(_Row(*texts, spec["seed"], row["key"], tuple(row["warnings"]), figures, tuple(data)))
    if not kinds:
        raise InputError(f"{ledger.path}: expected a ledger with finished rows, got one with none")
    return _sorted_runs(ledger.version, True in kinds, rows, quarantined)


def _track_data(row: Mapping[str, Any], grids: dict[bytes, Any]) -> tuple[Any, ...]:
    """Return the figures of a track, its joints' errors, its modes, and its trace, whose evaluations many share."""
    joints = np.array(row["joint_errors_mm"], dtype=np.float32)
    evaluations = np.array(row["trace"]["evaluations"], np.float32)
    trace = grids.setdefault(evaluations.tobytes(), evaluations), np.array(row["trace"]["cost"], np.float32)
    figures = np.array([column.value(row) for column in COLUMNS.values()], np.float64)
    return figures, joints, _binned(row["mode_reliability"]), trace


def _search_data(run: SuiteRun) -> tuple[Any, ...]:
    evaluations = hits((run.evaluations, run.costs), run.targets)
    reached = 100.0 * float(np.isfinite(evaluations).mean())
    return np.array([100.0 - reached, reached, run.cost - run.truth_cost]), run, evaluations


def _sorted_runs(version: str, searches: bool, rows: list[_Row], quarantined: Sequence[Mapping[str, Any]]) -> Runs:
    errors: dict[str, list[float]] = {}
    for row in rows:
        errors.setdefault(row.method, []).append(np.nan_to_num(row.figures[0], nan=np.inf))
    methods = sorted(errors, key=lambda text: (np.mean(errors[text]), text))
    variants = [json.loads(text) for text in methods]
    places_of = {text: json.loads(text) for text in {row.place for row in rows}}
    texts = sorted(places_of, key=lambda text: (_rank(places_of[text]), text))
    places = [places_of[text] for text in texts]
    heads, seeds = sorted({row.head for row in rows}), sorted({row.seed for row in rows})
    rank = {value: k for values in (methods, texts, heads, seeds) for k, value in enumerate(values)}
    rows.sort(key=lambda row: (rank[row.place], rank[row.method], row.seed))
    method, instance, head, seed = (
        np.array([[rank[name] for name in (row.method, row.place, row.head, row.seed)] for row in rows], dtype=int)
        .reshape(-1, 4)
        .T
    )
    names = ("error", "reached", "above") if searches else FIGURES
    figures = np.array([row.figures for row in rows], dtype=float).reshape(-1, len(names))
    first, second, *third = zip(*(row.data for row in rows), strict=True) if rows else ((), (), ())
    joint_errors, modes = ((), ()) if searches else (first, second)
    failed = Counter(_text(_variant(cell["spec"])) for cell in quarantined)
    return Runs(
        version=version,
        methods=distinct(
            [fields["name"] or fields["method"] for fields in variants], [_variation(fields) for fields in variants]
        ),
        variants=tuple(
            {name: value for name, value in fields.items() if name != "name"}
            | {"settings": ", ".join(settings_text(fields["settings"]))}
            for fields in variants
        ),
        instances=distinct([_place_name(place) for place in places], [_place_details(place) for place in places]),
        places=tuple(places),
        method=method,
        instance=instance,
        seed=seed,
        seeds=tuple(seeds),
        keys=tuple(row.key for row in rows),
        figures=dict(zip(names, figures.T, strict=True)),
        warnings={k: row.warnings for k, row in enumerate(rows) if row.warnings},
        failures=tuple(map(_failure, quarantined)),
        failed=tuple(failed[text] for text in methods),
        unfinished=tuple(sorted({json.loads(text)["method"] for text in failed if text not in errors})),
        is_search=searches,
        searches=first if searches else (),
        hits=np.array(second) if searches else np.empty((0, 0)),
        heads=tuple(heads),
        head=head,
        joint_errors=np.array(joint_errors).reshape(-1, len(JOINTS)),
        modes=np.array(modes).reshape(-1, BINS, 3),
        traces=() if searches else third[0],
    )


def _binned(modes: Sequence[Sequence[float]]) -> Array:
    """Return a row's likeliest modes by bins (bins, 3) of probability: frames, sum of probabilities, frames right."""
    if not modes:
        return NO_MODES
    bins = np.zeros((BINS, 3), dtype=np.float32)
    for count, probability, right in modes:
        bins[min(int(probability * BINS), BINS - 1)] += count * np.array([1.0, probability, right])
    return np.asarray(bins)


def _failure(cell: Mapping[str, Any]) -> dict[str, Any]:
    spec = cell["spec"]
    where = f"f{spec['function']} in {spec['dimension']}D" if is_search(spec) else spec["motion"]
    return {
        "name": f"{spec['name'] or spec['method']} on {where}, instance {spec['instance']}, seed {spec['seed']}",
        "method": spec["name"] or spec["method"],
        "reasons": list(dict.fromkeys(cell["reasons"])),
        "command": repeat_command(spec),
    }


def _variant(spec: Mapping[str, Any]) -> dict[str, Any]:
    if is_search(spec):
        fields = {name: spec[name] for name in ("method", "name", "settings", "infeasible", "version")}
        return {**fields, "budget": spec["evaluations"] / spec["dimension"]}
    return {name: spec[name] for name in _METHOD_FIELDS}


def _variation(variant: Mapping[str, Any]) -> dict[str, str]:
    """Return what may distinguish a method from others of the same name: values by the names of what is chosen."""
    chosen = {name: setting_text(value) for name, value in variant["settings"].items()}
    for name in ("evaluations", "budget", "hypotheses", "infeasible"):
        if name in variant:
            chosen[name] = variant[name] if isinstance(variant[name], str) else f"{variant[name]:g}"
    posefit, *plugins = variant["version"].split(", ")
    return {**chosen, "posefit": posefit, **{name: version for name, _, version in (p.partition(" ") for p in plugins)}}


def _place(spec: Mapping[str, Any]) -> dict[str, Any]:
    if is_search(spec):
        return {name: spec[name] for name in _PROBLEM_FIELDS}
    return {name: value for name, value in spec.items() if name not in (*_METHOD_FIELDS, "kind", "seed")}


def _rank(place: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what instances are sorted by: undamaged ones come before damaged ones."""
    if "suite" in place:
        return tuple(place[name] for name in _PROBLEM_FIELDS)
    corruption = sorted(place["corruption"].items())
    return place["motion"], place["view_degrees"], len(corruption), corruption, place["instance"]


def views(place: Mapping[str, Any]) -> list[str]:
    """Return the directions of an instance's cameras in degrees."""
    return [f"{view:g}" for view in place["view_degrees"]]


def damage(place: Mapping[str, Any]) -> list[str]:
    """Return the kinds of damage of an instance with their strengths."""
    return [f"{kind} {strength:g}" for kind, strength in sorted(place["corruption"].items())]


def _place_name(place: Mapping[str, Any]) -> str:
    if "suite" in place:
        return f"f{place['function']} in {place['dimension']}D, instance {place['instance']}"
    directions = ", ".join(f"{view}°" for view in views(place))
    return ", ".join([f"{place['motion']}, view {directions}", *damage(place), f"instance {place['instance']}"])


def _place_details(place: Mapping[str, Any]) -> dict[str, str]:
    fields = _PROBLEM_FIELDS[:3] if "suite" in place else _NAMED_FIELDS
    return {name: _text(value).strip('"') for name, value in place.items() if name not in fields}


def distinct(names: Sequence[str], details: Sequence[Mapping[str, str]]) -> tuple[str, ...]:
    """Return names; those that occur twice have in brackets what differs, such as `sapso@pca (cooling 0.9)`.

    A setting stands without its plugin, `sapso.cooling`, where no other that differs has the same name.
    """
    by_name: dict[str, list[Mapping[str, str]]] = {}
    for name, values in zip(names, details, strict=True):
        by_name.setdefault(name, []).append(values)
    differing = {name: _differing(several) for name, several in by_name.items()}
    longer = []
    for name, values in zip(names, details, strict=True):
        words = [f"{short} {values[field]}" for field, short in differing[name].items() if field in values]
        longer.append(f"{name} ({', '.join(words)})" if words else name)
    counts, numbered = Counter(longer), Counter[str]()
    for k, name in enumerate(longer):
        if counts[name] > 1:
            numbered[name] += 1
            longer[k] = f"{name} ({numbered[name]})"
    return tuple(longer)


def _differing(several: Sequence[Mapping[str, str]]) -> dict[str, str]:
    """Return the fields whose values are not the same in all mappings, with the short names of these fields."""
    fields = dict.fromkeys(field for values in sorted(several, key=len, reverse=True) for field in values)
    differ = [field for field in fields if len({values.get(field) for values in several}) > 1]
    plain = [field.rpartition(".")[2] for field in differ]
    return {field: short if plain.count(short) == 1 else field for field, short in zip(differ, plain, strict=True)}


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)
