"""What `posefit report` says of a ledger of single searches, as data."""

from collections import Counter
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.report.answer.lead import not_told_apart
from posefit.report.answer.unpaired import unpaired_sentence
from posefit.report.colours import METHODS
from posefit.report.content import REASONS
from posefit.report.search.answer import search_sentence
from posefit.report.search.match import Match, instance_tests, left_out, match_of, random_rows, search_board
from posefit.report.search.rows import Searches
from posefit.statistics.pairing import Shared
from posefit.statistics.profiles import attained
from posefit.suites.functions import suite_function
from posefit.suites.problem import TARGETS
from posefit.suites.tally import SHOWN, suite_scores

POINTS = 61  # of a curve
SCORE = {  # what the first figure shows of methods
    "name": "reached",
    "said": "Shares of targets reached in per cent",
    "axis": "share of targets reached",
    "unit": " %",
    "digits": 1,
    "better": "more",
}

COLUMNS = {  # what tables show of methods
    "reached": {
        "title": "targets %",
        "about": "Share of all runs and targets that were reached",
        "digits": SCORE["digits"],
        "factor": 1.0,
        "down": True,
    },
    "above": {
        "title": "above",
        "about": "Median of the best costs above the best known one",
        "digits": 2,
        "factor": 1.0,
        "down": False,
    },
}


def data_of_searches(searches: Searches) -> dict[str, Any]:
    """Return everything that the page shows of single searches."""
    match = match_of(searches)
    return {
        "header": _header(searches, match),
        "methods": [{"name": name, **about} for name, about in zip(searches.methods, searches.variants, strict=True)],
        "instances": [{"name": _name(*problem)} for problem in searches.problems],
        "colours": len(METHODS),
        "trivial": {"random": "random search"},
        "score": SCORE,
        "columns": COLUMNS,
        **({} if match is None else _compared(match)),
        "warnings": [],
        "warned": {},
        "live": None,
        "failures": searches.failures,
    }


def _header(searches: Searches, match: Match | None) -> dict[str, Any]:
    functions = sorted({function for function, *_ in searches.problems})
    return {
        "version": searches.version,
        "versions": sorted({str(one["version"]) for one in searches.variants}),
        "suites": sorted({suite for *_, suite in searches.problems}),
        "functions": [{"number": number, "name": suite_function(number).name} for number in functions],
        "dimensions": sorted({dimension for _, dimension, *_ in searches.problems}),
        "instances": len({(function, instance) for function, _, instance, _ in searches.problems}),
        "budgets": sorted({float(one["budget"]) for one in searches.variants}),
        "infeasible": sorted({str(one["infeasible"]) for one in searches.variants}),
        "seed_count": len(searches.seeds),
        "targets": len(TARGETS),
        "easiest": float(TARGETS[0]),
        "hardest": float(TARGETS[-1]),
        "done": len(searches),
        "failed": len(searches.failures),
        "failed_by": Counter(one["method"] for one in searches.failures),
        "reasons": Counter(reason for one in searches.failures for reason in one["reasons"]).most_common(REASONS),
        "unfinished": searches.unfinished,
        "dropped": [] if match is None else left_out(match),
        "unpaired": "" if match is None else _unpaired(match.shared),
        "shared": None if match is None else int(match.shared.rows.size),
        "apart": [] if match is None else [m for m in range(len(searches.methods)) if m not in match.methods],
    }


def _unpaired(shared: Shared) -> str:
    return unpaired_sentence(shared.left_out, shared.blocks.size - shared.rows.size, shared.rows.shape[2], tested=False)


def _name(function: int, dimension: int, instance: int, _: str) -> str:
    return f"f{function} in {dimension}D, instance {instance}"


def _compared(match: Match) -> dict[str, Any]:
    tests = instance_tests(match)
    board = search_board(match, tests)
    bases = random_rows(match, board)
    evaluations = _grid(match)
    return {
        "answer": search_sentence(match, board, bases, tests),
        "alike": not_told_apart(tests, board[0]["method"]),
        "leaderboard": board,
        "baselines": bases,
        "taking_part": match.methods,
        "evaluations": evaluations,
        "curves": _curves(match, evaluations),
        "above": SHOWN,
        "times": [one for m in match.methods for one in _times(match, m)],
    }


def _grid(match: Match) -> Array:
    """Return numbers of evaluations for each dimension (up to 61,), evenly on a log scale, from 1 to the longest."""
    runs = [match.searches.runs[int(k)] for k in match.shared.rows.ravel()]
    most = max(float(run.evaluations[-1]) / run.dimension for run in runs)
    return np.unique(np.geomspace(1.0, max(most, 1.0), POINTS))


def _curves(match: Match, evaluations: Array) -> list[dict[str, Any]]:
    """Return the shares (methods, p) of targets reached within evaluations, of all functions and then of each."""
    dimension = np.array([problem[1] for problem in match.problems], dtype=np.float64)
    spent = match.searches.hits[match.shared.rows] / dimension[None, :, None, None]
    functions = np.array([problem[0] for problem in match.problems])
    parts = [("All functions", functions > 0)]
    numbers = np.unique(functions).tolist()
    if len(numbers) > 1:
        parts += [(f"{number} {suite_function(number).name}", functions == number) for number in numbers]
    return [
        {"title": title, "shares": [attained(one[chosen], evaluations) for one in spent]} for title, chosen in parts
    ]


def _times(match: Match, method: int) -> list[dict[str, Any]]:
    """Return what the shared runs of a method come to, a row each dimension and function: see `suite_scores`."""
    scores = suite_scores(match.searches.runs[int(k)] for k in match.mine(method))
    return [
        {
            "method": method,
            "function": one.function,
            "name": one.name,
            "dimension": one.dimension,
            "runs": one.runs,
            "reached": 100.0 * one.reached,
            "above": one.above,
            "times": [one.running_times[above] for above in SHOWN],
        }
        for one in scores
    ]
