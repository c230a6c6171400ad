"""The charts of a report, for its page and for papers: lines of the methods of a contest. Those of tracks are here."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS
from posefit.report.columns import mean
from posefit.report.kind import Contest
from posefit.report.tracks import LEVEL_NAMES
from posefit.statistics.intervals import Intervals, iqm_intervals
from posefit.statistics.profiles import Trace, performance_profile
from posefit.uncertainty.calibration import LEVELS

POINTS = 41  # of a curve
PROFILE = 200  # points of a performance profile


@dataclass(frozen=True, eq=False)
class Line:
    """A method's line: points from left to right, and the ends of their intervals, nan where there are none."""

    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """A chart with a line for each method that takes part, None for those without one."""

    name: str
    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line | None]
    log: bool = False  # the scale of x
    stepped: bool = False
    most: float | None = None  # the end of y

    def as_dict(self) -> dict[str, Any]:
        """Return what the page draws."""
        return {**vars(self), "lines": [line and vars(line) for line in self.lines]}


def track_charts(contest: Contest, drawn: Contest) -> list[Chart]:
    """Return the charts of tracks; curves over evaluations use the runs of `drawn`, which are fewer."""
    evaluations = grid(drawn)
    charts = []
    if len(evaluations):
        title = "Convergence: best cost of a frame"
        x = "evaluations of a frame"
        lines = convergence(drawn, evaluations)
        charts.append(
            Chart(
                name="convergence",
                title=title,
                x_label=x,
                y_label="best cost",
                lines=lines,
                log=True,
            )
        )
    errors = contest.of("error")
    levels = np.linspace(0.0, float(errors.max()), PROFILE)
    profiles = [Line(levels, share) for share in performance_profile(errors, levels)]
    title = "Runs within an error"
    x = "error, degrees"
    y = "share of runs"
    charts.append(
        Chart(
            name="profile",
            title=title,
            x_label=x,
            y_label=y,
            lines=profiles,
            most=1.0,
            stepped=True,
        )
    )
    return [chart for chart in charts if any(chart.lines)]


def grid(contest: Contest) -> Array:
    """Return numbers of evaluations (up to 41,), evenly on a log scale, over all traces of a contest."""
    used = [used for used, _ in _traces(contest, contest.rows) if len(used)]
    if not used:
        return np.empty(0)
    return np.unique(
        np.rint(np.geomspace(min(map(np.min, used)), max(map(np.max, used)), POINTS))
    )


def convergence(contest: Contest, evaluations: Array) -> list[Line | None]:
    """Return each method's best cost after each number of evaluations, with its interval.

    It begins when all its runs have one, and ends when the last has ended; None if a run has no trace.
    """
    count = contest.resamples(contest.rows.size * max(len(evaluations), 1))

    def line(rows: Array) -> Line | None:
        traces = _traces(contest, rows)
        if not all(len(used) for used, _ in traces):
            return None
        first = max(used[0] for used, _ in traces)
        last = max(used[-1] for used, _ in traces)
        points = evaluations[(evaluations >= first) & (evaluations <= last)]
        if not len(points):
            return None
        costs = np.array(
            [
                best[np.searchsorted(used, points, side="right") - 1]
                for used, best in traces
            ]
        )
        part = iqm_intervals(
            costs.T.reshape(-1, *rows.shape), contest.rng(), resamples=count
        )
        return Line(points, part.values, part.low, part.high)

    return [line(rows) for rows in contest.rows]


def joint_errors(contest: Contest) -> list[Intervals]:
    """Return each method's interquartile mean of every joint's error (27,) in mm, with its interval."""
    count = contest.resamples(contest.rows.size * len(JOINTS))
    joints = contest.runs.data["joint_errors"][contest.rows]
    # (methods, 27, instances, seeds)
    errors = np.moveaxis(joints, -1, 1).astype(np.float64)
    if not np.isfinite(errors).all():
        return []
    return [
        iqm_intervals(method_errors, contest.rng(), resamples=count)
        for method_errors in errors
    ]


def certainty(contest: Contest) -> dict[str, Any] | None:
    """Return the methods' uncertainty compared with the truth; None if no run has any.

    `levels` are those of intervals. `methods` has an entry for each method that takes part, None if its runs have no
    uncertainty: at each level the `coverage` and the `width` in mm, plain means over its runs; and the expected
    calibration error `ece` of its likeliest modes, by bins of their probability, None if no run has modes.
    """
    methods = [_certainty_of(contest, rows.ravel()) for rows in contest.rows]
    return {"levels": list(LEVELS), "methods": methods} if any(methods) else None


def _certainty_of(contest: Contest, rows: Array) -> dict[str, Any] | None:
    coverage, width = (
        [mean(contest.runs.figures[f"{figure}_{level}"][rows]) for level in LEVEL_NAMES]
        for figure in ("coverage", "interval")
    )
    bins = contest.runs.data["modes"][rows].sum(axis=0, dtype=np.float64)
    bins = bins[bins[:, 0] > 0.0]
    frames, probability, right = bins.T
    if not len(bins) and None in coverage:
        return None
    return {
        "coverage": coverage,
        "width": width,
        "ece": float(np.abs(probability - right).sum() / frames.sum())
        if len(bins)
        else None,
    }


def _traces(contest: Contest, rows: Array) -> list[Trace]:
    return [contest.runs.data["traces"][k] for k in map(int, rows.ravel())]
