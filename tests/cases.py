"""Cases of one test: a loop in it, whose failure still names the case."""

from collections.abc import Iterable, Iterator
from typing import TypeVar

Value = TypeVar("Value")


def cases(values: Iterable[Value]) -> Iterator[Value]:
    """Yield values, each printed: what pytest captured ends with the case that failed."""
    for value in values:
        print(f"case {value!r}")
        yield value
