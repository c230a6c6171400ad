"""Checks of settings and arguments, whose errors have one wording."""

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any

from posefit.errors import InputError
from posefit.hints import choices_of, resolved
from posefit.reading import cut, quoted, suggestion

MAX_BITS = 1_024  # bits of a whole number, so that it can be printed


def at_least(name: str, value: float, least: float) -> None:
    """Raise InputError if a number is less than `least` or not finite."""
    if not (math.isfinite(value) and value >= least):
        raise InputError(f"{name} must be at least {least:g}, got {value}")


def between(
    name: str, value: float, low: float, high: float, *, ends: bool = True
) -> None:
    """Raise InputError if a number is not in low to high, with or without the ends."""
    inside = low <= value <= high if ends else low < value < high
    if not inside:
        way = f"in {low:g} to {high:g}" if ends else f"between {low:g} and {high:g}"
        raise InputError(f"{name} must lie {way}, got {cut(str(value))}")


def positive(name: str, value: float) -> None:
    """Raise InputError if a number is not finite or not above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be above 0, got {value}")


def whole(name: str, value: object, least: int) -> int:
    """Return a whole number as an int.

    Raises:
        InputError: If the value is no whole number, or less than `least`.

    """
    if (
        isinstance(value, bool)
        or not isinstance(value, Integral)
        or int(value).bit_length() > MAX_BITS
    ):
        raise InputError(
            f"{name} must be a whole number of at least {least}, got {quoted(value)}"
        )
    if value < least:
        range_ = f"at least {least}" if least else "0 or more"
        raise InputError(f"{name} must be {range_}, got {quoted(int(value))}")
    return int(value)


def finite_number(name: str, value: object) -> float:
    """Return a finite number as a float. Raises InputError for anything else."""
    try:
        number = (
            float(value)
            if isinstance(value, Real) and not isinstance(value, bool)
            else math.nan
        )
    except OverflowError:  # a whole number of any size
        number = math.inf
    if not math.isfinite(number):
        raise InputError(f"{name} must be a finite number, got {quoted(value)}")
    return number


def pair(name: str, value: object, what: str) -> tuple[Any, Any]:
    """Return a pair of values.

    Raises InputError for anything else. `what` names what was expected.
    """
    # an array has `tolist`
    values = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise InputError(f"{name} must be {what}, got {quoted(value)}")
    return values[0], values[1]


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise InputError with the known choices if a value is not among them."""
    known = tuple(known)
    if value not in known:
        hint = suggestion(value, map(str, known)) if isinstance(value, str) else ""
        listed = ", ".join(map(str, known))
        raise InputError(f"{name} must be one of {listed}, got {quoted(value)}{hint}")


def choices(settings: Any, values: Mapping[str, object]) -> None:
    """Raise InputError if a value is not listed in its annotation, a `Literal`.

    Args:
        settings: A function or a class, with annotated parameters or attributes.
        values: The values by name. Names without a `Literal` are ignored.

    """
    for name, annotation in settings.__annotations__.items():
        if listed := choices_of(resolved(settings, annotation)):
            one_of(name, values[name], listed)
