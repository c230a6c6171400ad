"""The methods of a sweep compared on the runs that they share."""

import math
from dataclasses import astuple
from typing import Any

from posefit.report.contest import Contest, Runs
from posefit.statistics.paired import SIGNIFICANCE
from posefit.statistics.pairing import most_shared

EFFECT = ("behind", "behind_low", "behind_high", "p", "blocks_needed")


def contest_of(runs: Runs) -> Contest | None:
    """Return the contest of the methods that share enough runs.

    A method does not take part if it would leave less than half of the runs that the
    others share.

    Args:
        runs: All runs of a ledger.

    Returns:
        The contest, or None if no run has an error.
    """
    shared = most_shared(runs.method, runs.instance, runs.seed, runs.scores)
    return None if shared is None else Contest(**vars(shared), runs=runs)


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each method, best first.

    The order has three groups:

    1. Methods that are not shown to be worse than the method of the best score, with p
       of the paired test not below 0.05. They are sorted by the number of lost tracks,
       because no difference of their errors is shown. So no method that loses tracks is
       ahead of an equally good method that loses none.
    2. The other methods that take part, by their score.
    3. Methods that do not take part, with the averages of all their own runs.

    Args:
        contest: The methods and the runs that they share.

    Returns:
        The rows. A figure is the average over the method's runs, the score has an
        interval, and `Kind.board` adds entries. `behind` is the mean difference from
        the first method in paired runs, with its interval; `p` is the paired test's p
        after Holm's correction; `blocks_needed` is how many paired runs would show such
        a difference.
    """
    runs = contest.runs
    score = runs.kind.score
    more = runs.kind.board(contest)
    settings = runs.settings
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        rows = contest.rows_of(m)
        row = {
            "method": m,
            "name": name,
            "settings": settings[m],
            "runs": len(rows),
            "failed": runs.failed[name],
            "warned": sum(k in runs.warnings for k in rows.tolist()),
            "taking_part": m in contest.methods,
        }
        for figure, column in runs.kind.columns.items():
            row[figure] = column.average(runs.figures[figure][rows])
        board.append({**row, **more[m]})

    def badness(row: dict[str, Any]) -> tuple[float, float]:
        """Return a key that is lower for better rows; rows without a score are last."""
        value = row[score.name]
        if value is None:
            return math.inf, 0.0
        return (-value if score.down else value), row.get("above", 0.0)

    # the method of the best score comes first only if it lost no more than others that
    # a test does not separate from it
    best = min((row for row in board if row["taking_part"]), key=badness)
    best_place = contest.methods.index(best["method"])
    worse_methods = set()
    for pair in contest.comparisons:
        places = (pair.first, pair.second)
        if best_place in places and pair.p_value < SIGNIFICANCE:
            other = pair.second if pair.first == best_place else pair.first
            worse_methods.add(contest.methods[other])

    def order(row: dict[str, Any]) -> tuple[Any, ...]:
        worse = not row["taking_part"] or row["method"] in worse_methods
        lost = 0 if worse else row.get("lost_tracks", 0)
        return not row["taking_part"], worse, lost, badness(row)

    board.sort(key=order)
    effects = _effects(contest, board[0]["method"])
    return [{**row, **effects[row["method"]]} for row in board]


def _effects(contest: Contest, first: int) -> dict[int, dict[str, float | None]]:
    """Return the entries of `EFFECT` for each method, compared with the first.

    They are None for a method without a test.
    """
    place = contest.methods.index(first)
    effects: dict[int, dict[str, float | None]] = {}
    for m in range(len(contest.runs.methods)):
        effects[m] = dict.fromkeys(EFFECT)
    for pair in contest.comparisons:
        if place not in (pair.first, pair.second):
            continue
        # positive if the other method is worse
        ends = (pair.difference, pair.low, pair.high)
        if place == pair.first:
            ends = (-pair.difference, -pair.high, -pair.low)
        other = contest.methods[pair.first + pair.second - place]
        numbers = (*ends, pair.adjusted, pair.blocks_needed)
        effects[other] = dict(zip(EFFECT, numbers, strict=True))
    return effects


def paired_tests_of(contest: Contest) -> dict[str, Any] | None:
    """Return the paired tests of a contest, as the page needs them.

    Args:
        contest: The methods and the runs that they share.

    Returns:
        The methods, the number of blocks, and for each pair the fields of a
        `posefit.statistics.paired.PairedTest`. A difference below 0 is in favour of the
        first method. None if there are not two methods and two blocks.
    """
    if not contest.comparisons:
        return None
    return {
        "methods": contest.methods,
        "blocks": contest.tested_errors[0].size,
        "pairs": [astuple(comparison) for comparison in contest.comparisons],
    }
