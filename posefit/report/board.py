"""The leaderboard of a suite: a page about bundles whose every claim was verified, beside posefit's own methods."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import as_file, files
from itertools import chain
from pathlib import Path
from typing import Any

from posefit.errors import InputError
from posefit.fitting.check import whole
from posefit.page.document import plain
from posefit.reading import counted
from posefit.report.content import search_data
from posefit.report.runs import runs_of_searches
from posefit.report.write import check_page, write_page
from posefit.suites.bundles import method_text
from posefit.suites.running import SuiteRun
from posefit.suites.verification import verified

OWN = "methods.zip"  # in `posefit.suites`, of `docs/studies/make_bundles.py`
ITSELF = "posefit itself"
PRINTED = ("header", "answer", "leaderboard", "baselines", "times")

Problem = tuple[int, int, int]  # function, dimension and instance


def write_board(paths: Sequence[str], out: str, repeat: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Write the leaderboard of bundles, files or folders of them, to a page, and return what the command prints.

    A method is ranked if it has a run on every problem that posefit's own methods have, within their budget; of several
    seeds the lowest counts. Bundles and methods that are not ranked are listed with the reason. With `repeat` so many
    searches of each bundle are run again: see `posefit.suites.verification.verified`. An earlier report of that name is
    replaced, nothing else is. Raises ValueError where the page cannot be written.
    """
    check_page(out)
    whole("repeat", repeat, 0)
    with as_file(files("posefit.suites") / OWN) as own:
        bundles = {ITSELF: verified(own)}
    budgets = {_problem(run): run.budget for run in bundles[ITSELF].runs}
    unranked, notes = [], []
    listed = [sorted(path.glob("*.zip")) if path.is_dir() else [path] for path in map(Path, paths)]
    for path in chain.from_iterable(listed):
        try:
            bundle = verified(path, repeat, lambda text: say(f"repeats {text}"))
            if twice := [name for name, known in bundles.items() if known.digest == bundle.digest]:
                raise InputError(f"{path}: expected each bundle once, got {twice[0]} again")
        except (InputError, OSError) as error:
            unranked.append(str(error).replace(str(path), path.name))
            continue
        name = path.stem if path.stem not in bundles else f"{path.stem} {bundle.digest[:8]}"
        bundles[name] = bundle
        notes += [f"Seeds of {name} are not checked. {reason}." for reason in bundle.unrepeatable]
    if len(bundles) == 1 and not unranked:
        say("expected bundles to rank, got none: the board shows posefit's own methods alone")
    ranked = []
    for name, bundle in bundles.items():
        methods: dict[str, list[SuiteRun]] = {}
        for run in bundle.runs:
            methods.setdefault(method_text(run), []).append(run)
        for of_method in methods.values():
            try:
                ranked += [(name, run) for run in _complete(of_method, budgets)]
            except InputError as error:
                unranked.append(f"{name}: {error}")
    for reason in unranked:
        say(f"not ranked: {reason}")
    runs = runs_of_searches(ranked)
    data = search_data(runs, f"Leaderboard of {bundles[ITSELF].suite}", time.strftime("%d %B %Y"))
    for method in data["methods"]:
        method["settings"] = "; ".join(filter(None, [method["settings"], method["bundle"]]))
    points = sum(bundle.evaluated for bundle in bundles.values())
    proof = "Points prove costs, but neither seeds nor how many evaluations were used."
    if repeat:
        count = sum(bundle.repeated for bundle in bundles.values())
        proof += f" Searches repeated from their seeds, which the bundles' digests chose: {count}."
    searches = f"{len(runs):,} searches by {counted(len(runs.methods), 'method')}"
    data["header"] |= {
        "summary": f"{searches}; {points:,} points were evaluated again, and each has the cost that was claimed.",
        "unranked": unranked,
        "notes": [*data["header"]["notes"], *notes, proof],
    }
    data["header"]["facts"] += [["bundles", "; ".join(f"{name} {one.digest[:12]}" for name, one in bundles.items())]]
    write_page(data, out)
    return {"out": out, **dict(plain({name: data[name] for name in PRINTED if name in data}))}


def _problem(run: SuiteRun) -> Problem:
    return run.function, run.dimension, run.instance


def _complete(runs: Sequence[SuiteRun], budgets: Mapping[Problem, int]) -> list[SuiteRun]:
    """Return a run of a method on each problem, that of the lowest seed, as if it had the budget of all.

    Raises InputError where there is none on some problem within that budget.
    """
    chosen: dict[Problem, SuiteRun] = {}
    for run in sorted(runs, key=lambda run: run.seed):
        if run.budget <= budgets.get(_problem(run), 0):
            chosen.setdefault(_problem(run), replace(run, budget=budgets[_problem(run)], seed=0))
    if missing := sorted(budgets.keys() - chosen.keys()):
        function, dimension, instance = missing[0]
        raise InputError(
            f"{runs[0].method} must have run within {budgets[missing[0]]} evaluations on f{function} in {dimension}D, "
            f"instance {instance}, got none, nor on {len(missing) - 1} more of {len(budgets)} problems"
        )
    return list(chosen.values())
