"""The methods of a sweep compared on the runs that they share."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import trim_mean

from posefit.arrays import Array
from posefit.report.columns import COLUMNS, FIGURES
from posefit.report.runs import Runs
from posefit.statistics.improvement import improvement_interval, probability_of_improvement
from posefit.statistics.intervals import MIN_RESAMPLES, RESAMPLES, TRIMMED, Intervals, iqm_intervals
from posefit.statistics.means import mean_interval
from posefit.statistics.pairing import Rows, gaps, most_shared
from posefit.statistics.ranks import LEVEL, compact_letters, friedman, wilcoxon
from posefit.tracking.measures import BASELINES

BOOTSTRAP_SEED = 2013
WORK = 1e8  # numbers that the resamples of one study may come to
MIN_SEEDS = 3  # for the interval of a probability of improvement
RANDOM = "random"  # the method that is the baseline of single searches


@dataclass(frozen=True, eq=False)
class Contest:
    """The runs that some methods share, paired by instance and seed."""

    runs: Runs
    methods: tuple[int, ...]  # that take part
    instances: tuple[int, ...]
    rows: Array  # (methods, instances, seeds) rows of `runs` for means and intervals
    blocks: Array  # (methods, blocks) rows of every instance and seed that all methods have finished, for tests
    left_out: int  # runs of these methods that not all of them have

    def of(self, figure: str) -> Array:
        """Return a figure of all runs (methods, instances, seeds)."""
        return np.asarray(self.runs.figures[figure][self.rows])

    def tested_errors(self) -> Array:
        """Return the errors (methods, blocks, 1) that tests compare.

        A block of tracks is an instance with a seed. A block of single searches is an instance of a function, the same
        pose in every dimension: the mean over seeds and dimensions counts.
        """
        if not self.runs.is_search:
            return np.asarray(self.runs.figures["error"][self.blocks][:, :, None])
        places = [self.runs.places[i] for i in self.instances]
        poses = [(place["function"], place["instance"], place["suite"]) for place in places]
        index = {pose: k for k, pose in enumerate(dict.fromkeys(poses))}
        block = np.array([index[pose] for pose in poses])
        sums = np.array([np.bincount(block, row) for row in self.of("reached").mean(axis=2)])
        return np.asarray((100.0 - sums / np.bincount(block))[:, :, None])

    @property
    def testable(self) -> bool:
        """Whether there are methods and blocks enough for a paired test."""
        return bool(min(self.tested_errors().shape[:2]) > 1)

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
    shared = most_shared(_rows(runs))
    if shared is None:
        return None
    return Contest(runs, shared.methods, shared.instances, shared.rows, shared.blocks, shared.left_out)


def missing_instances(contest: Contest) -> list[dict[str, Any]]:
    """Return the instances without a shared run, and the methods that have no run there.

    The list of methods is empty where each has a run, but none with the same seed.
    """
    missing = gaps(_rows(contest.runs), contest.methods, contest.instances)
    return [{"instance": instance, "missing": methods} for instance, methods in missing]


def _rows(runs: Runs) -> Rows:
    return Rows(runs.method, runs.instance, runs.seed, runs.figures["error"])


def resamples(numbers: int) -> int:
    """Return how many bootstrap resamples so many numbers may have."""
    return int(np.clip(WORK / max(numbers, 1), MIN_RESAMPLES, RESAMPLES))


def intervals(values: Array) -> Intervals:
    """Return the interquartile mean of each method's runs (methods, instances, seeds), with its interval."""
    return iqm_intervals(values, np.random.default_rng(BOOTSTRAP_SEED), resamples=resamples(values.size))


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each method, best first; those that do not take part come last, with their own runs.

    Of tracks, figures are interquartile means, and the error has an interval; shares of frames or joints are plain
    means, as most runs lose none. Of single searches, `reached` is a mean over runs and targets with its interval,
    and `above` a median. Methods that share one of their `letters` do not differ significantly.
    """
    runs = contest.runs
    ends = None if runs.is_search else intervals(contest.of("error"))
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        place = contest.methods.index(m) if m in contest.methods else None
        mine = shared_rows(contest, m)
        row: dict[str, Any] = {
            "method": m,
            "name": name,
            "runs": len(mine),
            "failed": runs.failed[m],
            "taking_part": place is not None,
            "low": None,
            "high": None,
        }
        if ends is not None:
            row |= {figure: interquartile_mean(runs.figures[figure][mine]) for figure in FIGURES}
            row |= {figure: mean(runs.figures[figure][mine]) for figure, column in COLUMNS.items() if column.share}
            if place is not None:
                row |= {"low": ends.low[place], "high": ends.high[place]}
        else:
            row |= {
                "reached": mean(runs.figures["reached"][mine]),
                "above": float(np.median(runs.figures["above"][mine])),
            }
            if place is not None:
                row |= _reached_interval(contest, place)
        board.append(row)
    board.sort(key=_rank)
    letters = _letters(contest, [row["method"] for row in board if row["taking_part"]])
    return [{**row, "letters": letters.get(row["method"], "")} for row in board]


def shared_rows(contest: Contest, method: int) -> NDArray[np.int64]:
    """Return the rows (k,) of a method that count: those shared, or all its own if it does not take part."""
    if method in contest.methods:
        return np.asarray(contest.rows[contest.methods.index(method)].ravel())
    return np.flatnonzero(contest.runs.method == method).astype(np.int64)


def _reached_interval(contest: Contest, place: int) -> dict[str, float]:
    """Return the mean share of targets of a method, with the interval that other instances would give."""
    places = [contest.runs.places[i] for i in contest.instances]
    shares = contest.of("reached")[place].mean(axis=1)
    found = mean_interval(shares, [one["function"] for one in places], [one["instance"] for one in places])
    return {"reached": found.value, "low": max(found.low, 0.0), "high": min(found.high, 100.0)}


def _rank(row: dict[str, Any]) -> tuple[Any, ...]:
    if "reached" in row:
        return not row["taking_part"], -row["reached"], row["above"], row["name"]
    return not row["taking_part"], np.inf if row["error"] is None else row["error"]


def _letters(contest: Contest, best_first: Sequence[int]) -> dict[int, str]:
    """Return the letters of each method that takes part; none where too few runs are shared for any test."""
    if not contest.testable:
        return {}
    errors = contest.tested_errors()[[contest.methods.index(m) for m in best_first]]
    different = [(pair.first, pair.second) for pair in wilcoxon(errors) if pair.adjusted < LEVEL]
    return dict(zip(best_first, compact_letters(len(best_first), different), strict=True))


def baseline_rows(contest: Contest, board: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return a row for each baseline, on the same runs as the methods.

    Of single searches it is random search, if a method of the leaderboard `board` is it: the best of its variants.
    """
    if contest.runs.is_search:
        random = [row["reached"] for row in board if row["taking_part"] and is_random(contest.runs, row["method"])]
        return [{"baseline": RANDOM, "reached": max(random)}] if random else []
    rows = []
    errors = {name: _means(contest.of(f"baseline_{name}")) for name in BASELINES}
    for name, mine in errors.items():
        row: dict[str, Any] = {"baseline": name, "error": interquartile_mean(mine.ravel())}
        for other, theirs in errors.items():
            with np.errstate(divide="ignore", invalid="ignore"):
                skill = 1.0 - mine / theirs
            row[f"skill_{other}"] = interquartile_mean(np.where(theirs > 0.0, skill, np.nan).ravel())
        rows.append(row)
    return rows


def is_random(runs: Runs, method: int) -> bool:
    """Return whether a method is random search."""
    return bool(runs.variants[method]["method"] == RANDOM)


def paired_tests(contest: Contest) -> dict[str, Any]:
    """Return the paired tests of a contest of at least two methods and blocks.

    `pairs` lists first, second, median difference of errors, p, and p after Holm: a difference below 0 is in favour of
    the first. Of tracks there are also mean ranks, and each pair has the probability that the first is better than
    the second, and the ends of its interval, nan where that is not cheap. Tests and ranks use all `blocks`, the
    probabilities equally many seeds of every instance.
    """
    tested = contest.tested_errors()
    compared = wilcoxon(tested)
    pairs = [[one.first, one.second, one.difference, one.p_value, one.adjusted] for one in compared]
    tests = {"methods": contest.methods, "blocks": tested[0].size, "pairs": pairs}
    if contest.runs.is_search:
        return tests
    errors, rng = contest.of("error"), np.random.default_rng(BOOTSTRAP_SEED)
    ranking, better = friedman(tested), probability_of_improvement(errors)
    count = int(min(WORK / (errors[0].size * errors.shape[2] * len(compared)), RESAMPLES))
    bounded = errors.shape[2] >= MIN_SEEDS and count >= MIN_RESAMPLES
    for pair, one in zip(pairs, compared, strict=True):
        ends = (np.nan, np.nan)
        if bounded:
            ends = improvement_interval(errors[one.first], errors[one.second], rng, resamples=count)[1:]
        pair += [better[one.first, one.second], *ends]
    return {
        **tests,
        "ranks": ranking.mean_ranks,
        "friedman": ranking.p_value,
        "critical_difference": ranking.critical_difference,
        "cliques": ranking.cliques,
    }


def interquartile_mean(values: Array) -> float | None:
    """Return the interquartile mean of the finite values; None if there is none."""
    finite = values[np.isfinite(values)]
    return float(trim_mean(finite, TRIMMED)) if len(finite) else None


def mean(values: Array) -> float | None:
    """Return the mean of the finite values; None if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else None


def _means(values: Array) -> Array:
    """Return the mean over methods (instances, seeds), of those that have a value."""
    known = np.isfinite(values)
    total = np.where(known, values, 0.0).sum(axis=0)
    return np.where(known.any(axis=0), total / np.maximum(known.sum(axis=0), 1), np.nan)
