"""The figures of a run in a report, the score that orders methods, and their texts."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.evaluation.measures import Measure
from posefit.reading import counted

MIN_P = 0.001  # a lower p is shown as `p < 0.001`
MAX_NAMES = 4  # in a sentence, which counts the others
_SYMBOLS = {"degrees": "°"}  # short forms of units, for titles of columns


def average_by(function: Callable[[Array], Any]) -> Callable[[Array], float | None]:
    """Return a function that applies another to the finite values of an array.

    Its result is None if no value is finite.
    """

    def average(values: Array) -> float | None:
        finite = values[np.isfinite(values)]
        return float(function(finite)) if len(finite) else None

    return average


mean = average_by(np.mean)
median = average_by(np.median)


@dataclass(frozen=True)
class Column:
    """A figure of a run.

    Attributes:
        measure: Its name, label, unit, digits and meaning. The name is the same in a
            row of a ledger, in the CSV, in the report's data and on the page.
            `coverage.80` is the entry `80` of the row's `coverage`.
        higher_is_better: Whether a higher value is better.
        in_tables: Whether tables show it.
        optional: Whether tables show it only if some row has it. Only methods with an
            uncertainty have such figures.
        brief: Whether the table of all runs shows it without a click.
        average: Returns the average of several runs.
    """

    measure: Measure
    higher_is_better: bool = False
    in_tables: bool = True
    optional: bool = False
    brief: bool = False
    average: Callable[[Array], float | None] = mean

    @property
    def name(self) -> str:
        """Its name."""
        return self.measure.name

    @property
    def title(self) -> str:
        """Its label and unit, the title of a table's column."""
        unit = _SYMBOLS.get(self.measure.unit, self.measure.unit)
        return f"{self.measure.label} {unit}".rstrip()

    def value(self, row: Mapping[str, Any]) -> float:
        """Return the figure of a row, or nan if the row does not have it."""
        value: Any = row
        for part in self.name.split("."):
            value = (value or {}).get(part)
        return math.nan if value is None else float(value)

    def as_dict(self) -> dict[str, Any]:
        """Return the data with which the page shows the figure."""
        measure = self.measure
        return {
            "title": self.title,
            "about": f"{measure.meaning} ({self.name})",
            "digits": measure.digits,
            "factor": measure.factor,
            "down": self.higher_is_better,
            "brief": self.brief,
        }


@dataclass(frozen=True, kw_only=True)
class Score:
    """The figure by which methods are ordered, and the texts that depend on it.

    Attributes:
        column: The figure.
        axis: The label of its axis.
        sentence: A part of a sentence, with `{}` for the value.
        unit: The unit of its values.
        points: The unit of differences between values.
        paired: The blocks of paired tests, in the plural: runs or instances.
        caption: The caption of the first figure.
        leaderboard: The text above the leaderboard.
    """

    column: Column
    axis: str
    sentence: str
    unit: str
    points: str
    paired: str
    caption: str
    leaderboard: str

    @property
    def name(self) -> str:
        """The figure's name."""
        return self.column.name

    @property
    def digits(self) -> int:
        """Its digits after the point."""
        return self.column.measure.digits

    @property
    def higher_is_better(self) -> bool:
        """Whether a higher value is better."""
        return self.column.higher_is_better

    def as_dict(self) -> dict[str, Any]:
        """Return the data with which the page shows the score."""
        texts = {name: text for name, text in vars(self).items() if name != "column"}
        return {
            **texts,
            "name": self.name,
            "digits": self.digits,
            "down": self.higher_is_better,
        }

    def badness(self, value: Any) -> Any:
        """Return a number, or an array, that is lower for better values."""
        return -value if self.higher_is_better else value

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
    """Return the text of a p, such as `p = 0.034` or `p < 0.001`."""
    return f"p < {MIN_P}" if p < MIN_P else f"p = {p:.2g}"


def listed(values: Sequence[Any], most: int = MAX_NAMES) -> str:
    """Return values as a list in a sentence, such as `a, b and 3 others`.

    Semicolons separate values that contain commas.

    Args:
        values: The values.
        most: The most items of the list, the number of others included.

    Returns:
        The text, empty without values.
    """
    texts = [*map(str, values)]
    if len(texts) > most:
        others = counted(len(texts) - most + 1, "other")
        texts = [*texts[: most - 1], others]
    if len(texts) < 2:
        return "".join(texts)
    if any(", " in text for text in texts):
        return f"{'; '.join(texts[:-1])}; and {texts[-1]}"
    return f"{', '.join(texts[:-1])} and {texts[-1]}"
