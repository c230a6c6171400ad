"""The methods of a sweep held against each other on the runs that they share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.stats import trim_mean

from posefit.arrays import Array
from posefit.report.columns import COLUMNS, FIGURES
from posefit.report.runs import Runs
from posefit.statistics.improvement import improvement_interval, probability_of_improvement
from posefit.statistics.intervals import MIN_RESAMPLES, RESAMPLES, TRIMMED, Intervals, iqm_intervals
from posefit.statistics.pairing import Rows, gaps, most_shared
from posefit.statistics.ranks import LEVEL, compact_letters, friedman, wilcoxon
from posefit.tracking.measures import BASELINES

SEED = 2013  # of every bootstrap
WORK = 1e8  # numbers that the resamples of one study may come to
LEAST_SEEDS = 3  # below, a probability of improvement has no interval: two seeds say too little


@dataclass(frozen=True, eq=False)
class Contest:
    """The runs that some methods share, paired by instance and seed: means of `rows`, tests of `blocks`."""

    runs: Runs
    methods: tuple[int, ...]  # that take part
    instances: tuple[int, ...]
    rows: Array  # (methods, instances, seeds) which row of `runs` each is
    blocks: Array  # (methods, blocks) the same of every instance and seed that all have finished
    left_out: int  # runs of these methods that not all of them have

    def of(self, figure: str) -> Array:
        """Return a figure of all runs (methods, instances, seeds)."""
        return np.asarray(self.runs.figures[figure][self.rows])

    def errors_of_blocks(self) -> Array:
        """Return the errors (methods, blocks, 1) that tests compare, each block by itself."""
        return np.asarray(self.runs.figures["error"][self.blocks][:, :, None])

    @property
    def testable(self) -> bool:
        """Whether there are methods and blocks enough for a paired test."""
        return bool(min(self.blocks.shape) > 1)

    def fewer(self, points: int) -> Self:
        """Return the contest of so few seeds, or instances too, that intervals at so many points are little work.

        The first seeds are kept, and every so many-th instance.
        """
        most = int(WORK / (MIN_RESAMPLES * max(points, 1) * len(self.methods)))  # runs of a method
        _, instances, seeds = self.rows.shape
        kept = min(seeds, max(2, most // instances))
        step = -(-instances * kept // most)
        return replace(self, instances=self.instances[::step], rows=self.rows[:, ::step, :kept])


def contest_of(runs: Runs) -> Contest | None:
    """Return the contest of as many methods as share enough runs; None where no run has an error.

    A method with which less than half of the runs that the others share would be left does not take part.
    """
    found = most_shared(_rows(runs))
    if found is None:
        return None
    return Contest(runs, found.methods, found.instances, found.rows, found.blocks, found.left_out)


def dropped(contest: Contest) -> list[dict[str, Any]]:
    """Return the instances that are compared on no run, and the methods that have none there.

    A method that takes part has runs of it, but one of the others has not, or none with the same seed.
    """
    found = gaps(_rows(contest.runs), contest.methods, contest.instances)
    return [{"instance": instance, "missing": missing} for instance, missing in found]


def _rows(runs: Runs) -> Rows:
    return Rows(runs.method, runs.instance, runs.seed, runs.figures["error"])


def resamples(numbers: int) -> int:
    """Return how many bootstrap resamples so many numbers may have."""
    return int(np.clip(WORK / max(numbers, 1), MIN_RESAMPLES, RESAMPLES))


def intervals(values: Array) -> Intervals:
    """Return the interquartile mean of each method's runs (methods, instances, seeds), with its interval."""
    return iqm_intervals(values, np.random.default_rng(SEED), resamples=resamples(values.size))


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row a method: each figure's interquartile mean, the error with its interval; best first.

    Methods that share one of their `letters` are not told apart by Wilcoxon's signed ranks, p after Holm, at 5 %.

    Methods that do not take part come last, with what their own runs say. Shares of frames or joints are plain means,
    for most runs lose none.
    """
    found: list[dict[str, Any]] = []
    runs, ends = contest.runs, intervals(contest.of("error"))
    for m, name in enumerate(runs.methods):
        place = contest.methods.index(m) if m in contest.methods else None
        mine = np.flatnonzero(runs.method == m) if place is None else contest.rows[place].ravel()
        row = {figure: middle(runs.figures[figure][mine]) for figure in FIGURES}
        row |= {name: mean(runs.figures[name][mine]) for name, column in COLUMNS.items() if column.share}
        low, high = (None, None) if place is None else (ends.low[place], ends.high[place])
        found.append(
            {
                "method": m,
                "name": name,
                "runs": len(mine),
                "failed": runs.failed[m],
                "taking_part": place is not None,
                "low": low,
                "high": high,
                **row,
            }
        )
    found.sort(key=lambda one: (not one["taking_part"], np.inf if one["error"] is None else one["error"]))
    letters = _letters(contest, [one["method"] for one in found if one["taking_part"]])
    return [{**one, "letters": letters.get(one["method"], "")} for one in found]


def _letters(contest: Contest, best_first: Sequence[int]) -> dict[int, str]:
    """Return the letters of each method that takes part; none where too few runs are shared for any test."""
    if not contest.testable:
        return {}
    errors = contest.errors_of_blocks()[[contest.methods.index(m) for m in best_first]]
    apart = [(one.first, one.second) for one in wilcoxon(errors) if one.adjusted < LEVEL]
    return dict(zip(best_first, compact_letters(len(best_first), apart), strict=True))


def baseline_rows(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each baseline that anybody reaches, on the same runs as the methods."""
    rows = []
    values = {name: _means(contest.of(f"baseline_{name}")) for name in BASELINES}
    for name, mine in values.items():
        row: dict[str, Any] = {"baseline": name, "error": middle(mine.ravel())}
        for other, theirs in values.items():
            with np.errstate(divide="ignore", invalid="ignore"):
                skill = 1.0 - mine / theirs
            row[f"skill_{other}"] = middle(np.where(theirs > 0.0, skill, np.nan).ravel())
        rows.append(row)
    return rows


def paired_tests(contest: Contest) -> dict[str, Any]:
    """Return ranks, paired tests and probabilities of improvement of a contest of at least two methods and blocks.

    `pairs` lists first, second, median difference in degrees, p, p after Holm, how probably first is better than
    second, and the ends of its interval, nan where that is not cheap. Tests and ranks are of all `blocks`, the
    probabilities of as many seeds of every instance.
    """
    errors, tested = contest.of("error"), contest.errors_of_blocks()
    ranking, rng = friedman(tested), np.random.default_rng(SEED)
    better = probability_of_improvement(errors)
    compared = wilcoxon(tested)
    count = int(min(WORK / (errors[0].size * errors.shape[2] * len(compared)), RESAMPLES))
    bounded = errors.shape[2] >= LEAST_SEEDS and count >= MIN_RESAMPLES
    listed = []
    for one in compared:
        ends = (np.nan, np.nan)
        if bounded:
            ends = improvement_interval(errors[one.first], errors[one.second], rng, resamples=count)[1:]
        listed.append(
            [one.first, one.second, one.difference, one.p_value, one.adjusted, better[one.first, one.second], *ends]
        )
    return {
        "methods": contest.methods,
        "blocks": tested[0].size,
        "ranks": ranking.mean_ranks,
        "friedman": ranking.p_value,
        "statistic": ranking.statistic,
        "critical_difference": ranking.critical_difference,
        "cliques": ranking.cliques,
        "pairs": listed,
    }


def middle(values: Array) -> float | None:
    """Return the interquartile mean of the finite values; None where there is none."""
    finite = values[np.isfinite(values)]
    return float(trim_mean(finite, TRIMMED)) if len(finite) else None


def mean(values: Array) -> float | None:
    """Return the mean of the finite values; None where there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else None


def _means(values: Array) -> Array:
    """Return the mean over methods (instances, seeds), of those that have a value."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)
