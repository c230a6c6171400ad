"""The charts of a report, for its page and for papers: lines of the methods of a contest. Those of tracks are here."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.report.columns import mean
from posefit.report.kind import Contest
from posefit.statistics.means import Intervals, block_means
from posefit.statistics.profiles import Trace, performance_profile
from posefit.uncertainty.calibration import LEVELS

POINTS = 41  # of a curve
PROFILE = 200  # points of a performance profile
# of intervals, as rows have them
LEVEL_NAMES = tuple(f"{100 * level:.0f}" for level in LEVELS)


@dataclass(frozen=True, eq=False)
class Line:
    """A method's line: points from left to right, and the ends of their intervals, nan where unknown."""

    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """A chart with a line for each method that takes part, None for those without one. Lines are steps."""

    name: str
    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line | None]
    log: bool = False  # the scale of x
    most: float | None = None  # the end of y

    def as_dict(self) -> dict[str, Any]:
        """Return what the page draws."""
        return {**vars(self), "lines": [line and vars(line) for line in self.lines]}


def track_charts(contest: Contest) -> list[Chart]:
    """Return the charts of tracks: convergence, and how many runs are within an error."""
    charts = []
    evaluations = grid(contest)
    if len(evaluations):
        convergence_chart = Chart(
            name="convergence",
            title="Convergence: best cost of a frame",
            x_label="evaluations of a frame",
            y_label="best cost",
            lines=convergence(contest, evaluations),
            log=True,
        )
        charts.append(convergence_chart)
    errors = contest.scores
    levels = np.linspace(0.0, float(errors.max()), PROFILE)
    shares = performance_profile(errors[:, :, None], levels)
    profile_chart = Chart(
        name="profile",
        title="Runs within an error, losses included",
        x_label="error with losses, degrees",
        y_label="share of runs",
        lines=[Line(levels, share) for share in shares],
        most=1.0,
    )
    charts.append(profile_chart)
    return [chart for chart in charts if any(chart.lines)]


def grid(contest: Contest) -> Array:
    """Return numbers of evaluations (up to 41,), evenly on a log scale, over all traces of a contest."""
    used = [used for used, _ in _traces(contest, contest.blocks) if len(used)]
    if not used:
        return np.empty(0)
    least = min(map(np.min, used))
    most = max(map(np.max, used))
    return np.unique(np.rint(np.geomspace(least, most, POINTS)))


def convergence(contest: Contest, evaluations: Array) -> list[Line | None]:
    """Return each method's mean best cost after each number of evaluations, with its interval.

    It begins when all its runs have one, and ends when the last has ended; None if a run has no trace.
    """

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
        means = block_means(costs.T, contest.instance)
        return Line(points, means.values, means.low, means.high)

    return [line(rows) for rows in contest.blocks]


def joint_errors(contest: Contest) -> list[Intervals]:
    """Return each method's mean of every joint's error (27,) in mm, with its interval."""
    joints = contest.runs.data["joint_errors"][contest.blocks]  # (methods, blocks, 27)
    if not np.isfinite(joints).all():
        return []
    return [
        block_means(method_errors.T.astype(np.float64), contest.instance)
        for method_errors in joints
    ]


def certainty(contest: Contest) -> dict[str, Any] | None:
    """Return the methods' uncertainty compared with the truth; None if no run has any.

    `levels` are those of intervals. `methods` has an entry for each method that takes part, None if its runs have no
    uncertainty: at each level the `coverage` and the `width` in mm, plain means over its runs; and the expected
    calibration error `ece` of its likeliest modes, by bins of their probability, None if no run has modes.
    """
    methods = [_certainty_of(contest, rows) for rows in contest.blocks]
    return {"levels": list(LEVELS), "methods": methods} if any(methods) else None


def _certainty_of(contest: Contest, rows: Array) -> dict[str, Any] | None:
    figures = contest.runs.figures
    coverage = [mean(figures[f"coverage.{level}"][rows]) for level in LEVEL_NAMES]
    width = [mean(figures[f"interval_mm.{level}"][rows]) for level in LEVEL_NAMES]
    bins = contest.runs.data["modes"][rows].sum(axis=0, dtype=np.float64)
    bins = bins[bins[:, 0] > 0.0]
    if not len(bins) and None in coverage:
        return None
    ece = None
    if len(bins):
        frames, probability, right = bins.T
        ece = float(np.abs(probability - right).sum() / frames.sum())
    return {"coverage": coverage, "width": width, "ece": ece}


def _traces(contest: Contest, rows: Array) -> list[Trace]:
    return [contest.runs.data["traces"][k] for k in map(int, rows.ravel())]
