"""The data of a report's page: what was run, the leader, how certain that is, and every run."""

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, PARENTS, SIDES
from posefit.registry import claimed_orders
from posefit.report import curves
from posefit.report.animations import animations_of
from posefit.report.columns import COLUMNS, SEARCH_COLUMNS
from posefit.report.contest import (
    RANDOM,
    Contest,
    baseline_rows,
    contest_of,
    leaderboard,
    missing_instances,
    paired_tests,
    resamples,
)
from posefit.report.page import COLOURS
from posefit.report.runs import Runs
from posefit.report.selection import selection_of
from posefit.report.summary import (
    counted,
    leader_sentence,
    not_worse,
    published_claims,
    three_tracks,
    unpaired_sentence,
)
from posefit.statistics.intervals import Intervals
from posefit.suites.functions import suite_function
from posefit.suites.problem import TARGETS
from posefit.suites.tally import SHOWN
from posefit.sweep.ledger import Ledger
from posefit.tracking.measures import BASELINES

REASONS = 5  # of failures, the most frequent ones, that the first screen names
MAX_SEEDS = 50  # that the facts list
FEW_RUNS = 20  # of a method, below which intervals are called wide

_NOT_WORSE = "Methods in bold are not shown to be worse than the best one."
TRACK_SCORE = {  # what the first figure shows of methods, and the texts of the page that depend on it
    "name": "error",
    "label": "Errors in degrees",
    "axis": "error in degrees",
    "unit": "°",
    "digits": 2,
    "better": "less",
    "alone": "one seed",  # in place of an interval
    "paired": "runs",
    "caption": "Interquartile mean of a method's errors with its 95 % interval; dashed lines are baselines. "
    f"{_NOT_WORSE}",
    "leaderboard": "Each figure is the interquartile mean of a method's runs; shares of frames and joints are means. "
    "Skill is 1 − error / baseline: 0 is no better than the baseline, which uses the true root and translation. ",
    "curves": "",
}
SEARCH_SCORE = {
    "name": "reached",
    "label": "Shares of targets reached in per cent",
    "axis": "share of targets reached",
    "unit": " %",
    "digits": 1,
    "better": "more",
    "alone": "one instance",
    "paired": "instances",
    "leaderboard": "Shares of targets are means over all runs and targets. Above is the median of the best costs above "
    "the best known one. ",
    "curves": "The share of all runs and targets that a method has reached after so many evaluations for each "
    "dimension of the problem, all dimensions together: the empirical distribution of running times. A higher curve "
    "reaches more targets in the same time. The scale is the same for every function.",
}


def data_of(ledger: Ledger, runs: Runs, warn: Callable[[str], None]) -> dict[str, Any]:
    """Return the data of the page about a ledger's runs."""
    contest = contest_of(runs)
    header = _header(runs, contest)
    compared = {} if contest is None else _compared(contest)
    own = _searches(contest, compared) if runs.is_search else _tracks(ledger, runs, contest, compared, warn)
    warnings = list(dict.fromkeys(text for texts in runs.warnings.values() for text in texts))
    nothing = "Every cell failed." if runs.failures else "No run has an error yet: there is nothing to compare."
    return {
        "title": "Report of single searches" if runs.is_search else "Report of a sweep",
        "headline": compared.get("answer", nothing),
        "header": header,
        "methods": [{"name": name, **fields} for name, fields in zip(runs.methods, runs.variants, strict=True)],
        "instances": [{"name": name} for name in runs.instances],
        "joints": JOINTS,
        "parents": PARENTS,
        "sides": SIDES,
        "colours": COLOURS,
        **compared,
        **own,
        "sections": [*own["sections"], *(["failures"] if runs.failures else [])],
        "warnings": warnings,
        "warned": {row: [warnings.index(text) for text in texts] for row, texts in runs.warnings.items()},
        "live": None,
        "failures": runs.failures,
    }


def _compared(contest: Contest) -> dict[str, Any]:
    """Return what tracks and single searches have in common where methods share runs."""
    board = leaderboard(contest)
    bases = baseline_rows(contest, board)
    tests = paired_tests(contest) if contest.testable else None
    return {
        "answer": leader_sentence(contest, board, bases, tests),
        "not_worse": not_worse(tests, board[0]["method"]),
        "leaderboard": board,
        "baselines": bases,
        "pairs": tests,
        "taking_part": contest.methods,
    }


def _tracks(
    ledger: Ledger, runs: Runs, contest: Contest | None, compared: dict[str, Any], warn: Callable[[str], None]
) -> dict[str, Any]:
    """Return the data that only tracks have."""
    data: dict[str, Any] = {} if contest is None else _track_curves(contest, compared["leaderboard"][0]["method"])
    animations = animations_of(ledger, runs, warn, first=[row for _, row in data.get("examples", [])])
    sections = (
        ["leaderboard", "comparison", "selection", "curves", "joints", "certainty"] if contest is not None else []
    )
    absent = {"selection": "selection", "joints": "joint_errors", "certainty": "certainty"}
    instances: list[dict[str, Any]] = [
        {"name": name, "number": _exact(place["instance"])}
        for name, place in zip(runs.instances, runs.places, strict=True)
    ]
    for name in BASELINES:
        for instance, value in zip(instances, _by_instance(runs, f"baseline_{name}"), strict=True):
            instance[name] = value
    names = runs.table_figures
    rows: dict[str, Any] = {name: getattr(runs, name) for name in ("method", "instance", "head", "seed")}
    rows |= {name: np.round(runs.figures[name], COLUMNS[name].stored_digits) for name in names}
    return {
        **data,
        "sections": [name for name in sections if name not in absent or data[absent[name]]]
        + (["gallery", "author", "rows"] if runs.methods else []),
        "instances": instances,
        "columns": {name: COLUMNS[name].as_dict() for name in names},
        "baseline_names": BASELINES,
        "score": TRACK_SCORE,
        "rows": {**rows, "key": [key[:8] for key in runs.keys]},
        "seeds": [_exact(seed) for seed in runs.seeds],
        "heads": runs.heads,
        "animations": animations,
    }


def _track_curves(contest: Contest, leader: int) -> dict[str, Any]:
    some = _drawn(contest)
    evaluations = curves.grid(some)
    under = "evaluations of a frame"
    charts: list[dict[str, Any]] = [
        {
            "id": "convergence",
            "title": "Convergence: best cost of a frame",
            "label": "best cost",
            "series": [_plain(curve) for curve in curves.convergence(some, evaluations)],
        },
        {
            "id": "ecdf",
            "title": "Targets reached, of all runs and 51 costs an instance",
            "label": "share of targets reached",
            "series": [{"values": shares} for shares in curves.reached(some, evaluations)],
            "most": 1,
            "stepped": True,
        },
    ]
    return {
        "examples": three_tracks(contest, leader),
        "claims": published_claims(contest, claimed_orders()),
        "selection": selection_of(contest),
        "evaluations": evaluations,
        "charts": [{**chart, "under": under} for chart in charts] if len(evaluations) else [],
        "joint_errors": [_plain(curve) for curve in curves.joint_errors(some)],
        "certainty": curves.certainty(contest),
    }


def _drawn(contest: Contest) -> Contest:
    """Return the contest whose curves are drawn: all of it, unless it has very many runs."""
    return contest.fewer(max(curves.POINTS, len(JOINTS)))


def _searches(contest: Contest | None, compared: dict[str, Any]) -> dict[str, Any]:
    """Return the data that only single searches have."""
    data = {
        "sections": [],
        "columns": {name: column.as_dict() for name, column in SEARCH_COLUMNS.items()},
        "baseline_names": {RANDOM: "random search"},
        "score": SEARCH_SCORE,
    }
    if contest is None:
        return data
    evaluations = curves.search_grid(contest)
    charts = curves.search_curves(contest, evaluations)
    ends = [float(shares[-1]) for chart in charts for shares in chart["shares"]]
    interval = "; one instance of a function says nothing about others, so there are no intervals."
    if any(row["low"] is not None and np.isfinite(row["low"]) for row in compared["leaderboard"]):
        interval = " with the 95 % interval that other instances would give."
    baseline = "There is no baseline, for the plan has no random search."
    if compared["baselines"]:
        baseline = "The dashed line is random search."
    caption = f"Share of all runs and targets that a method reached{interval} {baseline} {_NOT_WORSE}"
    return {
        **data,
        "sections": ["leaderboard", "curves", "times"],
        "score": {**SEARCH_SCORE, "caption": caption},
        "evaluations": evaluations,
        "charts": [
            {
                "id": f"chart-{k}",
                "title": chart["title"],
                "label": "share of targets reached",
                "under": "evaluations for each dimension",
                "series": [{"values": shares} for shares in chart["shares"]],
                "most": min(1.0, 1.1 * max(0.05, *ends)),
                "stepped": True,
            }
            for k, chart in enumerate(charts)
        ],
        "above": SHOWN,
        "times": curves.running_times(contest),
    }


def _header(runs: Runs, contest: Contest | None) -> dict[str, Any]:
    facts = _search_facts(runs) if runs.is_search else _track_facts(runs)
    failed = f"{counted(len(runs.failures), 'cell')} failed" if runs.failures else "no cell failed"
    kind = "searches" if runs.is_search else "tracks"
    on = (
        f"{counted(len({place['function'] for place in runs.places}), 'function')}, "
        f"{counted(len({(place['function'], place['instance']) for place in runs.places}), 'instance')}"
        if runs.is_search
        else f"{counted(len(runs.instances), 'instance')} of {counted(len(_all(runs, 'motion')), 'motion')}"
    )
    spare = 0 if contest is None else contest.blocks.size - contest.rows.size
    return {
        "version": runs.version,
        "summary": f"{len(runs):,} {kind} by {counted(len(runs.methods), 'method')} on {on}; {failed}.",
        "facts": [[name, text if isinstance(text, str) else "; ".join(text)] for name, text in facts],
        "notes": _notes(runs, contest),
        "done": len(runs),
        "failed": len(runs.failures),
        "failed_by": Counter(failure["method"] for failure in runs.failures),
        "reasons": Counter(reason for failure in runs.failures for reason in failure["reasons"]).most_common(REASONS),
        "unfinished": runs.unfinished,
        "dropped": [] if contest is None else missing_instances(contest),
        "unpaired": ""
        if contest is None
        else unpaired_sentence(contest.left_out, spare, contest.rows.shape[2], tested=not runs.is_search),
    }


def _all(runs: Runs, name: str) -> list[str]:
    return sorted({str(place[name]) for place in runs.places})


def _track_facts(runs: Runs) -> list[tuple[str, str | Sequence[str]]]:
    """Return names and texts of what was run."""
    frames = np.array([place["frames"] for place in runs.places])[runs.instance] if runs.places else np.empty(0)
    hours = float(np.nansum(runs.figures["ms"] * frames) / 3.6e6)
    seeds = ", ".join(map(str, runs.seeds[:MAX_SEEDS]))
    damage = {
        ", ".join(f"{kind} {share:g}" for kind, share in sorted(place["corruption"].items())) or "none"
        for place in runs.places
    }
    return [
        ("methods", runs.methods),
        ("motions", _all(runs, "motion")),
        ("views, degrees", sorted({", ".join(f"{view:g}" for view in place["view_degrees"]) for place in runs.places})),
        ("corruptions", sorted(damage)),
        ("frames", _all(runs, "frames")),
        ("translation", _all(runs, "translation")),
        ("seeds", seeds + (f", … ({len(runs.seeds):,})" if len(runs.seeds) > MAX_SEEDS else "")),
        (
            "evaluations a frame",
            [f"{budget:,}" for budget in sorted({int(one["evaluations"]) for one in runs.variants})],
        ),
        ("posefit", _versions(runs)),
        ("time of the searches", f"{60 * hours:.1f} minutes" if hours < 0.1 else f"{hours:.1f} hours"),
    ]


def _search_facts(runs: Runs) -> list[tuple[str, str | Sequence[str]]]:
    functions = sorted({place["function"] for place in runs.places})
    return [
        ("suite", _all(runs, "suite")),
        ("methods", runs.methods),
        ("functions", [f"{number} {suite_function(number).name}" for number in functions]),
        ("dimensions", [str(one) for one in sorted({place["dimension"] for place in runs.places})]),
        ("seeds", f"{len(runs.seeds):,}"),
        (
            "evaluations for each dimension",
            [f"{budget:g}" for budget in sorted({one["budget"] for one in runs.variants})],
        ),
        ("infeasible proposals", sorted({str(one["infeasible"]) for one in runs.variants})),
        (
            "targets of a problem",
            f"{len(TARGETS)} costs, from {TARGETS[0]:g} to {TARGETS[-1]:g} above the best known",
        ),
        ("posefit", _versions(runs)),
    ]


def _versions(runs: Runs) -> list[str]:
    return sorted({str(one["version"]) for one in runs.variants})


def _notes(runs: Runs, contest: Contest | None) -> list[str]:
    """Return the notes on what can be concluded."""
    notes = []
    if contest is None:
        notes.append("No run has an error: nothing can be compared.")
    else:
        (methods, instances, seeds), size = contest.rows.shape, contest.rows.size
        if size < len(runs):
            each = f"{counted(instances, 'instance')} with {counted(seeds, 'seed')} each"
            notes.append(f"Methods are compared on the {size:,} of {len(runs):,} runs that all of them share: {each}.")
        apart = [name for m, name in enumerate(runs.methods) if m not in contest.methods]
        if apart:
            notes.append(
                f"Too few runs in common with the others, so not compared: {'; '.join(apart)}. "
                "Their rows of the leaderboard use their own runs."
            )
        if not runs.is_search:
            if seeds == 1:
                notes.append("One seed says nothing about others: there are no intervals.")
            elif size / methods < FEW_RUNS:
                notes.append(f"Fewer than {FEW_RUNS} runs of each method: the intervals are wide.")
            if resamples(size) < 2000:
                notes.append(f"So many runs have {resamples(size)} bootstrap resamples instead of 2,000.")
            drawn = _drawn(contest).rows.shape
            if drawn[1] * drawn[2] < instances * seeds:
                notes.append(f"Curves and joints use {drawn[1]:,} instances with {drawn[2]:,} seeds each, not all.")
    if len({one["budget"] if runs.is_search else one["evaluations"] for one in runs.variants}) > 1:
        notes.append("Budgets differ: compare methods of one budget only, as a longer search has lower costs.")
    if len({one.get("infeasible") for one in runs.variants}) > 1:
        notes.append("Infeasible proposals are treated differently: compare methods that treat them in the same way.")
    if len(_versions(runs)) > 1:
        notes.append("Commands run rows again if the same versions are installed.")
    return notes


def _exact(number: int) -> int | str:
    """Return a number that a browser does not round: a text, where its floats would."""
    return number if abs(number) < 2**53 else str(number)


def _by_instance(runs: Runs, figure: str) -> Array:
    """Return the mean of a figure on each instance (instances,), nan where no row has it."""
    values = runs.figures[figure]
    known = np.isfinite(values)
    count = len(runs.instances)
    total = np.bincount(runs.instance[known], values[known], minlength=count)
    rows = np.bincount(runs.instance[known], minlength=count)
    return np.where(rows > 0, total / np.maximum(rows, 1), np.nan)


def _plain(curve: Intervals | None) -> dict[str, Any] | None:
    return None if curve is None else {"values": curve.values, "low": curve.low, "high": curve.high}
