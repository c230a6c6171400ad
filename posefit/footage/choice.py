"""How a user says which of several people is followed."""

from typing import Any

from posefit.fitting.check import finite_number, pair, whole
from posefit.options import is_whole

# a person by number, from 1 for the longest visible, or by a point at which they appear
Choice = int | tuple[float, float]


def checked_person(name: str, value: Any) -> Choice:
    """Return the number or the place of a person. Raises InputError for others."""
    if is_whole(value):
        return whole(name, value, 1)
    across, down = pair(name, value, "a number, or (across, down) in pixels")
    return finite_number(name, across), finite_number(name, down)
