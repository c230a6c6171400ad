"""Units of length: which one a file is in, by a length that a person has."""

import math
from collections.abc import Mapping
from typing import Literal, get_args

from posefit.errors import InputError
from posefit.reading import quoted

Unit = Literal["m", "cm", "mm", "inch", "foot", "cmu"]
UNITS: tuple[Unit, ...] = get_args(Unit)
INCH = 0.0254  # metres
CMU_UNIT = INCH / 0.45  # of the CMU database: its .asf files say `length 0.45`
METRES: Mapping[Unit, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "inch": INCH,
    "foot": 12 * INCH,
    "cmu": CMU_UNIT,
}
UNIT_NAMES: Mapping[Unit, str] = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "inch": "inches",
    "foot": "feet",
    "cmu": "the CMU database's unit (5.64 cm)",
}
STATURES = 0.9, 2.4  # metres that a person stands, from a child of two years on


def metres_of(unit: Unit) -> float:
    """Return how many metres a unit has. Raises InputError where it is none."""
    if unit not in METRES:
        raise InputError(f"unit must be one of {', '.join(UNITS)}, got {quoted(unit)}")
    return METRES[unit]


def unit_of(stature: float) -> Unit | None:
    """Return the unit in which a person may stand so tall; None where there is none, or a length that is none.

    Where several are possible it is the one that is nearest to the middle of `STATURES`, by ratio.
    """
    if not (math.isfinite(stature) and stature > 0.0):
        return None
    low, high = STATURES
    middle = math.log(low * high) / 2.0
    off = {
        unit: abs(float(math.log(stature * METRES[unit])) - middle) for unit in UNITS
    }
    best = min(UNITS, key=off.__getitem__)
    return best if low <= stature * METRES[best] <= high else None
