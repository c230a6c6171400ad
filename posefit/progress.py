"""Messages and progress bars of work that takes its time."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Progress:
    """Where messages go, and what shows the steps of a loop; by default nothing.

    `log` takes a message; `steps` an iterator and how many steps it has, and returns one with the same steps.
    """

    log: Callable[[str], None] = lambda _message: None
    steps: Callable[[Iterator[Any], int], Iterator[Any]] = lambda steps, _count: steps

    def warn(self, warning: str) -> None:
        """Log a warning."""
        self.log(f"warning: {warning}")


QUIET = Progress()
