"""The methods of a sweep compared on the runs that they share."""

import math
from dataclasses import astuple
from typing import Any

from posefit.report.kind import Contest, Runs
from posefit.statistics.pairing import most_shared


def contest_of(runs: Runs) -> Contest | None:
    """Return the contest of as many methods as share enough runs; None if no run has an error.

    A method that would leave less than half of the runs that the others share does not take part.
    """
    shared = most_shared(runs.method, runs.instance, runs.seed, runs.figures["error"])
    return None if shared is None else Contest(**vars(shared), runs=runs)


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each method, best first; those that do not take part come last, with their own runs.

    Figures are averages, the score has an interval, and the kind of runs adds its own by `Kind.board`. `behind` is the
    median difference from the leader in paired runs with its interval, `p` is Wilcoxon's after Holm.
    """
    runs = contest.runs
    score = contest.runs.kind.score
    more = runs.kind.board(contest)
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        rows = contest.rows_of(m)
        row = {
            "method": m,
            "name": name,
            "runs": len(rows),
            "failed": runs.failed[m],
            "warned": sum(k in runs.warnings for k in rows.tolist()),
            "taking_part": m in contest.methods,
        }
        row |= {
            figure: column.average(runs.figures[figure][rows])
            for figure, column in runs.kind.columns.items()
        }
        board.append({**row, **more[m]})
    sign = -1.0 if score.down else 1.0
    worst = [
        math.inf if row[score.name] is None else sign * row[score.name] for row in board
    ]
    board.sort(
        key=lambda row: (
            not row["taking_part"],
            worst[row["method"]],
            row.get("above", 0.0),
        )
    )
    comparisons = _leader_comparisons(contest, board[0]["method"])
    return [{**row, **comparisons[row["method"]]} for row in board]


def _leader_comparisons(
    contest: Contest, leader: int
) -> dict[int, dict[str, float | None]]:
    """Return how far each method is behind the leader, with the p of the difference; None where there is no test."""
    place = contest.methods.index(leader)
    names = ("behind", "behind_low", "behind_high", "p")
    comparisons: dict[int, dict[str, float | None]] = {
        m: dict.fromkeys(names) for m in range(len(contest.runs.methods))
    }
    for pair in contest.comparisons:
        if place == pair.first:
            ends = -pair.difference, -pair.high, -pair.low
        else:
            ends = pair.difference, pair.low, pair.high
        if place in (pair.first, pair.second):
            other = contest.methods[pair.first + pair.second - place]
            comparisons[other] = dict(zip(names, (*ends, pair.adjusted), strict=True))
    return comparisons


def paired_tests(contest: Contest) -> dict[str, Any] | None:
    """Return the paired tests of a contest; None where there are not two methods and two blocks.

    `pairs` lists first, second, median difference of errors and its interval, p, and p after Holm: a difference below 0
    is in favour of the first.
    """
    if not contest.testable:
        return None
    pairs = [astuple(comparison) for comparison in contest.comparisons]
    return {
        "methods": contest.methods,
        "blocks": contest.tested_errors()[0].size,
        "pairs": pairs,
    }
