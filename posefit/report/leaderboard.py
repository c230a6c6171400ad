"""The leaderboard: the methods of a sweep in order, compared on the runs they share."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from posefit.report.contest import Baseline, Contest, Runs, contest_of
from posefit.statistics.paired import SIGNIFICANCE


@dataclass(frozen=True, kw_only=True)
class Effect:
    """How far a method is behind the first one.

    Attributes:
        behind: The mean difference in paired runs, above 0 if the method is worse.
        behind_low: The lower end of its interval, nan if there are too few runs.
        behind_high: The upper end.
        p: Of the paired test, after Holm's correction.
        blocks_needed: How many paired runs would show such a difference.
    """

    behind: float
    behind_low: float
    behind_high: float
    p: float
    blocks_needed: float

    @property
    def is_zero(self) -> bool:
        """Whether the methods are equal in all runs."""
        return self.behind_low == self.behind_high == 0.0


EFFECT = tuple(field.name for field in fields(Effect))


@dataclass(frozen=True, kw_only=True)
class Standing:
    """A row of the leaderboard.

    Attributes:
        method: The method's index in the runs.
        name: Its name.
        settings: Its settings as a text.
        runs: The number of runs that its figures are of.
        failed: The number of its quarantined cells.
        warned: The number of its runs with a warning.
        taking_part: Whether it shares enough runs to be compared.
        figures: The average of each figure by name, None if it is unknown.
        interval: The ends of the score's 95 % interval, or None.
        lost_tracks: The number of its runs that lost frames; None for searches.
        effect: Its distance from the first method. None for the first one, and without
            a test.
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
    effect: Effect | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return everything by name, figures and parts of the effect as well."""
        values = dict(vars(self))
        figures = values.pop("figures")
        effect = values.pop("effect")
        values["low"], values["high"] = values.pop("interval") or (None, None)
        if self.lost_tracks is None:
            del values["lost_tracks"]
        effects = vars(effect) if effect else dict.fromkeys(EFFECT)
        return {**values, **figures, **effects}


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
    kind = contest.runs.kind
    ends = dict[int, tuple[float, float]]()
    for place, m in enumerate(contest.methods):
        low, high = kind.interval(contest, place)
        if math.isfinite(low):
            ends[m] = low, high

    def badness(m: int) -> tuple[float, float]:
        """Return a key that is lower for better methods.

        Those without a score are last.
        """
        value = figures[m][kind.score.name]
        if value is None:
            return math.inf, 0.0
        # of searches with equal shares of targets, the lower cost is better
        return (-value if kind.score.down else value), figures[m].get("above") or 0.0

    def order(m: int) -> tuple[Any, ...]:
        worse = m not in contest.methods or m in worse_methods
        lost = 0 if worse else contest.runs.lost_tracks(rows[m]) or 0
        return m not in contest.methods, worse, lost, badness(m)

    numbers = range(len(contest.runs.methods))
    rows = [contest.rows_of(m) for m in numbers]
    figures = [kind.figures(contest.runs, rows_of_method) for rows_of_method in rows]
    # the method of the best score comes first only if it lost no more than others that
    # a test does not separate from it
    best = min(contest.methods, key=badness)
    worse_methods = set()
    for m, test in contest.tests_against(best):
        if test.p_value < SIGNIFICANCE:
            worse_methods.add(m)
    best_first = sorted(numbers, key=order)
    effects = _effects(contest, best_first[0])
    board = []
    for m in best_first:
        name = contest.runs.methods[m]
        row = Standing(
            method=m,
            name=name,
            settings=contest.runs.settings[m],
            runs=len(rows[m]),
            failed=contest.runs.failed[name],
            warned=sum(k in contest.runs.warnings for k in rows[m].tolist()),
            taking_part=m in contest.methods,
            figures=figures[m],
            interval=ends.get(m),
            lost_tracks=contest.runs.lost_tracks(rows[m]),
            effect=effects.get(m),
        )
        board.append(row)
    return board


def _effects(contest: Contest, first: int) -> dict[int, Effect]:
    """Return each tested method's distance from the first one."""
    effects = {}
    for m, test in contest.tests_against(first):
        effects[m] = Effect(
            behind=test.difference,
            behind_low=test.low,
            behind_high=test.high,
            p=test.adjusted,
            blocks_needed=test.blocks_needed,
        )
    return effects
