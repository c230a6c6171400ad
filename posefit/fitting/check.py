"""Checks of settings and arguments, whose errors have one wording."""

import math
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any

from posefit.errors import InputError
from posefit.hints import choices_of, resolved
from posefit.reading import cut, quoted, suggestion

MAX_BITS = 1_024  # of a whole number, so that it can be written down


def at_least(name: str, value: float, least: float) -> None:
    """Raise InputError where a number is below the least it may be, or is not finite."""
    if not (math.isfinite(value) and value >= least):
        raise InputError(f"{name} must be at least {least:g}, got {value}")


def between(
    name: str, value: float, low: float, high: float, *, ends: bool = True
) -> None:
    """Raise InputError where a number is not in low to high, with or without the ends."""
    inside = low <= value <= high if ends else low < value < high
    if not inside:
        way = (
            f"lie in {low:g} to {high:g}"
            if ends
            else f"lie between {low:g} and {high:g}"
        )
        raise InputError(f"{name} must {way}, got {cut(str(value))}")


def positive(name: str, value: float) -> None:
    """Raise InputError where a number is not finite and above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be above 0, got {value}")


def whole(name: str, value: object, least: int) -> int:
    """Return a whole number as an int. Raises InputError where it is none, or below the least it may be."""
    if (
        isinstance(value, bool)
        or not isinstance(value, Integral)
        or int(value).bit_length() > MAX_BITS
    ):
        raise InputError(
            f"{name} must be a whole number of at least {least}, got {quoted(value)}"
        )
    if value < least:
        raise InputError(
            f"{name} must be {f'at least {least}' if least else '0 or more'}, got {quoted(int(value))}"
        )
    return int(value)


def finite_number(name: str, value: object) -> float:
    """Return a finite number as a float. Raises InputError where it is none."""
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
    """Return two values. Raises InputError where it is anything else; `what` says what was expected."""
    values = value.tolist() if hasattr(value, "tolist") else value  # an array
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise InputError(f"{name} must be {what}, got {quoted(value)}")
    return values[0], values[1]


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise InputError listing the choices where a value is none of them."""
    known = tuple(known)
    if value not in known:
        hint = suggestion(value, map(str, known)) if isinstance(value, str) else ""
        raise InputError(
            f"{name} must be one of {', '.join(map(str, known))}, got {quoted(value)}{hint}"
        )


def choices(settings: Any, values: Mapping[str, object]) -> None:
    """Raise InputError where a value is none of those that its annotation, a `Literal`, lists.

    `settings` is a function with such parameters, or a class with such attributes; `values` may hold others too.
    """
    for name, annotation in settings.__annotations__.items():
        if listed := choices_of(resolved(settings, annotation)):
            one_of(name, values[name], listed)
