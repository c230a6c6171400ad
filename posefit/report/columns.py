"""The figures of a run that a report shows, and the one that methods are ordered by; their words."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import trim_mean

from posefit.arrays import Array
from posefit.evaluation.measures import Measure
from posefit.reading import counted
from posefit.statistics.intervals import TRIMMED

NAMED = 4  # names that a sentence lists; of more it gives the number
_SYMBOLS = {"degrees": "°"}  # of units, where there is little room


def average_by(function: Callable[[Array], Any]) -> Callable[[Array], float | None]:
    """Return the function of finite values alone, None where there is none."""

    def average(values: Array) -> float | None:
        finite = values[np.isfinite(values)]
        return float(function(finite)) if len(finite) else None

    return average


interquartile_mean = average_by(lambda values: trim_mean(values, TRIMMED))
mean = average_by(np.mean)
median = average_by(np.median)


@dataclass(frozen=True)
class Column:
    """A figure of a run, under the name that it has in a report's data."""

    name: str
    measure: Measure
    path: tuple[str, ...] = ()  # where it stands in a row
    scale: float = 1.0  # what the row's value is multiplied by
    per_frame: bool = False  # the row has the sum over all frames
    higher_is_better: bool = False
    in_tables: bool = True
    # only methods with an uncertainty have it: tables show it if some row has it
    optional: bool = False
    # of a method's runs; of shares the mean
    average: Callable[[Array], float | None] = interquartile_mean

    def value(self, row: Mapping[str, Any]) -> float:
        """Return the figure of a row, nan where it has none."""
        value: Any = row
        for part in self.path:
            value = (value or {}).get(part)
        if value is None:
            return math.nan
        return (
            float(value) / row["spec"]["frames"]
            if self.per_frame
            else self.scale * float(value)
        )

    @property
    def heading(self) -> str:
        """The heading of a file's column, such as `error (degrees)`. Files have shares as numbers from 0 to 1."""
        unit = self.measure.unit if self.measure.factor == 1.0 else ""
        return f"{self.measure.label} ({unit})" if unit else self.measure.label

    def as_dict(self) -> dict[str, Any]:
        """Return what the page needs to show the figure."""
        measure = self.measure
        return {
            "title": f"{measure.label} {_SYMBOLS.get(measure.unit, measure.unit)}".rstrip(),
            "about": measure.meaning,
            "digits": measure.digits,
            "factor": measure.factor,
            "down": self.higher_is_better,
        }


@dataclass(frozen=True, kw_only=True)
class Score:
    """The figure by which methods are ordered, and the texts that depend on it."""

    name: str
    axis: str
    sentence: str  # with a place for the value
    unit: str
    points: str  # the unit of differences
    digits: int
    down: bool  # more is better
    paired: str  # what has differences
    caption: str  # of the first figure
    leaderboard: str

    def text(self, value: float) -> str:
        """Return a value with its digits and unit."""
        return f"{value:.{self.digits}f}{self.unit}"


def listed(values: Sequence[Any], most: int = NAMED) -> str:
    """Return values as a list in a sentence, of many the first and how many others.

    Where they have commas themselves, semicolons separate them.
    """
    texts = [*map(str, values)]
    if len(texts) > most:
        texts = [*texts[: most - 1], counted(len(texts) - most + 1, "other")]
    if len(texts) < 2:
        return "".join(texts)
    comma = "; " if any(", " in text for text in texts) else ", "
    return f"{comma.join(texts[:-1])}{';' if comma == '; ' else ''} and {texts[-1]}"
