"""Curves of the methods of a contest: cost over evaluations, targets reached, errors of joints, calibration."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import LEVEL_NAMES
from posefit.report.contest import BOOTSTRAP_SEED, Contest, mean, resamples, shared_rows
from posefit.statistics.intervals import Intervals, iqm_intervals
from posefit.statistics.profiles import Trace, attained, hits, targets
from posefit.suites.functions import suite_function
from posefit.suites.tally import SHOWN, suite_scores
from posefit.uncertainty.calibration import LEVELS

POINTS = 41  # of a curve of tracks
SEARCH_POINTS = 61  # of a curve of single searches


def grid(contest: Contest) -> Array:
    """Return numbers of evaluations (up to 41,), evenly on a log scale, over all traces of a contest of tracks."""
    ends = [(used[0], used[-1]) for used, _ in _traces(contest, range(len(contest.methods))) if len(used)]
    if not ends:
        return np.empty(0)
    return np.unique(np.rint(np.geomspace(min(a for a, _ in ends), max(b for _, b in ends), POINTS)))


def convergence(contest: Contest, evaluations: Array) -> list[Intervals | None]:
    """Return each method's best cost after each number of evaluations, with its interval.

    nan before all its runs have one and after the last has ended; None if a run has no trace.
    """
    count = resamples(contest.rows.size * max(len(evaluations), 1))
    return [_curve(contest, m, evaluations, count) for m in range(len(contest.methods))]


def _curve(contest: Contest, method: int, evaluations: Array, count: int) -> Intervals | None:
    traces = _traces(contest, [method])
    if not all(len(used) for used, _ in traces):
        return None
    first, last = max(used[0] for used, _ in traces), max(used[-1] for used, _ in traces)
    known = (evaluations >= first) & (evaluations <= last)
    values = np.full((3, len(evaluations)), np.nan)
    if known.any():
        points = evaluations[known]
        costs = np.array([best[np.searchsorted(used, points, side="right") - 1] for used, best in traces])
        blocks = costs.T.reshape(len(points), *contest.rows.shape[1:])
        curve = iqm_intervals(blocks, np.random.default_rng(BOOTSTRAP_SEED), resamples=count)
        values[:, known] = curve.values, curve.low, curve.high
    return Intervals(*values)


def reached(contest: Contest, evaluations: Array) -> Array:
    """Return the shares (methods, p) of a method's runs and targets reached after each number of evaluations.

    The targets of an instance lie between the worst first and the best last cost of any run there.
    """
    methods, instances, seeds = contest.rows.shape
    shares = np.zeros((methods, len(evaluations)))
    for i in range(instances):
        traces = [contest.runs.traces[int(k)] for k in contest.rows[:, i].ravel()]
        usable = [trace for trace in traces if len(trace[0])]
        if not usable:
            continue
        wanted = targets(usable)
        for m in range(methods):
            mine = traces[m * seeds : (m + 1) * seeds]
            times = [hits(one, wanted) if len(one[0]) else np.full(len(wanted), np.inf) for one in mine]
            shares[m] += attained(np.array(times), evaluations) / instances
    return shares


def joint_errors(contest: Contest) -> list[Intervals]:
    """Return each method's interquartile mean of every joint's error (27,) in mm, with its interval."""
    count = resamples(contest.rows.size * len(JOINTS))
    errors = np.moveaxis(contest.runs.joint_errors[contest.rows], -1, 1).astype(np.float64)  # (m, 27, instances, seeds)
    rng = np.random.default_rng(BOOTSTRAP_SEED)
    return [iqm_intervals(one, rng, resamples=count) for one in errors] if np.isfinite(errors).all() else []


def certainty(contest: Contest) -> dict[str, Any] | None:
    """Return the methods' uncertainty compared with the truth; None if no run has any.

    `levels` are those of intervals. `methods` has an entry for each method that takes part, None if its runs have no
    uncertainty: at each level the `coverage` and the `width` in mm, plain means over its runs; and the `reliability` of
    its likeliest modes, [frames, mean probability, share that is right] for each bin that has frames, with their
    expected calibration error `ece`, None if no run has modes.
    """
    methods = [_certainty_of(contest, place) for place in range(len(contest.methods))]
    return {"levels": list(LEVELS), "methods": methods} if any(one is not None for one in methods) else None


def _certainty_of(contest: Contest, place: int) -> dict[str, Any] | None:
    rows = contest.rows[place].ravel()
    coverage, width = (
        [mean(contest.runs.figures[f"{kind}_{level}"][rows]) for level in LEVEL_NAMES]
        for kind in ("coverage", "interval")
    )
    bins = contest.runs.modes[rows].sum(axis=0, dtype=np.float64)
    bins = bins[bins[:, 0] > 0.0]
    if not len(bins) and None in coverage:
        return None
    return {
        "coverage": coverage,
        "width": width,
        "reliability": [[int(count), total / count, right / count] for count, total, right in bins.tolist()],
        "ece": float(sum(abs(total - right) for _, total, right in bins.tolist()) / bins[:, 0].sum())
        if len(bins)
        else None,
    }


def search_grid(contest: Contest) -> Array:
    """Return numbers of evaluations for each dimension (up to 61,), evenly on a log scale up to the longest run."""
    runs = [contest.runs.searches[int(k)] for k in contest.rows.ravel()]
    most = max(float(run.evaluations[-1]) / run.dimension for run in runs)
    return np.unique(np.geomspace(1.0, max(most, 1.0), SEARCH_POINTS))


def search_curves(contest: Contest, evaluations: Array) -> list[dict[str, Any]]:
    """Return the shares (methods, p) of targets reached after evaluations, of all functions and then of each."""
    places = [contest.runs.places[i] for i in contest.instances]
    functions, dimensions = (np.array([place[name] for place in places]) for name in ("function", "dimension"))
    used = contest.runs.hits[contest.rows] / dimensions.astype(np.float64)[None, :, None, None]
    parts = [("All functions", functions > 0)]
    numbers = np.unique(functions).tolist()
    if len(numbers) > 1:
        parts += [(f"{number} {suite_function(number).name}", functions == number) for number in numbers]
    return [{"title": title, "shares": [attained(one[part], evaluations) for one in used]} for title, part in parts]


def running_times(contest: Contest) -> list[dict[str, Any]]:
    """Return the scores of each method's shared runs, a row for each dimension and function: see `suite_scores`."""
    return [
        {
            "method": method,
            "function": score.function,
            "name": score.name,
            "dimension": score.dimension,
            "runs": score.runs,
            "reached": 100.0 * score.reached,
            "above": score.above,
            "times": [score.running_times[above] for above in SHOWN],
        }
        for method in contest.methods
        for score in suite_scores(contest.runs.searches[int(k)] for k in shared_rows(contest, method))
    ]


def _traces(contest: Contest, methods: Iterable[int]) -> list[Trace]:
    return [contest.runs.traces[int(k)] for m in methods for k in contest.rows[m].ravel()]
