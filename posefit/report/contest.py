"""The methods of a sweep compared on the runs that they share."""

from collections.abc import Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from scipy.stats import trim_mean

from posefit.arrays import Array
from posefit.report.columns import COLUMNS
from posefit.report.runs import Runs
from posefit.statistics.improvement import improvement_interval, probability_of_improvement
from posefit.statistics.intervals import MIN_RESAMPLES, RESAMPLES, TRIMMED, iqm_intervals
from posefit.statistics.means import mean_interval
from posefit.statistics.pairing import Shared, most_shared
from posefit.statistics.ranks import LEVEL, compact_letters, friedman, wilcoxon
from posefit.suites.functions import suite_function
from posefit.tracking.measures import BASELINES

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
    means, as most runs lose none. Of single searches, `reached` is a mean over runs and targets with its interval,
    and `above` a median. Methods that share one of their `letters` do not differ significantly.
    """
    runs = contest.runs
    ends = _search_intervals(contest) if runs.is_search else _error_intervals(contest)
    board: list[dict[str, Any]] = []
    for m, name in enumerate(runs.methods):
        own = shared_rows(contest, m)
        row: dict[str, Any] = {
            "method": m,
            "name": name,
            "runs": len(own),
            "failed": runs.failed[m],
            "taking_part": m in contest.methods,
            "low": None,
            "high": None,
        }
        if runs.is_search:
            row |= {
                "reached": mean(runs.figures["reached"][own]),
                "above": float(np.median(runs.figures["above"][own])),
            }
        else:
            for share, average in ((False, interquartile_mean), (True, mean)):
                row |= {
                    name: average(runs.figures[name][own]) for name, column in COLUMNS.items() if column.share == share
                }
        board.append({**row, **ends.get(m, {})})
    board.sort(key=_rank)
    letters = _letters(contest, [row["method"] for row in board if row["taking_part"]])
    return [{**row, "letters": letters.get(row["method"], "")} for row in board]


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
    # of each the means (instances, seeds) over the methods that have a value
    values = {name: np.ma.masked_invalid(contest.of(f"baseline_{name}")) for name in BASELINES}
    errors = {name: np.asarray(own.mean(axis=0).filled(np.nan)) for name, own in values.items()}
    for name, own in errors.items():
        row: dict[str, Any] = {"baseline": name, "error": interquartile_mean(own)}
        for other, theirs in errors.items():
            ratio = np.divide(own, theirs, out=np.full(own.shape, np.nan), where=theirs > 0.0)
            row[f"skill_{other}"] = interquartile_mean(1.0 - ratio)
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
    pairs = [list(astuple(comparison)) for comparison in wilcoxon(tested)]
    tests = {"methods": contest.methods, "blocks": tested[0].size, "pairs": pairs}
    if contest.runs.is_search:
        return tests
    errors, rng = contest.of("error"), np.random.default_rng(BOOTSTRAP_SEED)
    ranking, better = friedman(tested), probability_of_improvement(errors)
    count = int(min(WORK / (errors[0].size * errors.shape[2] * len(pairs)), RESAMPLES))
    bounded = errors.shape[2] >= MIN_SEEDS and count >= MIN_RESAMPLES
    for pair in pairs:
        first, second = pair[:2]
        ends: Sequence[float] = (np.nan, np.nan)
        if bounded:
            ends = improvement_interval(errors[first], errors[second], rng, resamples=count)[1:]
        pair += [better[first, second], *ends]
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
