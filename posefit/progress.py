"""Messages and progress bars of long work."""

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
    """Receives messages and shows the steps of a loop; by default it does nothing.

    Attributes:
        log: Takes a message.
        steps: Takes an iterator and its length, and returns the same steps.
        phases: Seconds that each phase took, by name.
    """

    log: Callable[[str], None] = lambda _message: None
    steps: Callable[[Iterator[Any], int], Iterator[Any]] = lambda steps, _count: steps
    phases: dict[str, float] = field(default_factory=dict, compare=False)

    @contextmanager
    def phase(self, name: str) -> Iterator[None]:
        """Time the body as a phase of the work."""
        began = perf_counter()
        yield
        self.phases[name] = self.phases.get(name, 0.0) + perf_counter() - began

    def warn(self, warning: str) -> None:
        """Log a warning."""
        self.log(f"{WARNING}{warning}")


QUIET = Progress()


def bars_shown() -> bool:
    """Return whether somebody watches: stderr is a terminal, or this is a notebook."""
    if sys.stderr is not None and sys.stderr.isatty():
        return True
    return "ipykernel" in sys.modules


def interactive() -> Progress:
    """Return progress with messages and bars in a terminal or a notebook.

    Elsewhere only warnings are shown. Messages go to stderr.
    """
    if not bars_shown():

        def show_warning(message: str) -> None:
            if message.startswith(WARNING) and sys.stderr is not None:
                print(printable(message), file=sys.stderr)

        return Progress(show_warning)
    from tqdm.auto import tqdm

    def log(message: str) -> None:
        tqdm.write(printable(message), file=sys.stderr)

    def steps(steps: Iterator[Any], count: int) -> Iterator[Any]:
        return iter(tqdm(steps, total=count, unit="frame", dynamic_ncols=True))

    return Progress(log, steps)
