"""The usual checks of a plugin's settings, so that every plugin words its refusals alike."""

import math
from collections.abc import Iterable


def at_least(name: str, value: float, least: float) -> None:
    """Return nothing. Raises ValueError where a number is below the least it may be, or is not finite."""
    if not (math.isfinite(value) and value >= least):
        raise ValueError(f"{name} must be at least {least:g}, got {value}")


def between(name: str, value: float, low: float, high: float, *, ends: bool = True) -> None:
    """Return nothing. Raises ValueError where a number is not in low to high, with or without the ends."""
    inside = low <= value <= high if ends else low < value < high
    if not inside:
        way = f"lie in {low:g} to {high:g}" if ends else f"lie between {low:g} and {high:g}"
        raise ValueError(f"{name} must {way}, got {value}")


def positive(name: str, value: float) -> None:
    """Return nothing. Raises ValueError where a number is not finite and above 0."""
    if not (math.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be above 0, got {value}")


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Return nothing. Raises ValueError listing the choices where a value is none of them."""
    known = tuple(known)
    if value not in known:
        raise ValueError(f"{name} must be one of {', '.join(map(str, known))}, got {value!r}")
