"""What runs cells, somewhere else: an engine. It keeps no order and no state; the ledger does."""

import signal
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from posefit.sweep.cell import Cell, CellResult
from posefit.sweep.engines.limits import FailedError, Limits, text_of

J = TypeVar("J")  # a job: a cell, or whatever else its function takes
R = TypeVar("R")
Run = Callable[[Any], CellResult]
# Signals that nothing in a cell brings about by mistake: somebody or something outside sent them. So does the kernel
# where memory runs out; a cell's own limit of memory comes first, where the machine has as much as all cells may take.
OUTSIDE = ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGPWR")


@dataclass(frozen=True)
class Ended(Generic[J, R]):
    """What became of a job: a result, or the reason why there is none, and whether that is the job's own fault.

    With neither it was lost with what ran it, and counts as not tried.
    """

    cell: J
    result: R | None = field(default=None, repr=False)
    reason: str | None = None
    own: bool = True  # its own fault: a limit, an exception, a segfault, an exit; not a kill from outside


Outcome = Ended[Cell, CellResult]


class Engine(Protocol):
    """Runs so many cells at a time."""

    def window(self) -> int:
        """Return how many cells may run at the moment. Raises EngineError where the engine is gone for good."""
        ...

    def submit(self, cell: Cell) -> None:
        """Start a cell."""
        ...

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the cells that ended, once one has or the time is over."""
        ...

    def close(self) -> None:
        """Stop everything, whatever still runs."""
        ...


class EngineError(ValueError):
    """An engine cannot go on."""


class DiedError(Exception):
    """A process ended before its cell did, with this status; a negative one is the signal that ended it."""

    def __init__(self, exitcode: int) -> None:
        super().__init__(exitcode)
        self.exitcode = exitcode


def reason_of(error: BaseException, limits: Limits) -> tuple[str, bool]:
    """Return in one line why a cell failed, and whether that is its own fault."""
    if isinstance(error, TimeoutError):
        return f"it ran past its limit of {limits.seconds:g} s", True
    if isinstance(error, MemoryError):
        return f"it wanted more memory than its limit of {limits.gigabytes:g} GB", True
    if isinstance(error, BrokenProcessPool):  # it had not begun
        return "its process died before the cell began", False
    if isinstance(error, FailedError):
        return str(error), True
    code = getattr(error, "exitcode", None)  # of `DiedError`, and of pebble's ProcessExpired
    if isinstance(code, int) and code < 0:
        name = _signal(-code)
        if name == "SIGALRM":  # the timer that `limited` sets for when nobody else notices
            return reason_of(TimeoutError(), limits)
        return f"its process died of {name}", name not in OUTSIDE
    if isinstance(code, int):
        return f"its process ended itself with status {code}", True
    return text_of(error), True


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
