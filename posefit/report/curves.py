"""Curves of the methods of a contest: cost over evaluations, targets reached, errors of joints, calibration."""

from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import LEVEL_NAMES, mean
from posefit.report.contest import BOOTSTRAP_SEED, Contest, resamples, shared_rows
from posefit.report.runs import Runs
from posefit.statistics.intervals import Intervals, iqm_intervals
from posefit.statistics.means import mean_intervals
from posefit.statistics.profiles import Trace, attained, hits, targets
from posefit.suites.functions import suite_function
from posefit.suites.running import ALL, SHOWN, suite_scores
from posefit.uncertainty.calibration import LEVELS

POINTS = 41  # of a curve of tracks
SEARCH_POINTS = 61  # of a curve of single searches


def grid(contest: Contest) -> Array:
    """Return numbers of evaluations (up to 41,), evenly on a log scale, over all traces of a contest of tracks."""
    used = [used for used, _ in _traces(contest, contest.rows) if len(used)]
    if not used:
        return np.empty(0)
    return np.unique(np.rint(np.geomspace(min(map(np.min, used)), max(map(np.max, used)), POINTS)))


def convergence(contest: Contest, evaluations: Array) -> list[Intervals | None]:
    """Return each method's best cost after each number of evaluations, with its interval.

    nan before all its runs have one and after the last has ended; None if a run has no trace.
    """
    count = resamples(contest.rows.size * max(len(evaluations), 1))

    def curve(traces: list[Trace], shape: tuple[int, ...]) -> Intervals | None:
        if not all(len(used) for used, _ in traces):
            return None
        first, last = max(used[0] for used, _ in traces), max(used[-1] for used, _ in traces)
        known = (evaluations >= first) & (evaluations <= last)
        values = np.full((3, len(evaluations)), np.nan)
        if known.any():
            points = evaluations[known]
            costs = np.array([best[np.searchsorted(used, points, side="right") - 1] for used, best in traces])
            rng = np.random.default_rng(BOOTSTRAP_SEED)
            part = iqm_intervals(costs.T.reshape(-1, *shape), rng, resamples=count)
            values[:, known] = part.values, part.low, part.high
        return Intervals(*values)

    return [curve(_traces(contest, rows), rows.shape) for rows in contest.rows]


def reached(contest: Contest, evaluations: Array) -> Array:
    """Return the shares (methods, p) of a method's runs and targets reached after each number of evaluations.

    The targets of an instance lie between the worst first and the best last cost of any run there.
    """
    methods, instances, seeds = contest.rows.shape
    shares = np.zeros((methods, len(evaluations)))
    for i in range(instances):
        traces = _traces(contest, contest.rows[:, i])
        if usable := [trace for trace in traces if len(trace[0])]:
            costs = targets(usable)
            times = np.reshape([hits(trace, costs) for trace in traces], (methods, seeds, -1))
            shares += np.array([attained(times_of_method, evaluations) for times_of_method in times]) / instances
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
    methods = [_certainty_of(contest.runs, rows.ravel()) for rows in contest.rows]
    return {"levels": list(LEVELS), "methods": methods} if any(methods) else None


def _certainty_of(runs: Runs, rows: Array) -> dict[str, Any] | None:
    coverage, width = (
        [mean(runs.figures[f"{kind}_{level}"][rows]) for level in LEVEL_NAMES] for kind in ("coverage", "interval")
    )
    bins = runs.modes[rows].sum(axis=0, dtype=np.float64)
    bins = bins[bins[:, 0] > 0.0]
    frames, probability, right = bins.T
    if not len(bins) and None in coverage:
        return None
    return {
        "coverage": coverage,
        "width": width,
        "reliability": [[int(count), *sums] for count, *sums in np.c_[frames, bins[:, 1:] / frames[:, None]].tolist()],
        "ece": float(np.abs(probability - right).sum() / frames.sum()) if len(bins) else None,
    }


def search_grid(contest: Contest) -> Array:
    """Return numbers of evaluations for each dimension (up to 61,), evenly on a log scale up to the longest run."""
    runs = [contest.runs.searches[k] for k in map(int, contest.rows.ravel())]
    most = max(float(run.evaluations[-1]) / run.dimension for run in runs)
    return np.unique(np.geomspace(1.0, max(most, 1.0), SEARCH_POINTS))


def search_curves(contest: Contest, evaluations: Array) -> list[tuple[str, list[Intervals]]]:
    """Return the shares (p,) of targets that each method reached after evaluations, of all functions, then of each.

    Intervals are those that other instances would give.
    """
    functions, dimensions, instances = (
        np.array([place[name] for place in contest.places()]) for name in ("function", "dimension", "instance")
    )
    used = contest.runs.hits[contest.rows] / dimensions.astype(np.float64)[None, :, None, None]
    parts = [("All functions", functions > 0)]
    numbers = np.unique(functions).tolist()
    if len(numbers) > 1:
        parts += [(f"{number} {suite_function(number).name}", functions == number) for number in numbers]
    curves = []
    for title, part in parts:
        shares = [
            np.array([attained(hits_of_instance, evaluations) for hits_of_instance in hits_of_method[part]]).T
            for hits_of_method in used
        ]
        curves.append((title, [mean_intervals(one, functions[part], instances[part]) for one in shares]))
    return curves


def running_times(contest: Contest) -> list[dict[str, Any]]:
    """Return the scores of each method's shared runs, a row for each dimension and function: see `suite_scores`.

    There are none of all functions together, whose mean would be that of the hardest.
    """
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
            "ends": [score.running_time_ends[above] for above in SHOWN],
        }
        for method in contest.methods
        for score in suite_scores(contest.runs.searches[k] for k in shared_rows(contest, method).tolist())
        if score.function != ALL
    ]


def _traces(contest: Contest, rows: Array) -> list[Trace]:
    return [contest.runs.traces[k] for k in map(int, rows.ravel())]
