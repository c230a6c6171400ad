"""Curves of a sweep: cost over evaluations, targets reached, errors of joints, and how sure methods say they are.

Each of the methods of a contest.
"""

from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import NAMES
from posefit.report.contest import SEED, Contest, mean, resamples
from posefit.statistics.intervals import Intervals, iqm_intervals
from posefit.statistics.profiles import Trace, attained, hits, targets
from posefit.uncertainty.calibration import LEVELS

POINTS = 41  # of a curve


def grid(contest: Contest) -> Array:
    """Return numbers of evaluations (up to 41,), evenly on a log scale, over all traces of a contest."""
    ends = [(used[0], used[-1]) for used, _ in _traces(contest, range(len(contest.methods))) if len(used)]
    if not ends:
        return np.empty(0)
    return np.unique(np.rint(np.geomspace(min(a for a, _ in ends), max(b for _, b in ends), POINTS)))


def convergence(contest: Contest, evaluations: Array) -> list[Intervals | None]:
    """Return each method's best cost after each number of evaluations, with its interval.

    nan before all its runs have one and after the last has ended; None where runs of it have no trace.
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
        found = iqm_intervals(blocks, np.random.default_rng(SEED), resamples=count)
        values[:, known] = found.values, found.low, found.high
    return Intervals(*values)


def reached(contest: Contest, evaluations: Array) -> Array:
    """Return the shares (methods, p) of a method's runs and targets reached after each number of evaluations.

    The targets of an instance lie between the worst first and the best last cost of any run there.
    """
    methods, instances, seeds = contest.rows.shape
    found = np.zeros((methods, len(evaluations)))
    for i in range(instances):
        traces = [contest.runs.traces[int(k)] for k in contest.rows[:, i].ravel()]
        usable = [trace for trace in traces if len(trace[0])]
        if not usable:
            continue
        wanted = targets(usable)
        for m in range(methods):
            mine = traces[m * seeds : (m + 1) * seeds]
            times = [hits(one, wanted) if len(one[0]) else np.full(len(wanted), np.inf) for one in mine]
            found[m] += attained(np.array(times), evaluations) / instances
    return found


def joint_errors(contest: Contest) -> list[Intervals]:
    """Return of each method the interquartile mean of every joint's error (27,) in mm, with its interval."""
    count = resamples(contest.rows.size * len(JOINTS))
    errors = np.moveaxis(contest.runs.joint_errors[contest.rows], -1, 1).astype(np.float64)  # (m, 27, instances, seeds)
    rng = np.random.default_rng(SEED)
    return [iqm_intervals(one, rng, resamples=count) for one in errors] if np.isfinite(errors).all() else []


def certainty(contest: Contest) -> dict[str, Any] | None:
    """Return what methods say of their own certainty, held against the truth; None where no run says anything.

    `levels` are those of intervals. `methods` has an entry for each method that takes part, in their order, None where
    its runs say nothing: at each level the `coverage` and the `width` in mm, plain means over its runs; and the
    `reliability` of its likeliest modes, [frames, mean probability, share that is right] for each bin that has any,
    with their expected calibration error `ece`, None where no run has modes.
    """
    found = [_certainty_of(contest, place) for place in range(len(contest.methods))]
    return {"levels": list(LEVELS), "methods": found} if any(one is not None for one in found) else None


def _certainty_of(contest: Contest, place: int) -> dict[str, Any] | None:
    rows = contest.rows[place].ravel()
    figures = {
        kind: [mean(contest.runs.figures[f"{kind}_{level}"][rows]) for level in NAMES]
        for kind in ("coverage", "interval")
    }
    bins = contest.runs.modes[rows].sum(axis=0, dtype=np.float64)
    bins = bins[bins[:, 0] > 0.0]
    shares = [[int(count), told / count, right / count] for count, told, right in bins.tolist()]
    if not shares and None in figures["coverage"]:
        return None
    off = [abs(told - right) for _, told, right in bins.tolist()]
    return {
        "coverage": figures["coverage"],
        "width": figures["interval"],
        "reliability": shares,
        "ece": float(sum(off) / bins[:, 0].sum()) if shares else None,
    }


def shown(curve: Intervals | None) -> dict[str, Any] | None:
    """Return a curve as JSON holds it, but for nan."""
    return None if curve is None else {"values": curve.values, "low": curve.low, "high": curve.high}


def _traces(contest: Contest, methods: Any) -> list[Trace]:
    return [contest.runs.traces[int(k)] for m in methods for k in contest.rows[m].ravel()]
