"""Options that are declared once: for Python, for the command line and for checks.

Each option is a field of a dataclass of `Options`: its type and default, and with
`option(...)` its help, unit and check. Nothing slow is imported here, because every
start of the command line imports this module.
"""

from collections.abc import Callable
from dataclasses import Field, dataclass, field, fields, replace
from numbers import Integral
from typing import Any, NamedTuple, Self

from posefit.errors import InputError
from posefit.fitting.check import finite_number, one_of, whole
from posefit.reading import quoted

# takes the name and a value that is not None; returns the value to use, or raises
# InputError
Check = Callable[[str, Any], Any]


class Option(NamedTuple):
    """The declaration of an option, except for its name, type and default.

    Attributes:
        help: One sentence for the user.
        check: The check of a value, or None for no check.
        unit: The unit or form of the value: the placeholder on the command line.
        flag: The flag on the command line: None for the option's name, "" for no flag.
        parse: Parses a string from the command line; `bool` makes a pair of flags.
        repeated: Whether the flag may be given several times.
        identifies: Whether a resumed track must have the same value.
        heading: The heading in the help, for this option and the next ones.
        live: Whether `posefit track --live` takes the option.
    """

    help: str
    check: Check | None = None
    unit: str = ""
    flag: str | None = None
    parse: Callable[[str], Any] = str
    repeated: bool = False
    identifies: bool = True
    heading: str = ""
    live: bool = True


def option(default: Any, text: str, *more: Any, **others: Any) -> Any:
    """Return the dataclass field of an option; `Option` explains the arguments."""
    return field(default=default, metadata={"option": Option(text, *more, **others)})


def declared(field: "Field[Any]") -> Option:
    """Return the declaration of a field of `Options`."""
    return field.metadata["option"]  # type: ignore[no-any-return]


def choice(*choices: object) -> Check:
    """Return a check that a value is one of the choices."""

    def check(name: str, value: Any) -> Any:
        one_of(name, value, choices)
        return value

    return check


def within(low: float, high: float, unit: str = "") -> Check:
    """Return a check that a value is a number in a range."""

    def check(name: str, value: Any) -> float:
        if not low <= finite_number(name, value) <= high:
            raise InputError(
                f"{name} must lie in {low:g} to {high:g}{unit}, got {quoted(value)}"
            )
        return float(value)

    return check


def whole_option(
    default: int | None, text: str, least: int, placeholder: str = "N", **others: Any
) -> Any:
    """Return the dataclass field of an option that is a whole number."""
    others = {"parse": int, **others}
    return option(
        default,
        text,
        lambda name, value: whole(name, value, least),
        placeholder,
        **others,
    )


def number_option(
    text: str,
    ends: tuple[float, float],
    placeholder: str,
    unit: str = "",
    **others: Any,
) -> Any:
    """Return the dataclass field of an option that is a number, or None."""
    return option(None, text, within(*ends, unit), placeholder, parse=float, **others)


def is_whole(value: Any) -> bool:
    """Return whether a value is a whole number, of Python or NumPy, but no boolean."""
    return isinstance(value, Integral) and not isinstance(value, bool)


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options, checked when they are made."""

    def __post_init__(self) -> None:
        for each in fields(self):
            value = getattr(self, each.name)
            check = declared(each).check
            if value is None and isinstance(each.default, tuple):
                object.__setattr__(self, each.name, each.default)
            elif value is not each.default and check is not None:
                object.__setattr__(self, each.name, check(each.name, value))

    def changed(self, **values: Any) -> Self:
        """Return these options with some replaced, and all checked again."""
        return replace(self, **values)
