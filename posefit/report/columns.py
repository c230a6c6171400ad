"""The figures of a run that a report shows, and where a row of a ledger has them.

Label, unit, digits and meaning of a track's figures come from `posefit.evaluation.measures`.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.stats import trim_mean

from posefit.arrays import Array
from posefit.evaluation.measures import BASELINES, MEASURES, Measure
from posefit.statistics.intervals import TRIMMED
from posefit.uncertainty.calibration import LEVELS

LEVEL_NAMES = tuple(f"{100 * level:.0f}" for level in LEVELS)  # of intervals, as rows have them
TABLE_LEVEL = "80"  # the interval that tables show
_SYMBOLS = {"degrees": "°"}  # of units, where there is little room


def interquartile_mean(values: Array) -> float | None:
    """Return the interquartile mean of the finite values; None if there is none."""
    finite = values[np.isfinite(values)]
    return float(trim_mean(finite, TRIMMED)) if len(finite) else None


def mean(values: Array) -> float | None:
    """Return the mean of the finite values; None if there is none."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else None


def median(values: Array) -> float | None:
    """Return the median of the finite values; None if there is none."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if len(finite) else None


@dataclass(frozen=True)
class Column:
    """A figure of a run, under the name that it has in a report's data."""

    name: str
    measure: Measure
    path: tuple[str, ...]  # where it stands in a row
    scale: float = 1.0  # what the row's value is multiplied by
    per_frame: bool = False  # the row has the sum over all frames
    higher_is_better: bool = False
    in_tables: bool = True
    optional: bool = False  # only methods with an uncertainty have it: tables show it if some row has it
    average: Callable[[Array], float | None] = interquartile_mean  # of a method's runs; of shares the mean

    def value(self, row: Mapping[str, Any]) -> float:
        """Return the figure of a row, nan where it has none."""
        value: Any = row
        for part in self.path:
            value = (value or {}).get(part)
        if value is None:
            return math.nan
        return float(value) / row["spec"]["frames"] if self.per_frame else self.scale * float(value)

    @property
    def stored_digits(self) -> int:
        """The digits after the point in the page's data: one more than the page shows."""
        return self.measure.digits + 1 + round(math.log10(self.measure.factor))

    @property
    def heading(self) -> str:
        """The heading of a file's column, such as `error (degrees)`. Files have shares as numbers from 0 to 1."""
        unit = self.measure.unit if self.measure.factor == 1.0 else ""
        return f"{self.measure.label} ({unit})" if unit else self.measure.label

    def as_dict(self) -> dict[str, Any]:
        """Return what the page needs to show the figure."""
        measure = self.measure
        return {
            "label": measure.label,
            "title": f"{measure.label} {_SYMBOLS.get(measure.unit, measure.unit)}".rstrip(),
            "about": measure.meaning,
            "digits": measure.digits,
            "factor": measure.factor,
            "down": self.higher_is_better,
        }


def _share(name: str) -> Measure:
    """Return a share with a digit more than for one track: a mean over runs may lie between whole percents."""
    return replace(MEASURES[name], digits=MEASURES[name].digits + 1)


def _skill(baseline: str) -> Measure:
    skill, label = MEASURES["skill"], BASELINES[baseline]
    return replace(skill, label=f"{skill.label}: {label}", meaning=f"{skill.meaning}; compared with the {label}")


def _interval_columns() -> list[Column]:
    """Return coverage and width of the intervals of each level."""
    columns = []
    for level in LEVEL_NAMES:
        coverage = replace(_share("coverage"), label=f"{level} % interval holds")
        width = replace(MEASURES["interval_mm"], label=f"{level} % interval")
        more: dict[str, Any] = {"optional": True, "in_tables": level == TABLE_LEVEL}
        columns += [
            Column(f"coverage_{level}", coverage, ("coverage", level), higher_is_better=True, average=mean, **more),
            Column(f"interval_{level}", width, ("interval_mm", level), **more),
        ]
    return columns


_TIME, _CPU = MEASURES["seconds_per_frame"], MEASURES["cpu_seconds_per_frame"]
_EVALUATIONS = replace(
    MEASURES["evaluations"], unit="a frame", meaning="poses whose cost was computed, the mean over frames"
)
_BASELINE = MEASURES["baselines_degrees"]

COLUMNS = {
    column.name: column
    for column in (
        Column("error", MEASURES["error_degrees"], ("error_degrees", "mean")),
        *(Column(f"skill_{name}", _skill(name), ("skill", name), higher_is_better=True) for name in BASELINES),
        Column("lost", _share("lost_rate"), ("lost_rate",), average=mean),
        Column("swapped", _share("swap_rate"), ("swap_rate",), average=mean),
        Column("unknown", _share("unknown_rate"), ("unknown_rate",), optional=True, average=mean),
        *_interval_columns(),
        Column("mpjpe", MEASURES["mpjpe_mm"], ("mpjpe_mm",)),
        Column("pa_mpjpe", MEASURES["pa_mpjpe_mm"], ("pa_mpjpe_mm",), in_tables=False),
        Column("iou", MEASURES["iou"], ("iou",), higher_is_better=True),
        Column("cost", MEASURES["cost"], ("cost",), in_tables=False),
        Column("ms", replace(_TIME, factor=1.0), ("seconds_per_frame",), scale=_TIME.factor),
        Column("cpu_ms", replace(_CPU, factor=1.0), ("cpu_seconds_per_frame",), scale=_CPU.factor),
        Column("evaluations", _EVALUATIONS, ("evaluations_used",), per_frame=True),
        *(
            Column(f"baseline_{name}", replace(_BASELINE, label=label), ("baselines_degrees", name), in_tables=False)
            for name, label in BASELINES.items()
        ),
        Column("floor", MEASURES["prior_floor_degrees"], ("prior_floor_degrees",), in_tables=False),
    )
}
FIGURES = tuple(COLUMNS)
TABLE_FIGURES = tuple(name for name, column in COLUMNS.items() if column.in_tables)

# Figures of single searches, computed from their traces.
_REACHED = Measure("reached", "targets", "%", 1, "Share of all runs and targets that were reached")
_ABOVE = Measure("above", "above", "", 2, "Median of the best costs above the true pose's")
SEARCH_COLUMNS = {
    "reached": Column("reached", _REACHED, (), higher_is_better=True, average=mean),
    "above": Column("above", _ABOVE, (), average=median),
}

TRACK_SCORE: dict[str, Any] = {  # the figure by which methods are ordered, and the texts that depend on it
    "name": "error",
    "label": "Errors in degrees",
    "axis": "error in degrees",
    "unit": "°",
    "points": "°",  # of differences
    "digits": 2,
    "better": "less",
    "alone": "One seed, or fewer than eight runs of a method, give no interval.",
    "paired": "runs",
    "caption": "Interquartile mean of a method's errors with its 95 % interval; dashed lines are baselines.",
    "leaderboard": "Each figure is the interquartile mean of a method's runs; shares of frames and joints are means. "
    "Skill is 1 − error / baseline, of the errors in this table: 0 is no better than the baseline, which uses the true "
    "root and translation. ",
    "baseless": "",
    "curves": "",
}
SEARCH_SCORE: dict[str, Any] = {
    "name": "reached",
    "label": "Shares of targets reached in per cent",
    "axis": "share of targets reached",
    "unit": " %",
    "points": " points",
    "digits": 1,
    "better": "more",
    "alone": "One instance of a function says nothing about others: there are no intervals.",
    "baseless": "There is no baseline, for the plan has no random search.",
    "paired": "instances",
    "caption": "Share of all runs and targets that a method reached.",
    "leaderboard": "Shares of targets are means over all runs and targets. Above is the median of the best costs above "
    "the true pose's. ",
    "curves": "The share of all runs and targets that a method has reached after so many evaluations for each "
    "dimension of the problem, all dimensions together: the empirical distribution of running times. A higher curve "
    "reaches more targets in the same time. The scale is the same for every function. "
    "Intervals are those that other instances would give.",
}
