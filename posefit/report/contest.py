"""The methods of a sweep compared on the runs that they share."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.report.kind import Runs
from posefit.statistics.intervals import MIN_RESAMPLES, RESAMPLES
from posefit.statistics.pairing import Shared, most_shared
from posefit.statistics.ranks import LEVEL, Comparison, compact_letters, wilcoxon

BOOTSTRAP_SEED = 2013
WORK = 1e8  # numbers that the resamples of one study may come to


@dataclass(frozen=True, eq=False, kw_only=True)
class Contest(Shared):
    """The runs that some methods share, paired by instance and seed: `rows` and `blocks` are indices of `runs`."""

    runs: Runs

    def of(self, figure: str) -> Array:
        """Return a figure of all runs (methods, instances, seeds)."""
        return np.asarray(self.runs.figures[figure][self.rows])

    def rows_of(self, method: int) -> NDArray[np.int64]:
        """Return the rows (k,) of a method that count: those shared, or all its own if it does not take part."""
        if method in self.methods:
            return np.asarray(self.rows[self.methods.index(method)].ravel())
        return np.flatnonzero(self.runs.method == method).astype(np.int64)

    def places(self) -> list[dict[str, Any]]:
        """Return the fields of a plan that make each instance."""
        return [self.runs.places[i] for i in self.instances]

    def tested_errors(self) -> Array:
        """Return the errors (methods, blocks, 1) that tests compare."""
        return self.runs.kind.tested_errors(self)

    @property
    def testable(self) -> bool:
        """Whether there are methods and blocks enough for a paired test."""
        return bool(min(self.tested_errors().shape[:2]) > 1)

    @cached_property
    def comparisons(self) -> list[Comparison]:
        """The paired tests of all methods, by their places in `methods`; none where too few runs are shared."""
        return wilcoxon(self.tested_errors()) if self.testable else []

    def rng(self) -> np.random.Generator:
        """Return what resamples are drawn by."""
        return np.random.default_rng(BOOTSTRAP_SEED)

    def resamples(self, numbers: int) -> int:
        """Return how many bootstrap resamples so many numbers may have."""
        return int(np.clip(WORK / max(numbers, 1), MIN_RESAMPLES, RESAMPLES))

    def fewer(self, points: int) -> Self:
        """Return the contest on so few seeds and instances that intervals at so many points are little work.

        These are the first seeds, and every second, third, ... instance.
        """
        most = int(WORK / (MIN_RESAMPLES * max(points, 1) * len(self.methods)))  # runs of a method
        _, instances, seeds = self.rows.shape
        seeds = min(seeds, max(2, most // instances))
        step = -(-instances * seeds // most)
        return replace(self, instances=self.instances[::step], rows=self.rows[:, ::step, :seeds])


def contest_of(runs: Runs) -> Contest | None:
    """Return the contest of as many methods as share enough runs; None if no run has an error.

    A method that would leave less than half of the runs that the others share does not take part.
    """
    shared = most_shared(runs.method, runs.instance, runs.seed, runs.figures["error"])
    return None if shared is None else Contest(**vars(shared), runs=runs)


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each method, best first; those that do not take part come last, with their own runs.

    Figures are averages, the score has an interval, and the kind of runs adds its own: see `board` of `Tracks` and
    `Searches`. `behind` is the median difference from the leader in paired runs with its interval, `p` is Wilcoxon's
    after Holm. Methods that share one of their `letters` do not differ significantly.
    """
    runs, score = contest.runs, contest.runs.kind.score
    more = runs.kind.board(contest)
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        own = contest.rows_of(m)
        row = {
            "method": m,
            "name": name,
            "runs": len(own),
            "failed": runs.failed[m],
            "warned": sum(k in runs.warnings for k in own.tolist()),
            "taking_part": m in contest.methods,
        }
        row |= {figure: column.average(runs.figures[figure][own]) for figure, column in runs.kind.columns.items()}
        board.append({**row, **more[m]})
    sign = -1.0 if score.down else 1.0
    worst = [math.inf if row[score.name] is None else sign * row[score.name] for row in board]
    board.sort(key=lambda row: (not row["taking_part"], worst[row["method"]], row.get("above", 0.0)))
    best_first = [row["method"] for row in board if row["taking_part"]]
    letters, comparisons = _letters(contest, best_first), _leader_comparisons(contest, best_first[0])
    return [{**row, **comparisons[row["method"]], "letters": letters.get(row["method"], "")} for row in board]


def _letters(contest: Contest, best_first: Sequence[int]) -> dict[int, str]:
    """Return the letters of each method that takes part; none where too few runs are shared for any test."""
    places = [best_first.index(m) for m in contest.methods]
    different = [(places[pair.first], places[pair.second]) for pair in contest.comparisons if pair.adjusted < LEVEL]
    return dict(zip(best_first, compact_letters(len(best_first), different), strict=True)) if contest.testable else {}


def _leader_comparisons(contest: Contest, leader: int) -> dict[int, dict[str, float | None]]:
    """Return how far each method is behind the leader, with the p of the difference; None where there is no test."""
    place, names = contest.methods.index(leader), ("behind", "behind_low", "behind_high", "p")
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
    return {"methods": contest.methods, "blocks": contest.tested_errors()[0].size, "pairs": pairs}
