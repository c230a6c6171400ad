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
    """Raise InputError if a number is less than `least` or not finite.

    Args:
        name: The value's name in the message.
        value: The value.
        least: The least allowed value.

    Raises:
        InputError: The value is less, or not finite.

    Example:
        >>> from posefit.plugin import at_least
        >>> at_least("population_size", 0, 1)
        Traceback (most recent call last):
        posefit.errors.InputError: population_size must be at least 1, got 0
    """
    if not (math.isfinite(value) and value >= least):
        raise InputError(f"{name} must be at least {least:g}, got {value}")


def between(
    name: str, value: float, low: float, high: float, *, ends: bool = True
) -> None:
    """Raise InputError if a number is not in low to high, with or without the ends.

    Args:
        name: The value's name in the message.
        value: The value.
        low: The lower end.
        high: The upper end.
        ends: Whether the ends are allowed.

    Raises:
        InputError: The value is outside.

    Example:
        >>> from posefit.plugin import between
        >>> between("quantile", 0.99, 0.0, 1.0)
        >>> between("quantile", 1.0, 0.0, 1.0, ends=False)
        Traceback (most recent call last):
        posefit.errors.InputError: quantile must lie between 0 and 1, got 1.0
    """
    if ends:
        inside = low <= value <= high
    else:
        inside = low < value < high
    if not inside:
        if ends:
            way = f"in {low:g} to {high:g}"
        else:
            way = f"between {low:g} and {high:g}"
        raise InputError(f"{name} must lie {way}, got {cut(str(value))}")


def positive(name: str, value: float) -> None:
    """Raise InputError if a number is not finite or not above 0.

    Args:
        name: The value's name in the message.
        value: The value.

    Raises:
        InputError: The value is not finite, or not above 0.

    Example:
        >>> from posefit.plugin import positive
        >>> positive("shrink", 0.95)
        >>> positive("shrink", 0.0)
        Traceback (most recent call last):
        posefit.errors.InputError: shrink must be above 0, got 0.0
    """
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(f"{name} must be above 0, got {value}")


def whole(name: str, value: object, least: int) -> int:
    """Return a whole number as an int.

    Args:
        name: The value's name in the message.
        value: The value, of any whole-number type.
        least: The least allowed value.

    Returns:
        The value.

    Raises:
        InputError: The value is not a whole number, or less than `least`.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import whole
        >>> whole("iterations", np.int64(60), 1)
        60
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
        if isinstance(value, Real) and not isinstance(value, bool):
            number = float(value)
        else:
            number = math.nan
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
    if hasattr(value, "tolist"):
        values = value.tolist()
    else:
        values = value
    if not isinstance(values, tuple | list) or len(values) != 2:
        raise InputError(f"{name} must be {what}, got {quoted(value)}")
    return values[0], values[1]


def one_of(name: str, value: object, known: Iterable[object]) -> None:
    """Raise InputError with the known choices if a value is not among them.

    Args:
        name: The value's name in the message.
        value: The value.
        known: The allowed values.

    Raises:
        InputError: The value is not among them.

    Example:
        >>> from posefit.plugin import one_of
        >>> one_of("limits", "tight", ["wide", "narrow"])
        Traceback (most recent call last):
        posefit.errors.InputError: limits must be one of wide, narrow, got 'tight'
    """
    known = tuple(known)
    if value not in known:
        if isinstance(value, str):
            hint = suggestion(value, map(str, known))
        else:
            hint = ""
        listed = ", ".join(map(str, known))
        raise InputError(f"{name} must be one of {listed}, got {quoted(value)}{hint}")


def choices(settings: Any, values: Mapping[str, object]) -> None:
    """Raise InputError if a value is not listed in its annotation, a `Literal`.

    Args:
        settings: A function or a class, with annotated parameters or attributes.
        values: The values by name. Names without a `Literal` are ignored.

    Raises:
        InputError: A value is not listed.

    Example:
        >>> from typing import Literal
        >>> from posefit.plugin import choices
        >>> def factory(space, rng, *, variant: Literal["a", "b"] = "a"):
        ...     choices(factory, locals())
        >>> factory(None, None, variant="b")
        >>> factory(None, None, variant="c")
        Traceback (most recent call last):
        posefit.errors.InputError: variant must be one of a, b, got 'c'
    """
    for name, annotation in settings.__annotations__.items():
        if listed := choices_of(resolved(settings, annotation)):
            one_of(name, values[name], listed)
