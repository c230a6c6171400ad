"""The leaderboard: the methods of a sweep in order, compared on the runs they share."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from posefit.report.contest import Baseline, Contest, Runs, contest_of
from posefit.statistics.paired import SIGNIFICANCE, PairedTest

# the fields of a `PairedTest` by their names in rows of the leaderboard
EFFECT = {
    "behind": "difference",
    "behind_low": "low",
    "behind_high": "high",
    "p": "adjusted",
    "blocks_needed": "blocks_needed",
}


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A row of the leaderboard.

    Attributes:
        method: The method's index in the runs.
        name: Its name.
        settings: Its settings as a text.
        runs: The number of runs from which its figures are computed.
        failed: The number of its quarantined cells.
        warned: The number of its runs with a warning.
        taking_part: Whether it shares enough runs to be compared.
        figures: The average of each figure by name, None if it is unknown.
        interval: The ends of the score's 95 % interval, or None.
        lost_tracks: The number of its runs that lost frames; None for searches.
        test: The paired test against the first method, whose difference is above 0 if
            this method is worse. None for the first one, and for untested ones.
    """

    method: int
    name: str
    settings: str
    runs: int
    failed: int
    warned: int
    taking_part: bool
    figures: Mapping[str, float | None]
    interval: tuple[float, float] | None
    lost_tracks: int | None
    test: PairedTest | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return everything by name, figures and parts of the test as well."""
        values = dict(vars(self))
        figures = values.pop("figures")
        test = values.pop("test")
        values["low"], values["high"] = values.pop("interval") or (None, None)
        if self.lost_tracks is None:
            del values["lost_tracks"]
        values |= figures
        for name, field in EFFECT.items():
            values[name] = getattr(test, field) if test else None
        return values


@dataclass(frozen=True, eq=False)
class Standings:
    """A contest with its leaderboard and its baselines."""

    contest: Contest
    board: Sequence[Standing]
    baselines: Sequence[Baseline]


def standings_of(runs: Runs) -> Standings | None:
    """Return the standings of the methods of a ledger, None if no run has an error."""
    contest = contest_of(runs)
    if contest is None:
        return None
    return Standings(contest, leaderboard(contest), runs.kind.baselines(contest))


def leaderboard(contest: Contest) -> list[Standing]:
    """Return a row for each method, best first.

    The order has three groups:

    1. Methods that are not shown to be worse than the method of the best score, with p
       of the paired test not below 0.05. They are sorted by the number of lost tracks,
       because no difference of their errors is shown. So no method that loses tracks is
       ahead of an equally good method that loses none.
    2. The other methods that take part, by their score.
    3. Methods that do not take part, with the averages of all their own runs.
    """
    runs = contest.runs
    rows = []
    for m, name in enumerate(runs.methods):
        rows_of_method = contest.rows_of(m)
        row = Standing(
            method=m,
            name=name,
            settings=runs.settings[m],
            runs=len(rows_of_method),
            failed=runs.failed[name],
            warned=sum(k in runs.warnings for k in rows_of_method.tolist()),
            taking_part=m in contest.methods,
            figures=runs.kind.figures(runs, rows_of_method),
            interval=_interval(contest, m),
            lost_tracks=runs.lost_tracks(rows_of_method),
        )
        rows.append(row)
    best_first = _best_first(contest, rows)
    tests = dict(contest.tests_against(best_first[0].method))
    return [replace(row, test=tests.get(row.method)) for row in best_first]


def _interval(contest: Contest, method: int) -> tuple[float, float] | None:
    """Return the ends of the 95 % interval of a method's score, None if unknown."""
    if method not in contest.methods:
        return None
    ends = contest.runs.kind.interval(contest, contest.methods.index(method))
    return ends if math.isfinite(ends[0]) else None


def _best_first(contest: Contest, rows: Sequence[Standing]) -> list[Standing]:
    """Return the rows of a leaderboard in its order."""
    score = contest.runs.kind.score

    def badness(row: Standing) -> tuple[float, float]:
        """Return a key that is lower for better methods.

        Those without a score are last.
        """
        value = row.figures[score.name]
        if value is None:
            return math.inf, 0.0
        # of searches with equal shares of targets, the lower cost is better
        above = row.figures.get("above") or 0.0
        return score.badness(value), above

    # the method of the best score comes first only if it lost no more than others that
    # a test does not separate from it
    best = min((row for row in rows if row.taking_part), key=badness)
    worse_methods = set()
    for m, test in contest.tests_against(best.method):
        if test.p_value < SIGNIFICANCE:
            worse_methods.add(m)

    def order(row: Standing) -> tuple[Any, ...]:
        if not row.taking_part:
            return 3, badness(row)
        if row.method in worse_methods:
            return 2, badness(row)
        return 1, row.lost_tracks or 0, badness(row)

    return sorted(rows, key=order)
