"""Messages and progress bars of work that takes its time."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

from posefit.errors import printable

WARNING = "warning: "


@dataclass(frozen=True)
class Progress:
    """Where messages go, and what shows the steps of a loop; by default nothing.

    `log` takes a message; `steps` an iterator and how many steps it has, and returns one with the same steps.
    """

    log: Callable[[str], None] = lambda _message: None
    steps: Callable[[Iterator[Any], int], Iterator[Any]] = lambda steps, _count: steps
    # the seconds that each took
    phases: dict[str, float] = field(default_factory=dict, compare=False)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time the body, as a phase of the work."""
        began = perf_counter()
        yield
        self.phases[name] = self.phases.get(name, 0.0) + perf_counter() - began

    def warn(self, warning: str) -> None:
        """Log a warning."""
        self.log(f"{WARNING}{warning}")


QUIET = Progress()


def bars_shown() -> bool:
    """Return whether anybody watches: stderr is a terminal, or this is a notebook."""
    return (
        sys.stderr is not None and sys.stderr.isatty()
    ) or "ipykernel" in sys.modules


def interactive() -> Progress:
    """Return messages and bars on stderr where that is a terminal, bars in a notebook; elsewhere warnings alone."""
    if not bars_shown():

        def show_warning(message: str) -> None:
            if message.startswith(WARNING) and sys.stderr is not None:
                print(printable(message), file=sys.stderr)

        return Progress(show_warning)
    from tqdm.auto import tqdm

    def log(message: str) -> None:
        tqdm.write(printable(message), file=sys.stderr)

    return Progress(
        log,
        lambda steps, count: iter(
            tqdm(steps, total=count, unit="frame", dynamic_ncols=True)
        ),
    )
