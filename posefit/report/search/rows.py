"""The rows of a ledger of single searches as runs, methods and problems told apart."""

import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.arrays import Array
from posefit.report.repeat import search_command
from posefit.report.runs import distinct
from posefit.statistics.profiles import hits
from posefit.suites.running import SuiteRun
from posefit.sweep.cell import settings_text
from posefit.sweep.table import is_search, search_run

if TYPE_CHECKING:
    from posefit.sweep.ledger import Ledger

PROBLEM = ("function", "dimension", "instance", "suite")  # what a problem is


@dataclass(frozen=True, eq=False)
class Searches:
    """All runs. Methods are told apart by settings, budget, what becomes of infeasible proposals, and version."""

    version: str
    methods: tuple[str, ...]  # named so that no two are alike
    variants: tuple[dict[str, Any], ...]  # of each method: method, settings, budget for each dimension, ...
    problems: tuple[tuple[int, int, int, str], ...]  # function, dimension, instance, suite
    method: Array  # (n,) of each run an index, as are the next two
    problem: Array  # (n,)
    seed: Array  # (n,)
    seeds: tuple[int, ...]  # there are, rising
    runs: tuple[SuiteRun, ...] = field(repr=False)
    hits: Array = field(repr=False)  # (n, targets) evaluations after which each target was reached, inf for never
    failures: tuple[dict[str, Any], ...] = field(repr=False)  # cells in quarantine: name, method, reasons, command
    failed: tuple[int, ...] = field(repr=False)  # how many cells of each method are in quarantine
    unfinished: tuple[str, ...]  # methods of which every cell is in quarantine

    def __len__(self) -> int:
        return len(self.runs)

    @property
    def reached(self) -> Array:
        """The share (n,) of its targets that each run reached, in per cent."""
        return np.asarray(100.0 * np.isfinite(self.hits).mean(axis=1)) if len(self) else np.zeros(0)


def holds_searches(ledger: "Ledger") -> bool:
    """Return whether the first row of a ledger, or else the first cell in quarantine, is a single search."""
    first = next(ledger.rows(), None) or next(iter(ledger.quarantined()), None)
    return first is not None and is_search(first["spec"])


def searches_of(ledger: "Ledger") -> Searches:
    """Return the runs of a ledger, in an order that does not depend on who finished first.

    Raises ValueError where it holds neither a row nor a failure, or a track.
    """
    rows = sorted(_alone(ledger, ledger.rows()), key=lambda row: _order(row["spec"]))
    lost = _alone(ledger, ledger.quarantined())
    if not rows and not lost:
        raise ValueError(f"{ledger.path}: expected a ledger with finished rows, got one with none")
    kinds = list(dict.fromkeys(_text(_variant(row["spec"])) for row in rows))
    problems = sorted({_problem(row["spec"]) for row in rows})
    seeds = sorted({row["spec"]["seed"] for row in rows})
    runs = tuple(search_run(row) for row in rows)
    variants = [json.loads(kind) for kind in kinds]
    failed = Counter(_text(_variant(one["spec"])) for one in lost)
    return Searches(
        version=ledger.version,
        methods=distinct([one["method"] for one in variants], [_told(one) for one in variants]),
        variants=tuple({**one, "settings": ", ".join(settings_text(one["settings"]))} for one in variants),
        problems=tuple(problems),
        method=_places(rows, kinds, lambda spec: _text(_variant(spec))),
        problem=_places(rows, problems, _problem),
        seed=_places(rows, seeds, lambda spec: spec["seed"]),
        seeds=tuple(seeds),
        runs=runs,
        hits=np.array([hits((run.evaluations, run.costs), run.targets) for run in runs]),
        failures=tuple(_failure(one) for one in lost),
        failed=tuple(failed[kind] for kind in kinds),
        unfinished=tuple(sorted({json.loads(kind)["method"] for kind in failed if kind not in kinds})),
    )


def _alone(ledger: "Ledger", rows: Any) -> list[dict[str, Any]]:
    found = list(rows)
    if not all(is_search(row["spec"]) for row in found):
        raise ValueError(f"{ledger.path}: expected a ledger of tracks or one of single searches, got both in one")
    return found


def _variant(spec: Mapping[str, Any]) -> dict[str, Any]:
    about = {name: spec[name] for name in ("method", "settings", "infeasible", "version")}
    return {**about, "budget": spec["evaluations"] / spec["dimension"]}


def _told(variant: Mapping[str, Any]) -> list[str]:
    """Return what tells a method from others of its name."""
    return [
        *settings_text(variant["settings"]),
        f"{variant['budget']:g} evaluations for each dimension",
        f"infeasible: {variant['infeasible']}",
        *variant["version"].split(", "),
    ]


def _problem(spec: Mapping[str, Any]) -> tuple[int, int, int, str]:
    function, dimension, instance, suite = (spec[name] for name in PROBLEM)
    return function, dimension, instance, suite


def _order(spec: Mapping[str, Any]) -> tuple[Any, ...]:
    return _text(_variant(spec)), _problem(spec), spec["seed"]


def _places(rows: Sequence[Mapping[str, Any]], known: Sequence[Any], of: Callable[[Any], Any]) -> Array:
    index = {one: k for k, one in enumerate(known)}
    return np.array([index[of(row["spec"])] for row in rows], dtype=int)


def _failure(lost: Mapping[str, Any]) -> dict[str, Any]:
    spec = lost["spec"]
    name = f"{spec['method']} on f{spec['function']} in {spec['dimension']}D"
    return {
        "name": f"{name}, instance {spec['instance']}, seed {spec['seed']}",
        "method": spec["method"],
        "reasons": list(dict.fromkeys(lost["reasons"])),
        "command": search_command(spec),
    }


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True)
