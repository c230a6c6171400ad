"""The methods of a sweep compared on the runs that they share."""

import math
from dataclasses import astuple
from typing import Any

from posefit.report.kind import Contest, Runs
from posefit.statistics.paired import SIGNIFICANCE
from posefit.statistics.pairing import most_shared

EFFECT = ("behind", "behind_low", "behind_high", "p", "blocks_needed")


def contest_of(runs: Runs) -> Contest | None:
    """Return the contest of as many methods as share enough runs; None if no run has an error.

    A method that would leave less than half of the runs that the others share does not take part.
    """
    shared = most_shared(runs.method, runs.instance, runs.seed, runs.scores)
    return None if shared is None else Contest(**vars(shared), runs=runs)


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each method, best first; those that do not take part come last, with their own runs.

    First come the methods that are not worse than the one of the best score: p of the paired test is not below 0.05.
    Of these, those that lost the fewest tracks come first, because no difference of their errors is shown; the others
    follow by their score. So a method that loses tracks is never ahead of one that is as good and loses none.

    Figures are averages, the score has an interval, and the kind of runs adds its own by `Kind.board`. `behind` is the
    mean difference from the first method in paired runs with its interval, `p` that of the paired test after Holm, and
    `blocks_needed` how many paired runs would show such a difference.
    """
    runs = contest.runs
    score = runs.kind.score
    more = runs.kind.board(contest)
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        rows = contest.rows_of(m)
        row = {
            "method": m,
            "name": name,
            "settings": runs.variants[m]["settings"],
            "runs": len(rows),
            "failed": runs.failed[m],
            "warned": sum(k in runs.warnings for k in rows.tolist()),
            "taking_part": m in contest.methods,
        }
        for figure, column in runs.kind.columns.items():
            row[figure] = column.average(runs.figures[figure][rows])
        board.append({**row, **more[m]})

    def badness(row: dict[str, Any]) -> tuple[float, float]:
        value = row[score.name]
        if value is None:
            return math.inf, 0.0
        return (-value if score.down else value), row.get("above", 0.0)

    best = min((row for row in board if row["taking_part"]), key=badness)
    unlike_best = {
        contest.methods[pair.second if pair.first == place else pair.first]
        for place in [contest.methods.index(best["method"])]
        for pair in contest.comparisons
        if place in (pair.first, pair.second) and pair.p_value < SIGNIFICANCE
    }

    def order(row: dict[str, Any]) -> tuple[Any, ...]:
        worse = not row["taking_part"] or row["method"] in unlike_best
        lost = 0 if worse else row.get("lost_tracks", 0)
        return not row["taking_part"], worse, lost, badness(row)

    board.sort(key=order)
    effects = _effects(contest, board[0]["method"])
    return [{**row, **effects[row["method"]]} for row in board]


def _effects(contest: Contest, first: int) -> dict[int, dict[str, float | None]]:
    """Return how far each method is behind the first, with p and the seeds needed; None without a test."""
    place = contest.methods.index(first)
    effects: dict[int, dict[str, float | None]] = {
        m: dict.fromkeys(EFFECT) for m in range(len(contest.runs.methods))
    }
    for pair in contest.comparisons:
        if place not in (pair.first, pair.second):
            continue
        ends = (pair.difference, pair.low, pair.high)
        if place == pair.first:
            ends = (-pair.difference, -pair.high, -pair.low)
        other = contest.methods[pair.first + pair.second - place]
        numbers = (*ends, pair.adjusted, pair.blocks_needed)
        effects[other] = dict(zip(EFFECT, numbers, strict=True))
    return effects


def paired_tests_of(contest: Contest) -> dict[str, Any] | None:
    """Return the paired tests of a contest; None without two methods and two blocks.

    `pairs` lists first, second, mean difference of errors and its interval, p, p after Holm, and the blocks needed: a
    difference below 0 is in favour of the first.
    """
    if not contest.comparisons:
        return None
    return {
        "methods": contest.methods,
        "blocks": contest.tested_errors[0].size,
        "pairs": [astuple(comparison) for comparison in contest.comparisons],
    }
