"""Who hears of it while something takes its time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, TypeVar

T = TypeVar("T")


def _nothing(_: str) -> None:
    """Say nothing."""


def _unwatched(steps: Iterator[Any], _: int) -> Iterator[Any]:
    return steps


@dataclass(frozen=True)
class Listener:
    """`say` gets messages; `progress` gets an iterator and how many steps it has, and gives one with the same steps."""

    say: Callable[[str], None] = _nothing
    progress: Callable[[Iterator[Any], int], Iterator[Any]] = _unwatched


QUIET = Listener()
