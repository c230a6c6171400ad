"""The data of a report's page: what was run, the leader, how certain that is, and every run."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES
from posefit.geometry.skeleton import JOINTS, PARENTS, SIDES
from posefit.measuring.centres import PLACES
from posefit.reading import counted
from posefit.report import curves
from posefit.report.animations import animations_of
from posefit.report.columns import COLUMNS, SEARCH_COLUMNS
from posefit.report.contest import (
    RANDOM,
    Contest,
    baseline_rows,
    contest_of,
    function_shares,
    leaderboard,
    paired_tests,
    resamples,
)
from posefit.report.page import COLOURS
from posefit.report.runs import Runs, damage, views
from posefit.report.summary import leader_sentences, three_tracks, unpaired_sentence
from posefit.statistics.intervals import RESAMPLES
from posefit.suites.functions import suite_function
from posefit.suites.problem import TARGETS
from posefit.suites.running import SHOWN
from posefit.sweep.ledger import Ledger

REASONS = 5  # of failures, the most frequent ones, that the first screen names
MAX_SEEDS = 50  # that the facts list
FEW_RUNS = 20  # of a method, below which intervals are called wide
POINTS = max(curves.POINTS, len(JOINTS))  # at which very many runs are drawn by some of them


def data_of(ledger: Ledger, runs: Runs, warn: Callable[[str], None]) -> dict[str, Any]:
    """Return the data of the page about a ledger's runs."""
    contest = contest_of(runs)
    answer = "Every cell failed." if runs.failures else "No run has an error yet: there is nothing to compare."
    data: dict[str, Any] = {"answer": [answer]}
    if contest is not None:
        board, baselines = leaderboard(contest), baseline_rows(contest)
        data = {
            "answer": leader_sentences(contest, board, baselines),
            "leaderboard": board,
            "baselines": baselines,
            "taking_part": contest.methods,
        }
    changed = time.localtime(ledger.changed)
    warnings = list(dict.fromkeys(text for texts in runs.warnings.values() for text in texts))
    leader = data["leaderboard"][0]["method"] if contest else 0
    part = _searches(runs, contest) if runs.is_search else _tracks(ledger, runs, contest, leader, warn)
    summary = f"{len(runs):,} {part.pop('kind')} by {counted(len(runs.methods), 'method')} on {part.pop('on')}"
    notes = [*_notes(runs, contest), *part.pop("notes", [])]
    sections = [name for name, known in part.pop("sections").items() if known]
    return {
        **data,
        "made": f"{ledger.path.resolve().name}, {time.strftime('%d %B %Y', changed)}",
        "header": _header(runs, contest, summary, part.pop("facts"), notes),
        "methods": [{"name": name, **fields} for name, fields in zip(runs.methods, runs.variants, strict=True)],
        "joints": [place.replace("_", " ") for place in PLACES],
        "parents": PARENTS,
        "sides": SIDES,
        "colours": COLOURS,
        "columns": {name: runs.columns[name].as_dict() for name in part.pop("figures")},
        "score": runs.score,
        "warnings": warnings,
        "warned": {row: [warnings.index(text) for text in texts] for row, texts in runs.warnings.items()},
        "failures": runs.failures,
        **part,
        "sections": sections + (["failures"] if runs.failures else []),
    }


def _tracks(
    ledger: Ledger, runs: Runs, contest: Contest | None, leader: int, warn: Callable[[str], None]
) -> dict[str, Any]:
    """Return what the page has of tracks: the rows, their animations, and the sections."""
    curves_data = {} if contest is None else _track_curves(contest, leader)
    baselines = {name: _by_instance(runs, f"baseline_{name}") for name in BASELINES}
    rows = {name: getattr(runs, name) for name in ("method", "instance", "head", "seed")}
    rows |= {name: np.round(runs.figures[name], COLUMNS[name].stored_digits) for name in runs.table_figures}
    return {
        "title": "Report of a sweep",
        "kind": "tracks",
        "on": f"{counted(len(runs.instances), 'instance')} of {counted(len(_all(runs, 'motion')), 'motion')}",
        "facts": _track_facts(runs),
        "figures": runs.table_figures,
        "sections": {
            **dict.fromkeys(("leaderboard", "comparison", "curves"), contest is not None),
            **{"joints": curves_data.get("joint_errors"), "certainty": curves_data.get("certainty")},
            **dict.fromkeys(("gallery", "rows"), bool(runs.methods)),
        },
        "instances": [
            {"name": name, "number": _exact(place["instance"]), **{base: means[i] for base, means in baselines.items()}}
            for i, (name, place) in enumerate(zip(runs.instances, runs.places, strict=True))
        ],
        "baseline_names": BASELINES,
        "rows": {**rows, "key": [key[:8] for key in runs.keys]},
        "seeds": [_exact(seed) for seed in runs.seeds],
        "heads": runs.heads,
        "animations": animations_of(ledger, runs, warn, first=[row for _, row in curves_data.get("examples", [])]),
        **curves_data,
    }


def _track_curves(contest: Contest, leader: int) -> dict[str, Any]:
    drawn = contest.fewer(POINTS)
    evaluations = curves.grid(drawn)
    convergence = {
        "id": "convergence",
        "title": "Convergence: best cost of a frame",
        "label": "best cost",
        "under": "evaluations of a frame",
        "series": [curve and vars(curve) for curve in curves.convergence(drawn, evaluations)],
    }
    shares = [{"values": values} for values in curves.reached(drawn, evaluations)]
    title = "Targets reached, of all runs and 51 costs an instance"
    charts = [convergence, _shares_chart("ecdf", title, "evaluations of a frame", shares, 1)]
    return {
        "notes": _track_notes(contest),
        "pairs": paired_tests(contest),
        "examples": three_tracks(contest, leader),
        "evaluations": evaluations,
        "charts": charts if len(evaluations) else [],
        "joint_errors": [vars(errors) for errors in curves.joint_errors(drawn)],
        "certainty": curves.certainty(contest),
    }


def _shares_chart(chart_id: str, title: str, under: str, series: Sequence[Any], most: float) -> dict[str, Any]:
    return {
        "id": chart_id,
        "title": title,
        "label": "share of targets reached",
        "under": under,
        "series": series,
        "most": most,
        "stepped": True,
    }


def _searches(runs: Runs, contest: Contest | None) -> dict[str, Any]:
    """Return what the page has of single searches: curves, running times, and the sections."""
    functions, problems = _all(runs, "function"), {(place["function"], place["instance"]) for place in runs.places}
    part: dict[str, Any] = {
        "title": "Report of single searches",
        "kind": "searches",
        "on": f"{counted(len(functions), 'function')}, {counted(len(problems), 'instance')}",
        "facts": _search_facts(runs),
        "figures": list(SEARCH_COLUMNS),
        "sections": {},
        "instances": [{"name": name} for name in runs.instances],
        "baseline_names": {RANDOM: "random search"},
    }
    if contest is None:
        return part
    evaluations = curves.search_grid(contest)
    charts = curves.search_curves(contest, evaluations)
    most = min(1.0, 1.1 * max(0.05, *(float(series.values[-1]) for _, shares in charts for series in shares)))
    under = "evaluations for each dimension"
    return {
        **part,
        "sections": {"leaderboard": True, "curves": True, "by-function": len(charts) > 1, "times": True},
        "by_function": function_shares(contest),
        "evaluations": evaluations,
        "charts": [
            _shares_chart(f"chart-{k}", title, under, [vars(series) for series in shares], most)
            for k, (title, shares) in enumerate(charts)
        ],
        "above": SHOWN,
        "times": curves.running_times(contest),
    }


def _header(
    runs: Runs, contest: Contest | None, summary: str, facts: Mapping[str, Any], notes: list[str]
) -> dict[str, Any]:
    failed = f"{counted(len(runs.failures), 'cell')} failed" if runs.failures else "no cell failed"
    return {
        "version": runs.version,
        "summary": f"{summary}; {failed}.",
        "facts": [[name, text if isinstance(text, str) else "; ".join(map(str, text))] for name, text in facts.items()],
        "notes": notes,
        "done": len(runs),
        "failed": len(runs.failures),
        "failed_by": Counter(failure["method"] for failure in runs.failures),
        "reasons": Counter(reason for failure in runs.failures for reason in failure["reasons"]).most_common(REASONS),
        "unfinished": runs.unfinished,
        "dropped": [
            {"instance": runs.instances[i], "missing": [runs.methods[m] for m in methods]}
            for i, methods in (contest.missing if contest else ())
        ],
        "unpaired": unpaired_sentence(contest) if contest else "",
    }


def _track_facts(runs: Runs) -> dict[str, Any]:
    frames = np.array([place["frames"] for place in runs.places], dtype=int)[runs.instance]
    hours = float(np.nansum(runs.figures["ms"] * frames) / 3.6e6)
    seeds = ", ".join(map(str, runs.seeds[:MAX_SEEDS]))
    return {
        "methods": runs.methods,
        "motions": _all(runs, "motion"),
        "views, degrees": sorted({", ".join(views(place)) for place in runs.places}),
        "corruptions": sorted({", ".join(damage(place)) or "none" for place in runs.places}),
        "frames": sorted(map(str, _all(runs, "frames"))),
        "translation": _all(runs, "translation"),
        "seeds": seeds + (f", … ({len(runs.seeds):,})" if len(runs.seeds) > MAX_SEEDS else ""),
        "evaluations a frame": [f"{budget:,}" for budget in _of_methods(runs, "evaluations")],
        "posefit": _of_methods(runs, "version"),
        "time of the searches": f"{60 * hours:.1f} minutes" if hours < 0.1 else f"{hours:.1f} hours",
    }


def _search_facts(runs: Runs) -> dict[str, Any]:
    return {
        "suite": _all(runs, "suite"),
        "methods": runs.methods,
        "functions": [f"{number} {suite_function(number).name}" for number in _all(runs, "function")],
        "dimensions": _all(runs, "dimension"),
        "seeds": f"{len(runs.seeds):,}",
        "evaluations for each dimension": [f"{budget:g}" for budget in _of_methods(runs, "budget")],
        "infeasible proposals": _of_methods(runs, "infeasible"),
        "targets of a problem": f"{len(TARGETS)} costs, {TARGETS[0]:g} to {TARGETS[-1]:g} above the true pose's",
        "posefit": _of_methods(runs, "version"),
    }


def _all(runs: Runs, field: str) -> list[Any]:
    return sorted({place[field] for place in runs.places})


def _of_methods(runs: Runs, field: str) -> list[Any]:
    return sorted({fields[field] for fields in runs.variants})


def _notes(runs: Runs, contest: Contest | None) -> list[str]:
    notes = []
    if contest is None:
        notes.append("No run has an error: nothing can be compared.")
    else:
        (_, instances, seeds), size = contest.rows.shape, contest.rows.size
        if size < len(runs):
            each = f"{counted(instances, 'instance')} with {counted(seeds, 'seed')} each"
            notes.append(f"Methods are compared on the {size:,} of {len(runs):,} runs that all of them share: {each}.")
        apart = [name for m, name in enumerate(runs.methods) if m not in contest.methods]
        if apart:
            notes.append(
                f"Too few runs in common with the others, so not compared: {'; '.join(apart)}. "
                "Their rows of the leaderboard use their own runs."
            )
    if len({fields.get("budget", fields.get("evaluations")) for fields in runs.variants}) > 1:
        notes.append("Budgets differ: compare methods of one budget only, as a longer search has lower costs.")
    if len({fields.get("infeasible") for fields in runs.variants}) > 1:
        notes.append("Infeasible proposals are treated differently: compare methods that treat them in the same way.")
    if len(_of_methods(runs, "version")) > 1:
        notes.append("Commands run rows again if the same versions are installed.")
    return notes


def _track_notes(contest: Contest) -> list[str]:
    """Return what limits the figures of tracks."""
    (methods, instances, seeds), size = contest.rows.shape, contest.rows.size
    notes = []
    if seeds > 1 and size / methods < FEW_RUNS:
        notes.append(f"Fewer than {FEW_RUNS} runs of each method: the intervals are wide.")
    if resamples(size) < RESAMPLES:
        notes.append(f"So many runs have {resamples(size)} bootstrap resamples instead of {RESAMPLES:,}.")
    drawn = contest.fewer(POINTS).rows.shape
    if drawn[1] * drawn[2] < instances * seeds:
        notes.append(f"Curves and joints use {drawn[1]:,} instances with {drawn[2]:,} seeds each, not all.")
    return notes


def _exact(number: int) -> int | str:
    """Return a number that a browser does not round: a text, where its floats would."""
    return number if abs(number) < 2**53 else str(number)


def _by_instance(runs: Runs, figure: str) -> Array:
    """Return the mean of a figure on each instance (instances,), nan where no row has it."""
    values = runs.figures[figure]
    known = np.isfinite(values)
    total, count = (
        np.bincount(runs.instance[known], weights, minlength=len(runs.instances)) for weights in (values[known], None)
    )
    return np.asarray(np.divide(total, count, out=np.full(len(total), np.nan), where=count > 0))
