"""The methods of a sweep compared on the runs that they share."""

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES
from posefit.fitting.metrics import skill
from posefit.report.columns import interquartile_mean, mean
from posefit.report.runs import Runs
from posefit.statistics.improvement import improvement_interval, probability_of_improvement
from posefit.statistics.intervals import MIN_RESAMPLES, RESAMPLES, iqm_intervals
from posefit.statistics.means import mean_interval
from posefit.statistics.pairing import Shared, most_shared
from posefit.statistics.ranks import LEVEL, Comparison, compact_letters, wilcoxon
from posefit.suites.functions import suite_function

BOOTSTRAP_SEED = 2013
WORK = 1e8  # numbers that the resamples of one study may come to
MIN_SEEDS = 3  # for the interval of a probability of improvement
RANDOM = "random"  # the method that is the baseline of single searches


@dataclass(frozen=True, eq=False, kw_only=True)
class Contest(Shared):
    """The runs that some methods share, paired by instance and seed: `rows` and `blocks` are indices of `runs`."""

    runs: Runs

    def of(self, figure: str) -> Array:
        """Return a figure of all runs (methods, instances, seeds)."""
        return np.asarray(self.runs.figures[figure][self.rows])

    def places(self) -> list[dict[str, Any]]:
        """Return the fields of a plan that make each instance."""
        return [self.runs.places[i] for i in self.instances]

    def tested_errors(self) -> Array:
        """Return the errors (methods, blocks, 1) that tests compare.

        A block of tracks is an instance with a seed. A block of single searches is an instance of a function, the same
        pose in every dimension: the mean over seeds and dimensions counts.
        """
        if not self.runs.is_search:
            return np.asarray(self.runs.figures["error"][self.blocks][:, :, None])
        poses = [(place["function"], place["instance"], place["suite"]) for place in self.places()]
        index = {pose: k for k, pose in enumerate(dict.fromkeys(poses))}
        block = np.array([index[pose] for pose in poses])
        sums = np.array([np.bincount(block, row) for row in self.of("reached").mean(axis=2)])
        return np.asarray((100.0 - sums / np.bincount(block))[:, :, None])

    @property
    def testable(self) -> bool:
        """Whether there are methods and blocks enough for a paired test."""
        return bool(min(self.tested_errors().shape[:2]) > 1)

    @cached_property
    def comparisons(self) -> list[Comparison]:
        """The paired tests of all methods, by their places in `methods`; none where too few runs are shared."""
        return wilcoxon(self.tested_errors()) if self.testable else []

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


def resamples(numbers: int) -> int:
    """Return how many bootstrap resamples so many numbers may have."""
    return int(np.clip(WORK / max(numbers, 1), MIN_RESAMPLES, RESAMPLES))


def leaderboard(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each method, best first; those that do not take part come last, with their own runs.

    Of tracks, figures are interquartile means, and the error has an interval; shares of frames or joints are plain
    means, as most runs lose none, and `lost_tracks` counts those that lose any. A skill is 1 - the row's error / the
    baseline's on the same runs. Of single searches, `reached` is a mean over runs and targets with its interval, and
    `above` a median. `behind` is the median difference from the leader in paired runs with its interval, `p` is
    Wilcoxon's after Holm. Methods that share one of their `letters` do not differ significantly.
    """
    runs, score = contest.runs, contest.runs.score
    ends = _search_intervals(contest) if runs.is_search else _error_intervals(contest)
    baselines = {} if runs.is_search else {row["baseline"]: row["error"] for row in baseline_rows(contest)}
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        own, taking_part = shared_rows(contest, m), m in contest.methods
        row: dict[str, Any] = {"method": m, "name": name, "runs": len(own), "failed": runs.failed[m]}
        row |= {"taking_part": taking_part, "low": None, "high": None}
        row |= {figure: column.average(runs.figures[figure][own]) for figure, column in runs.columns.items()}
        for baseline, shared in baselines.items():
            row[f"skill_{baseline}"] = _skill(row["error"], shared if taking_part else row[f"baseline_{baseline}"])
        if "lost" in runs.figures:
            row["lost_tracks"] = int((runs.figures["lost"][own] > 0.0).sum())
        board.append({**row, **ends.get(m, {})})
    sign, figure = -1.0 if score["better"] == "more" else 1.0, score["name"]
    worst = [math.inf if row[figure] is None else sign * row[figure] for row in board]
    board.sort(key=lambda row: (not row["taking_part"], worst[row["method"]], row.get("above", 0.0)))
    best_first = [row["method"] for row in board if row["taking_part"]]
    letters, duels = _letters(contest, best_first), _duels(contest, best_first[0])
    return [{**row, **duels[row["method"]], "letters": letters.get(row["method"], "")} for row in board]


def shared_rows(contest: Contest, method: int) -> NDArray[np.int64]:
    """Return the rows (k,) of a method that count: those shared, or all its own if it does not take part."""
    if method in contest.methods:
        return np.asarray(contest.rows[contest.methods.index(method)].ravel())
    return np.flatnonzero(contest.runs.method == method).astype(np.int64)


def _error_intervals(contest: Contest) -> dict[int, dict[str, float]]:
    """Return the ends of the interval of each method's interquartile mean."""
    errors = contest.of("error")
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    intervals = iqm_intervals(errors, rng, resamples=resamples(errors.size))
    ends = zip(contest.methods, intervals.low.tolist(), intervals.high.tolist(), strict=True)
    return {m: {"low": low, "high": high} for m, low, high in ends}


def _search_intervals(contest: Contest, function: int | None = None) -> dict[int, dict[str, float]]:
    """Return each method's mean share of targets, of all or of one function, with the interval of other instances."""
    places = contest.places()
    own = [k for k, place in enumerate(places) if function in (None, place["function"])]
    strata, clusters = ([places[k][name] for k in own] for name in ("function", "instance"))
    ends = {}
    for m, shares in zip(contest.methods, contest.of("reached").mean(axis=2)[:, own], strict=True):
        share = mean_interval(shares, strata, clusters)
        ends[m] = {"reached": share.value, "low": max(share.low, 0.0), "high": min(share.high, 100.0)}
    return ends


def function_shares(contest: Contest) -> list[dict[str, Any]]:
    """Return the functions of a suite's searches, each with a row for each method, the best first."""
    return [
        {
            "name": f"{function} {suite_function(function).name}",
            "rows": sorted(
                ({"method": m, **share} for m, share in _search_intervals(contest, function).items()),
                key=lambda row: -row["reached"],
            ),
        }
        for function in sorted({place["function"] for place in contest.places()})
    ]


def _letters(contest: Contest, best_first: Sequence[int]) -> dict[int, str]:
    """Return the letters of each method that takes part; none where too few runs are shared for any test."""
    places = [best_first.index(m) for m in contest.methods]
    different = [(places[pair.first], places[pair.second]) for pair in contest.comparisons if pair.adjusted < LEVEL]
    return dict(zip(best_first, compact_letters(len(best_first), different), strict=True)) if contest.testable else {}


def _duels(contest: Contest, leader: int) -> dict[int, dict[str, float | None]]:
    """Return how far each method is behind the leader, with the p of the difference; None where there is no test."""
    place, names = contest.methods.index(leader), ("behind", "behind_low", "behind_high", "p")
    duels: dict[int, dict[str, float | None]] = {m: dict.fromkeys(names) for m in range(len(contest.runs.methods))}
    for pair in contest.comparisons:
        if place == pair.first:
            values = -pair.difference, -pair.high, -pair.low, pair.adjusted
            duels[contest.methods[pair.second]] = dict(zip(names, values, strict=True))
        elif place == pair.second:
            values = pair.difference, pair.low, pair.high, pair.adjusted
            duels[contest.methods[pair.first]] = dict(zip(names, values, strict=True))
    return duels


def baseline_rows(contest: Contest) -> list[dict[str, Any]]:
    """Return a row for each baseline, on the same runs as the methods.

    Of single searches it is random search, if a method that takes part is it: the best of its variants.
    """
    if contest.runs.is_search:
        shares = contest.of("reached")
        random = [mean(shares[k]) for k, m in enumerate(contest.methods) if is_random(contest.runs, m)]
        return [{"baseline": RANDOM, "reached": max(filter(None, random), default=0.0)}] if random else []
    # of each the means (instances, seeds) over the methods that have a value
    values = {name: np.ma.masked_invalid(contest.of(f"baseline_{name}")) for name in BASELINES}
    errors = {name: interquartile_mean(own.mean(axis=0).filled(np.nan)) for name, own in values.items()}
    return [
        {"baseline": name, "error": error, **{f"skill_{other}": _skill(error, errors[other]) for other in BASELINES}}
        for name, error in errors.items()
    ]


def _skill(error: float | None, baseline: float | None) -> float | None:
    return None if error is None or baseline is None else skill(error, baseline)


def is_random(runs: Runs, method: int) -> bool:
    """Return whether a method is random search."""
    return bool(runs.variants[method]["method"] == RANDOM)


def paired_tests(contest: Contest) -> dict[str, Any] | None:
    """Return the paired tests of a contest of tracks; None where there are not two methods and two blocks.

    `pairs` lists first, second, median difference of errors and its interval, p, p after Holm, and the probability that
    the first is better than the second with its interval, nan where that is not cheap: a difference below 0 is in
    favour of the first. Tests use all `blocks`, the probabilities equally many seeds of every instance.
    """
    if not contest.testable:
        return None
    errors, rng = contest.of("error"), np.random.default_rng(BOOTSTRAP_SEED)
    pairs = [list(astuple(comparison)) for comparison in contest.comparisons]
    better = probability_of_improvement(errors)
    count = int(min(WORK / (errors[0].size * errors.shape[2] * len(pairs)), RESAMPLES))
    bounded = errors.shape[2] >= MIN_SEEDS and count >= MIN_RESAMPLES
    for pair in pairs:
        first, second = pair[:2]
        ends: Sequence[float] = (np.nan, np.nan)
        if bounded:
            ends = improvement_interval(errors[first], errors[second], rng, resamples=count)[1:]
        pair += [better[first, second], *ends]
    return {"methods": contest.methods, "blocks": contest.tested_errors()[0].size, "pairs": pairs}
