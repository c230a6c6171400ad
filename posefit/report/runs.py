"""The finished rows of a ledger as numbers, small enough for a hundred thousand of them."""

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import COLUMNS, FIGURES, SHOWN
from posefit.report.repeat import LAST, command_head
from posefit.sweep.cell import settings_text
from posefit.sweep.table import is_search
from posefit.uncertainty.calibration import BINS

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

_VARIANT = ("method", "settings", "evaluations", "tracks", "version")  # what a method is
_PLACE = ("motion", "view_degrees", "corruption", "instance")  # what is always said of an instance


@dataclass(frozen=True, eq=False)
class Runs:
    """All rows. Methods are told apart by settings, budget, tracks and version, instances by all else but the seed."""

    version: str
    methods: tuple[str, ...]  # named so that no two are alike, the lowest mean error first
    variants: tuple[dict[str, Any], ...]  # of each method: method, settings, evaluations, tracks, version
    instances: tuple[str, ...]  # so named too
    places: tuple[dict[str, Any], ...]  # of each instance: the fields of a spec that make it
    heads: tuple[str, ...]  # what commands that run rows again begin with
    method: Array  # (n,) of each row an index, as are the next three
    instance: Array  # (n,)
    head: Array  # (n,)
    seed: Array  # (n,)
    seeds: tuple[int, ...]  # there are, rising
    keys: tuple[str, ...]
    figures: dict[str, Array] = field(repr=False)  # of each of FIGURES (n,), nan where a row has none
    joint_errors: Array = field(repr=False)  # (n, 27) mm
    modes: Array = field(repr=False)  # (n, bins, 3) by bins of how likely a frame's likeliest mode is: see `_binned`
    warnings: Mapping[int, tuple[str, ...]] = field(repr=False)  # of the rows that have any
    traces: tuple[tuple[Array, Array], ...] = field(repr=False)  # evaluations and best costs (k,) of each row
    failures: tuple[dict[str, Any], ...] = field(repr=False)  # cells in quarantine: name, method, reasons, command
    failed: tuple[int, ...] = field(repr=False)  # how many cells of each method are in quarantine
    unfinished: tuple[str, ...]  # methods of which every cell is in quarantine

    def __len__(self) -> int:
        return len(self.keys)


def runs_of(ledger: "Ledger") -> Runs:
    """Return the finished rows of a ledger, in an order that does not depend on who finished first.

    Where every cell failed there are no rows, but the reasons. Raises ValueError where there is neither.
    """
    found = runs_so_far(ledger)
    if not found.keys and not found.failures:
        raise ValueError(f"{ledger.path}: expected a ledger with finished rows, got one with none")
    return found


def runs_so_far(ledger: "Ledger") -> Runs:
    """Return the same of a ledger that may hold nothing yet."""
    found = _Table()
    lost = ledger.quarantined()
    for row in ledger.rows():
        _check_track(ledger, row)
        found.add(row)
    for row in lost:
        _check_track(ledger, row)
    return found.runs(ledger.version, lost)


def _check_track(ledger: "Ledger", row: Mapping[str, Any]) -> None:
    if is_search(row["spec"]):
        raise ValueError(f"{ledger.path}: expected a ledger of tracks or one of single searches, got both in one")


def shown_of(runs: Runs) -> list[str]:
    """Return the figures that tables show of runs: those that only some methods have, where a row has them."""
    return [name for name in SHOWN if not COLUMNS[name].sometimes or bool(np.isfinite(runs.figures[name]).any())]


class _Table:
    """Collects rows."""

    def __init__(self) -> None:
        self.variants: dict[str, int] = {}
        self.places: dict[str, int] = {}
        self.heads: dict[str, int] = {}
        self.known: dict[str, tuple[int, int]] = {}  # variant and head of a spec without instance and seed
        self.numbers: list[tuple[int, int, int]] = []
        self.seeds: list[int] = []  # of any size, so not for an array
        self.keys: list[str] = []
        self.figures: list[list[float]] = []
        self.joints: list[Array] = []
        self.modes: list[Array] = []
        self.warnings: dict[int, tuple[str, ...]] = {}
        self.traces: list[tuple[Array, Array]] = []

    def add(self, row: Mapping[str, Any]) -> None:
        spec = row["spec"]
        kind = _text({name: value for name, value in spec.items() if name not in LAST})
        if kind not in self.known:
            variant = _index(self.variants, _variant(spec))
            self.known[kind] = variant, _index(self.heads, command_head(spec))
        variant, begun = self.known[kind]
        place = _index(
            self.places,
            _text({name: value for name, value in spec.items() if name not in (*_VARIANT, "seed")}),
        )
        if row.get("warnings"):
            self.warnings[len(self.keys)] = tuple(row["warnings"])
        self.numbers.append((variant, place, begun))
        self.seeds.append(spec["seed"])
        self.keys.append(row["key"])
        self.figures.append([column.value(row) for column in COLUMNS.values()])
        self.joints.append(np.array(row.get("joint_errors_mm") or [np.nan] * len(JOINTS), dtype=np.float32))
        self.modes.append(_binned(row.get("mode_reliability") or []))
        trace = row.get("trace") or {"evaluations": [], "cost": []}
        self.traces.append((np.array(trace["evaluations"], np.float32), np.array(trace["cost"], np.float32)))

    def runs(self, version: str, quarantined: Sequence[Mapping[str, Any]]) -> Runs:
        # of no rows too, where every cell failed
        numbers = np.array(self.numbers, dtype=int).reshape(-1, 3)
        figures = np.array(self.figures, dtype=float).reshape(-1, len(FIGURES))
        variants, places = ([json.loads(text) for text in table] for table in (self.variants, self.places))
        error = np.nan_to_num(figures[:, FIGURES.index("error")], nan=np.inf)
        means = [float(np.mean(error[numbers[:, 0] == m])) for m in range(len(variants))]
        best = sorted(range(len(variants)), key=lambda m: (means[m], list(self.variants)[m]))
        texts = list(self.places)
        sorted_places = sorted(range(len(places)), key=lambda i: (_rank(places[i]), texts[i]))
        for column, ranked in enumerate((best, sorted_places)):
            numbers[:, column] = np.argsort(ranked).astype(int)[numbers[:, column]]
        heads = sorted(range(len(self.heads)), key=list(self.heads).__getitem__)
        numbers[:, 2] = np.argsort(heads).astype(int)[numbers[:, 2]]
        ranks = {seed: k for k, seed in enumerate(sorted(set(self.seeds)))}
        seeds = np.array([ranks[seed] for seed in self.seeds], dtype=int)
        order = np.lexsort((seeds, numbers[:, 0], numbers[:, 1]))
        variants, places = [variants[m] for m in best], [places[i] for i in sorted_places]
        methods = distinct([one["method"] for one in variants], [_variation(one) for one in variants])
        method, instance, begun = numbers[order].T
        lost = Counter(_variant(one["spec"]) for one in quarantined)
        return Runs(
            version=version,
            methods=methods,
            variants=tuple({**one, "settings": ", ".join(settings_text(one["settings"]))} for one in variants),
            instances=distinct([_place(one) for one in places], [_rest(one) for one in places]),
            places=tuple(places),
            heads=tuple(list(self.heads)[k] for k in heads),
            method=method,
            instance=instance,
            head=begun,
            seed=seeds[order],
            seeds=tuple(ranks),
            keys=tuple(self.keys[k] for k in order),
            figures=dict(zip(FIGURES, figures[order].T, strict=True)),
            joint_errors=np.asarray(np.reshape(self.joints, (-1, len(JOINTS)))[order]),
            modes=np.asarray(np.reshape(self.modes, (-1, BINS, 3))[order]),
            warnings={row: self.warnings[k] for row, k in enumerate(order.tolist()) if k in self.warnings},
            traces=tuple(self.traces[k] for k in order),
            failures=tuple(_failure(one) for one in quarantined),
            failed=tuple(lost[text] for text in (list(self.variants)[m] for m in best)),
            unfinished=tuple(sorted({json.loads(text)["method"] for text in lost if text not in self.variants})),
        )


def _binned(modes: Sequence[Sequence[float]]) -> Array:
    """Return what a row has of its frames' likeliest modes, by bins (bins, 3): frames, sum of probabilities, right."""
    found = np.zeros((BINS, 3), dtype=np.float32)
    for count, told, right in modes:
        found[min(int(told * BINS), BINS - 1)] += count * np.array([1.0, told, right])
    return np.asarray(found)


def _failure(lost: Mapping[str, Any]) -> dict[str, Any]:
    spec = lost["spec"]
    name = f"{spec['method']} on {spec['motion']}, instance {spec['instance']}, seed {spec['seed']}"
    tail = "".join(f"{one} = {spec[one]}\n" for one in LAST)
    return {
        "name": name,
        "method": spec["method"],
        "reasons": list(dict.fromkeys(lost["reasons"])),
        "command": command_head(spec) + tail + "END",
    }


def _variant(spec: Mapping[str, Any]) -> str:
    return _text({name: value for name, value in spec.items() if name in _VARIANT})


def _variation(variant: Mapping[str, Any]) -> list[str]:
    return [
        *settings_text(variant["settings"]),
        f"{variant['evaluations']} evaluations",
        f"{variant['tracks']} {'track' if variant['tracks'] == 1 else 'tracks'}",
        *variant["version"].split(", "),
    ]


def _rank(place: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what instances are sorted by: the undamaged before the damaged."""
    damage = sorted(place["corruption"].items())
    return place["motion"], place["view_degrees"], len(damage), damage, place["instance"]


def _place(place: Mapping[str, Any]) -> str:
    views = ", ".join(f"{view:g}°" for view in place["view_degrees"])
    damage = "".join(f", {kind} {strength:g}" for kind, strength in sorted(place["corruption"].items()))
    return f"{place['motion']}, view {views}{damage}, instance {place['instance']}"


def _rest(place: Mapping[str, Any]) -> list[str]:
    return [f"{name} {_text(value)}" for name, value in place.items() if name not in _PLACE]


def distinct(names: Sequence[str], more: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return names, those that occur twice with what makes them differ."""
    alike: dict[str, list[Sequence[str]]] = {}
    for name, words in zip(names, more, strict=True):
        alike.setdefault(name, []).append(words)
    shared = {name: set(several[0]).intersection(*several[1:]) for name, several in alike.items()}
    found = [
        ", ".join([name, *(word for word in words if word not in shared[name])])
        for name, words in zip(names, more, strict=True)
    ]
    many, met = Counter(found), Counter[str]()
    for k, name in enumerate(found):
        if many[name] > 1:
            met[name] += 1
            found[k] = f"{name} ({met[name]})"
    return tuple(found)


def _index(table: dict[str, int], key: str) -> int:
    return table.setdefault(key, len(table))


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)
