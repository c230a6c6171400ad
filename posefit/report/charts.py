"""The charts of a report, for its page and for papers, with a line for each method.

The charts of tracks are here. `posefit.report.searches` has the charts of searches.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.report.columns import mean
from posefit.report.contest import Contest
from posefit.statistics.means import Intervals
from posefit.statistics.profiles import Trace, performance_profile
from posefit.uncertainty.calibration import LEVELS

POINTS = 41  # points of a curve
PROFILE_POINTS = 200  # points of a performance profile
# the levels of intervals in percent, as they are named in rows
LEVEL_NAMES = tuple(f"{100 * level:.0f}" for level in LEVELS)


@dataclass(frozen=True, eq=False)
class Line:
    """A method's line: points from left to right, with an interval of each.

    Attributes:
        x: The x of each point (n,), in ascending order.
        y: The y of each point (n,).
        low: The lower ends of the intervals (n,), nan if unknown; None without
            intervals.
        high: The upper ends (n,).
    """

    x: Array
    y: Array
    low: Array | None = None
    high: Array | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class Chart:
    """A chart with a line for each method that takes part. Lines are drawn as steps.

    Attributes:
        name: Its name, also of its file.
        title: Its title on the page.
        x_label: The label of the x axis.
        y_label: The label of the y axis.
        lines: The line of each method, or None for a method without one.
        log: Whether x has a logarithmic scale.
        most: The upper end of y, or None to fit it to the lines.
    """

    name: str
    title: str
    x_label: str
    y_label: str
    lines: Sequence[Line | None]
    log: bool = False
    most: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the data from which the page draws the chart."""
        return {**vars(self), "lines": [line and vars(line) for line in self.lines]}


def track_charts(contest: Contest) -> list[Chart]:
    """Return the charts of tracks: convergence, and shares of runs within an error."""
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
    levels = np.linspace(0.0, float(errors.max()), PROFILE_POINTS)
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
    """Return numbers of evaluations (up to 41,), spaced evenly on a log scale.

    They span all traces of the contest.
    """
    traces: Sequence[Trace] = contest.data("traces", contest.blocks)
    least = np.inf
    most = 0.0
    for used, _ in traces:
        if len(used):
            least = min(least, used[0])
            most = max(most, used[-1])
    if not most:
        return np.empty(0)
    return np.unique(np.rint(np.geomspace(least, most, POINTS)))


def convergence(contest: Contest, evaluations: Array) -> list[Line | None]:
    """Return each method's mean best cost after each number of evaluations.

    Args:
        contest: The methods and the runs that they share.
        evaluations: The numbers of evaluations (n,), in ascending order.

    Returns:
        For each method a line with intervals, or None if one of its runs has no trace.
        It begins where all of the method's runs have a cost, and ends where the last
        run ends.
    """

    def line(index: int, rows: Array) -> Line | None:
        traces: Sequence[Trace] = contest.data("traces", rows)
        if not all(len(used) for used, _ in traces):
            return None
        first = max(used[0] for used, _ in traces)
        last = max(used[-1] for used, _ in traces)
        points = evaluations[(evaluations >= first) & (evaluations <= last)]
        if not len(points):
            return None
        costs = []
        for used, best in traces:
            # the last improvement at or before each point
            latest = np.searchsorted(used, points, side="right") - 1
            costs.append(best[latest])
        means = contest.means(index, np.array(costs).T)  # of (points, runs)
        return Line(points, means.values, means.low, means.high)

    return [line(index, rows) for index, rows in enumerate(contest.blocks)]


def joint_errors(contest: Contest) -> list[Intervals]:
    """Return each method's mean error of every joint (27,) in mm, with its interval.

    The list is empty if a run lacks the error of a joint.
    """
    intervals = []
    for index, rows in enumerate(contest.blocks):
        joints = np.array(contest.data("joint_errors", rows))  # (blocks, 27)
        if not np.isfinite(joints).all():
            return []
        intervals.append(contest.means(index, joints.T.astype(np.float64)))
    return intervals


def certainty(contest: Contest) -> dict[str, Any] | None:
    """Return how well the methods' uncertainty agrees with the truth.

    Args:
        contest: The methods and the runs that they share.

    Returns:
        None if no run has an uncertainty. Otherwise `levels`, the levels of intervals,
        and `methods` with an entry for each method, which is None if its runs have no
        uncertainty. An entry has `coverage` and `width` (mm) at each level, as means
        over the method's runs, and `ece`, the expected calibration error of its
        likeliest modes by bins of their probability, which is None if no run has modes.
    """
    methods = [_certainty_of(contest, rows) for rows in contest.blocks]
    if not any(methods):
        return None
    return {"levels": list(LEVELS), "methods": methods}


def _certainty_of(contest: Contest, rows: Array) -> dict[str, Any] | None:
    figures = contest.runs.figures
    coverage = [mean(figures[f"coverage.{level}"][rows]) for level in LEVEL_NAMES]
    width = [mean(figures[f"interval_mm.{level}"][rows]) for level in LEVEL_NAMES]
    modes = np.array(contest.data("modes", rows))  # (runs, bins, 3)
    bins = modes.sum(axis=0, dtype=np.float64)
    bins = bins[bins[:, 0] > 0.0]
    if not len(bins) and None in coverage:
        return None
    ece = None
    if len(bins):
        frames, probability, right = bins.T
        ece = float(np.abs(probability - right).sum() / frames.sum())
    return {"coverage": coverage, "width": width, "ece": ece}
