"""The figures of a run that a report holds: where a ledger's row has them, and what tables say of them.

Label, unit, digits and meaning are those of `posefit.tracking.measures`, the one home of a track's figures; the page
takes them from its data, and says the meaning where a column's title is pointed at.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from posefit.tracking.measures import BASELINES, MEASURES, Measure
from posefit.uncertainty.calibration import LEVELS

NAMES = tuple(f"{100 * level:.0f}" for level in LEVELS)  # of intervals, as rows have them
TOLD = "80"  # the interval that tables tell
_SIGNS = {"degrees": "°"}  # of units, where there is little room


@dataclass(frozen=True)
class Column:
    """A figure of a run, under the name that a report's data have for it."""

    name: str
    measure: Measure
    path: tuple[str, ...]  # where in a row it stands
    scale: float = 1.0  # what the row's value is multiplied by
    per_frame: bool = False  # the row has it of all frames together
    rising: bool = False  # more is better
    shown: bool = True  # as a column of the page's tables
    sometimes: bool = False  # only methods that say how sure they are have it, so it is shown where some row has it
    share: bool = False  # of frames or joints, so that a method's is the plain mean over its runs

    def value(self, row: Mapping[str, Any]) -> float:
        """Return the figure of a ledger's row, nan where it has none."""
        found: Any = row
        for part in self.path:
            found = (found or {}).get(part)
        if found is None:
            return math.nan
        return float(found) / row["spec"]["frames"] if self.per_frame else self.scale * float(found)

    @property
    def kept(self) -> int:
        """How many digits after the point the page is given: one more than it shows."""
        return self.measure.digits + 1 + round(math.log10(self.measure.factor))

    @property
    def head(self) -> str:
        """How the head of a file's column calls it: `error (degrees)`. A share stands there as a share."""
        unit = self.measure.unit if self.measure.factor == 1.0 else ""
        return f"{self.measure.label} ({unit})" if unit else self.measure.label

    def about(self) -> dict[str, Any]:
        """Return what the page has to know of it."""
        one = self.measure
        return {
            "label": one.label,
            "title": f"{one.label} {_SIGNS.get(one.unit, one.unit)}".rstrip(),
            "about": one.meaning,
            "digits": one.digits,
            "factor": one.factor,
            "down": self.rising,
        }


def _share(name: str) -> Measure:
    """Return a share of frames with a digit more than of one track: a mean over runs may lie between whole percents."""
    return replace(MEASURES[name], digits=MEASURES[name].digits + 1)


def _skill(baseline: str) -> Measure:
    one = MEASURES["skill"]
    label = BASELINES[baseline]
    return replace(one, label=f"{one.label}: {label}", meaning=f"{one.meaning}; held against the {label}")


def _baseline(name: str) -> Measure:
    return replace(MEASURES["baselines_degrees"], label=BASELINES[name])


def _certainty() -> list[Column]:
    """Return coverage and width of each level's intervals; tables show those of `TOLD`."""
    found = []
    for level in NAMES:
        covered = replace(_share("coverage"), label=f"{level} % interval holds")
        wide = replace(MEASURES["interval_mm"], label=f"{level} % interval")
        how: dict[str, Any] = {"sometimes": True, "shown": level == TOLD}
        found.append(Column(f"coverage_{level}", covered, ("coverage", level), rising=True, share=True, **how))
        found.append(Column(f"interval_{level}", wide, ("interval_mm", level), **how))
    return found


_TIME, _CPU = MEASURES["seconds_per_frame"], MEASURES["cpu_seconds_per_frame"]
_SPENT = replace(MEASURES["evaluations"], unit="a frame", meaning="poses whose cost was computed, the mean over frames")

COLUMNS = {
    column.name: column
    for column in (
        Column("error", MEASURES["error_degrees"], ("error_degrees", "mean")),
        *(Column(f"skill_{name}", _skill(name), ("skill", name), rising=True) for name in BASELINES),
        Column("lost", _share("lost_rate"), ("lost_rate",), share=True),
        Column("swapped", _share("swap_rate"), ("swap_rate",), share=True),
        Column("unknown", _share("unknown_rate"), ("unknown_rate",), sometimes=True, share=True),
        *_certainty(),
        Column("mpjpe", MEASURES["mpjpe_mm"], ("mpjpe_mm",)),
        Column("pa_mpjpe", MEASURES["pa_mpjpe_mm"], ("pa_mpjpe_mm",), shown=False),
        Column("iou", MEASURES["iou"], ("iou",), rising=True),
        Column("cost", MEASURES["cost"], ("cost",), shown=False),
        Column("ms", replace(_TIME, factor=1.0), ("seconds_per_frame",), scale=_TIME.factor),
        Column("cpu_ms", replace(_CPU, factor=1.0), ("cpu_seconds_per_frame",), scale=_CPU.factor),
        Column("evaluations", _SPENT, ("evaluations_used",), per_frame=True),
        *(Column(f"baseline_{name}", _baseline(name), ("baselines_degrees", name), shown=False) for name in BASELINES),
        Column("floor", MEASURES["prior_floor_degrees"], ("prior_floor_degrees",), shown=False),
    )
}
FIGURES = tuple(COLUMNS)
SHOWN = tuple(name for name, column in COLUMNS.items() if column.shown)
