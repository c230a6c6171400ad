"""Units of length, and the unit of a file by the height of its person."""

import math
from collections.abc import Mapping
from typing import Literal, get_args

from posefit.errors import InputError
from posefit.reading import quoted

Unit = Literal["m", "cm", "mm", "inch", "foot", "cmu"]
UNITS: tuple[Unit, ...] = get_args(Unit)
INCH = 0.0254  # metres
CMU_UNIT = INCH / 0.45  # metres; .asf files of the CMU database say `length 0.45`
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
STATURES = 0.9, 2.4  # metres: the height of a person from two years on


def metres_of(unit: Unit) -> float:
    """Return the metres in a unit. Raises InputError if the unit is unknown."""
    if unit not in METRES:
        raise InputError(f"unit must be one of {', '.join(UNITS)}, got {quoted(unit)}")
    return METRES[unit]


def unit_of(stature: float) -> Unit | None:
    """Return the unit in which a person may have this height, or None.

    If several units are possible, it is the unit nearest to the middle of `STATURES`,
    by ratio. The result is None if no unit is possible or the height is not positive
    and finite.
    """
    if not (math.isfinite(stature) and stature > 0.0):
        return None
    low, high = STATURES
    middle = math.log(low * high) / 2.0

    def distance(unit: Unit) -> float:
        return abs(float(math.log(stature * METRES[unit])) - middle)

    best = min(UNITS, key=distance)
    if low <= stature * METRES[best] <= high:
        return best
    return None
