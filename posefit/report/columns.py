"""The figures of a run that a report shows, and the one that methods are ordered by; their words."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import Measure
from posefit.reading import counted

NAMED = 4  # names that a sentence lists; of more it gives the number
_SYMBOLS = {"degrees": "°"}  # of units, where there is little room


def average_by(function: Callable[[Array], Any]) -> Callable[[Array], float | None]:
    """Return the function of finite values alone, None without any."""

    def average(values: Array) -> float | None:
        finite = values[np.isfinite(values)]
        return float(function(finite)) if len(finite) else None

    return average


mean = average_by(np.mean)
median = average_by(np.median)


@dataclass(frozen=True)
class Column:
    """A figure of a run.

    Its name is the same in a row of a ledger, in the CSV, in the report's data and on the page: `coverage.80` is the
    entry `80` of the row's `coverage`. A figure that no row has is computed from the row by `compute`.
    """

    name: str
    measure: Measure
    compute: Callable[[Mapping[str, Any]], float] | None = None
    higher_is_better: bool = False
    in_tables: bool = True
    # only methods with an uncertainty have it: tables show it if some row has it
    optional: bool = False
    average: Callable[[Array], float | None] = mean

    def value(self, row: Mapping[str, Any]) -> float:
        """Return the figure of a row, nan if it has none."""
        if self.compute is not None:
            return self.compute(row)
        value: Any = row
        for part in self.name.split("."):
            value = (value or {}).get(part)
        return math.nan if value is None else float(value)

    def as_dict(self) -> dict[str, Any]:
        """Return what the page needs to show the figure."""
        measure = self.measure
        symbol = _SYMBOLS.get(measure.unit, measure.unit)
        return {
            "title": f"{measure.label} {symbol}".rstrip(),
            "about": f"{measure.meaning} ({self.name})",
            "digits": measure.digits,
            "factor": measure.factor,
            "down": self.higher_is_better,
        }


@dataclass(frozen=True, kw_only=True)
class Score:
    """The figure by which methods are ordered, and the texts that depend on it."""

    name: str
    title: str  # of its column in a printed table
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
        return f"{value:z.{self.digits}f}{self.unit}"

    def amount(self, value: float) -> str:
        """Return a difference with its digits and unit."""
        return f"{value:z.{self.digits}f}{self.points}".replace("-", "−")

    def difference(self, value: float) -> str:
        """Return a difference with its sign, digits and unit."""
        return f"{value:+z.{self.digits}f}{self.points}".replace("-", "−")


def p_text(p: float) -> str:
    """Return a p as a sentence has it: `p = 0.034`, or `p < 0.001`."""
    return "p < 0.001" if p < 0.001 else f"p = {p:.2g}"


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
