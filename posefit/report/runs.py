"""The finished rows of a ledger as arrays, small enough for a hundred thousand of them: tracks or single searches."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import COLUMNS, FIGURES, TABLE_FIGURES
from posefit.report.repeat import LAST_FIELDS, command_head, repeat_command
from posefit.statistics.profiles import hits
from posefit.suites.running import SuiteRun
from posefit.sweep.cell import settings_text
from posefit.sweep.table import is_search, search_run
from posefit.uncertainty.calibration import BINS

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

_METHOD_FIELDS = ("method", "settings", "evaluations", "hypotheses", "version")  # of a track's spec
_NAMED_FIELDS = ("motion", "view_degrees", "corruption", "instance")  # that the name of a track's instance has
_PROBLEM_FIELDS = ("function", "dimension", "instance", "suite")  # of a search's spec


@dataclass(frozen=True, eq=False)
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
    figures: dict[str, Array] = field(repr=False)  # name -> (n,), nan where a row has none; a lower `error` is better
    warnings: Mapping[int, tuple[str, ...]] = field(repr=False)  # row -> its warnings, if any
    failures: tuple[dict[str, Any], ...] = field(repr=False)  # quarantined cells: name, method, reasons, command
    failed: tuple[int, ...] = field(repr=False)  # quarantined cells of each method
    unfinished: tuple[str, ...]  # methods whose every cell is in quarantine
    is_search: bool = False
    searches: tuple[SuiteRun, ...] = field(default=(), repr=False)
    hits: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)  # (n, targets) evaluations, inf for never
    heads: tuple[str, ...] = ()  # the beginnings of the commands that run rows again
    head: Array = field(default_factory=lambda: np.empty(0, dtype=int), repr=False)  # (n,)
    joint_errors: Array = field(default_factory=lambda: np.empty((0, len(JOINTS))), repr=False)  # (n, 27) mm
    modes: Array = field(default_factory=lambda: np.empty((0, BINS, 3)), repr=False)  # (n, bins, 3): see `_binned`
    traces: tuple[tuple[Array, Array], ...] = field(default=(), repr=False)  # evaluations and best costs (k,) of a row

    def __len__(self) -> int:
        return len(self.keys)

    @property
    def table_figures(self) -> list[str]:
        """The figures that tables show: optional ones only if a row has them."""
        return [
            name for name in TABLE_FIGURES if not COLUMNS[name].optional or bool(np.isfinite(self.figures[name]).any())
        ]


def runs_of(ledger: "Ledger", *, may_be_empty: bool = False) -> Runs:
    """Return the finished rows of a ledger, in an order that does not depend on which of them finished first.

    If every cell failed there are no rows, but failures. Raises ValueError where there is neither, unless the ledger
    may be empty, and where it holds both tracks and single searches.
    """
    quarantined = ledger.quarantined()
    table: _Table | None = None
    for row in _checked(ledger, quarantined):
        table = table or _Table(is_search(row["spec"]))
        if row["status"] == "done":
            table.add(row)
    if table is None:
        if not may_be_empty:
            raise InputError(f"{ledger.path}: expected a ledger with finished rows, got one with none")
        table = _Table(False)
    return table.runs(ledger.version, quarantined)


def _checked(ledger: "Ledger", quarantined: Sequence[Mapping[str, Any]]) -> Iterable[Mapping[str, Any]]:
    """Yield all rows of a ledger and its quarantined cells, once it is known that they are of one kind."""
    kinds = set()
    for rows in (ledger.rows(), quarantined):
        for row in rows:
            kinds.add(is_search(row["spec"]))
            if len(kinds) > 1:
                raise InputError(
                    f"{ledger.path}: expected a ledger of tracks or one of single searches, got both in one"
                )
            yield row


class _Table:
    """Collects rows of one kind."""

    def __init__(self, searches: bool) -> None:
        self.is_search = searches
        self.variants: dict[str, int] = {}
        self.places: dict[str, int] = {}
        self.heads: dict[str, int] = {}
        self.known: dict[str, tuple[int, int]] = {}  # variant and head of a spec without instance and seed
        self.numbers: list[tuple[int, int, int]] = []  # variant, place and head of each row
        self.seeds: list[int] = []  # of any size: an array could not hold them
        self.keys: list[str] = []
        self.figures: list[list[float]] = []
        self.joints: list[Array] = []
        self.modes: list[Array] = []
        self.warnings: dict[int, tuple[str, ...]] = {}
        self.traces: list[tuple[Array, Array]] = []
        self.searches: list[SuiteRun] = []
        self.hits: list[Array] = []

    def add(self, row: Mapping[str, Any]) -> None:
        spec = row["spec"]
        kind = _text({name: value for name, value in spec.items() if name not in LAST_FIELDS})
        if kind not in self.known:
            head = "" if self.is_search else command_head(spec)
            self.known[kind] = _index(self.variants, _text(_variant(spec))), _index(self.heads, head)
        variant, head_index = self.known[kind]
        if row.get("warnings"):
            self.warnings[len(self.keys)] = tuple(row["warnings"])
        self.numbers.append((variant, _index(self.places, _text(_place(spec))), head_index))
        self.seeds.append(spec["seed"])
        self.keys.append(row["key"])
        if self.is_search:
            self._add_search(search_run(row))
        else:
            self._add_track(row)

    def _add_track(self, row: Mapping[str, Any]) -> None:
        self.figures.append([column.value(row) for column in COLUMNS.values()])
        self.joints.append(np.array(row.get("joint_errors_mm") or [np.nan] * len(JOINTS), dtype=np.float32))
        self.modes.append(_binned(row.get("mode_reliability") or []))
        trace = row.get("trace") or {"evaluations": [], "cost": []}
        self.traces.append((np.array(trace["evaluations"], np.float32), np.array(trace["cost"], np.float32)))

    def _add_search(self, run: SuiteRun) -> None:
        self.searches.append(run)
        self.hits.append(hits((run.evaluations, run.costs), run.targets))
        reached = 100.0 * float(np.isfinite(self.hits[-1]).mean())
        self.figures.append([100.0 - reached, reached, run.cost - run.best_known])

    def runs(self, version: str, quarantined: Sequence[Mapping[str, Any]]) -> Runs:
        names = ("error", "reached", "above") if self.is_search else FIGURES
        numbers = np.array(self.numbers, dtype=int).reshape(-1, 3)
        figures = np.array(self.figures, dtype=float).reshape(-1, len(names))
        variants, places = ([json.loads(text) for text in table] for table in (self.variants, self.places))
        error = np.nan_to_num(figures[:, names.index("error")], nan=np.inf)
        means = [float(np.mean(error[numbers[:, 0] == m])) for m in range(len(variants))]
        best_first = sorted(range(len(variants)), key=lambda m: (means[m], list(self.variants)[m]))
        place_texts, head_texts = list(self.places), list(self.heads)
        sorted_places = sorted(range(len(places)), key=lambda i: (_rank(places[i]), place_texts[i]))
        sorted_heads = sorted(range(len(head_texts)), key=head_texts.__getitem__)
        for column, ranking in enumerate((best_first, sorted_places, sorted_heads)):
            numbers[:, column] = np.argsort(ranking).astype(int)[numbers[:, column]]
        seeds = tuple(sorted(set(self.seeds)))
        seed_index = {seed: k for k, seed in enumerate(seeds)}
        seed = np.array([seed_index[one] for one in self.seeds], dtype=int)
        order = np.lexsort((seed, numbers[:, 0], numbers[:, 1]))
        variants, places = [variants[m] for m in best_first], [places[i] for i in sorted_places]
        method, instance, head = numbers[order].T
        failed = Counter(_text(_variant(cell["spec"])) for cell in quarantined)

        def sorted_rows(values: Sequence[Any]) -> tuple[Any, ...]:
            return tuple(values[k] for k in order) if values else ()

        return Runs(
            version=version,
            methods=distinct([one["method"] for one in variants], [_variation(one) for one in variants]),
            variants=tuple({**one, "settings": ", ".join(settings_text(one["settings"]))} for one in variants),
            instances=distinct([_place_name(one) for one in places], [_place_details(one) for one in places]),
            places=tuple(places),
            method=method,
            instance=instance,
            seed=seed[order],
            seeds=seeds,
            keys=sorted_rows(self.keys),
            figures=dict(zip(names, figures[order].T, strict=True)),
            warnings={row: self.warnings[k] for row, k in enumerate(order.tolist()) if k in self.warnings},
            failures=tuple(_failure(cell) for cell in quarantined),
            failed=tuple(failed[list(self.variants)[m]] for m in best_first),
            unfinished=tuple(sorted({json.loads(text)["method"] for text in failed if text not in self.variants})),
            is_search=self.is_search,
            searches=sorted_rows(self.searches),
            hits=np.array(sorted_rows(self.hits)),
            heads=tuple(head_texts[k] for k in sorted_heads),
            head=head,
            joint_errors=np.array(sorted_rows(self.joints)).reshape(-1, len(JOINTS)),
            modes=np.array(sorted_rows(self.modes)).reshape(-1, BINS, 3),
            traces=sorted_rows(self.traces),
        )


def _binned(modes: Sequence[Sequence[float]]) -> Array:
    """Return a row's likeliest modes by bins (bins, 3) of probability: frames, sum of probabilities, frames right."""
    bins = np.zeros((BINS, 3), dtype=np.float32)
    for count, probability, right in modes:
        bins[min(int(probability * BINS), BINS - 1)] += count * np.array([1.0, probability, right])
    return np.asarray(bins)


def _failure(cell: Mapping[str, Any]) -> dict[str, Any]:
    spec = cell["spec"]
    where = f"f{spec['function']} in {spec['dimension']}D" if is_search(spec) else spec["motion"]
    return {
        "name": f"{spec['method']} on {where}, instance {spec['instance']}, seed {spec['seed']}",
        "method": spec["method"],
        "reasons": list(dict.fromkeys(cell["reasons"])),
        "command": repeat_command(spec),
    }


def _variant(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a spec that make a method."""
    if is_search(spec):
        fields = {name: spec[name] for name in ("method", "settings", "infeasible", "version")}
        return {**fields, "budget": spec["evaluations"] / spec["dimension"]}
    return {name: spec[name] for name in _METHOD_FIELDS}


def _variation(variant: Mapping[str, Any]) -> list[str]:
    """Return the words that may distinguish a method from others of the same name."""
    if "budget" in variant:
        words = [f"{variant['budget']:g} evaluations for each dimension", f"infeasible: {variant['infeasible']}"]
    else:
        count = variant["hypotheses"]
        words = [f"{variant['evaluations']} evaluations", f"{count} {'hypothesis' if count == 1 else 'hypotheses'}"]
    return [*settings_text(variant["settings"]), *words, *variant["version"].split(", ")]


def _place(spec: Mapping[str, Any]) -> dict[str, Any]:
    """Return the fields of a spec that make an instance."""
    if is_search(spec):
        return {name: spec[name] for name in _PROBLEM_FIELDS}
    return {name: value for name, value in spec.items() if name not in (*_METHOD_FIELDS, "seed")}


def _rank(place: Mapping[str, Any]) -> tuple[Any, ...]:
    """Return what instances are sorted by: undamaged ones come before damaged ones."""
    if "suite" in place:
        return tuple(place[name] for name in _PROBLEM_FIELDS)
    damage = sorted(place["corruption"].items())
    return place["motion"], place["view_degrees"], len(damage), damage, place["instance"]


def _place_name(place: Mapping[str, Any]) -> str:
    if "suite" in place:
        return f"f{place['function']} in {place['dimension']}D, instance {place['instance']}"
    views = ", ".join(f"{view:g}°" for view in place["view_degrees"])
    damage = "".join(f", {kind} {strength:g}" for kind, strength in sorted(place["corruption"].items()))
    return f"{place['motion']}, view {views}{damage}, instance {place['instance']}"


def _place_details(place: Mapping[str, Any]) -> list[str]:
    fields = _PROBLEM_FIELDS[:3] if "suite" in place else _NAMED_FIELDS
    return [f"{name} {_text(value)}" for name, value in place.items() if name not in fields]


def distinct(names: Sequence[str], details: Sequence[Sequence[str]]) -> tuple[str, ...]:
    """Return names; those that occur twice have the details added that differ."""
    by_name: dict[str, list[Sequence[str]]] = {}
    for name, words in zip(names, details, strict=True):
        by_name.setdefault(name, []).append(words)
    common = {name: set(several[0]).intersection(*several[1:]) for name, several in by_name.items()}
    longer = [
        ", ".join([name, *(word for word in words if word not in common[name])])
        for name, words in zip(names, details, strict=True)
    ]
    counts, numbered = Counter(longer), Counter[str]()
    for k, name in enumerate(longer):
        if counts[name] > 1:
            numbered[name] += 1
            longer[k] = f"{name} ({numbered[name]})"
    return tuple(longer)


def _index(table: dict[str, int], key: str) -> int:
    return table.setdefault(key, len(table))


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)
