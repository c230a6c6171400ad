"""What runs cells in other processes: an engine. It keeps no order and no state; the ledger does."""

import signal
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from posefit.errors import InputError
from posefit.sweep.cell import Cell, CellResult

J = TypeVar("J")  # a job: a cell, or whatever else its function takes
R = TypeVar("R")
Run = Callable[[Any], CellResult]
# Signals that nothing in a cell raises by mistake: they were sent from outside. So does the kernel where memory runs
# out; a cell's own limit of memory comes first, where the machine has as much as all cells may take.
OUTSIDE = ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGPWR")


@dataclass(frozen=True)
class Limits:
    """How many seconds a cell may take, and how much memory its process may have."""

    seconds: float = 3600.0
    gigabytes: float = 4.0

    def __post_init__(self) -> None:
        for name in ("seconds", "gigabytes"):
            if not getattr(self, name) > 0.0:
                raise InputError(f"the limit of {name} must be above 0, got {getattr(self, name)}")


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


class EngineError(InputError):
    """An engine cannot go on."""


class FailedError(Exception):
    """A cell raised something, as one line: what a plugin raises may not survive the way to another process."""


class NotStartedError(Exception):
    """A process ended, or did not answer, before its cell began."""


class DiedError(Exception):
    """A process ended before its cell did, with this status; a negative one is the signal that ended it."""

    def __init__(self, exitcode: int) -> None:
        super().__init__(exitcode)
        self.exitcode = exitcode


def reason_of(error: Exception, limits: Limits) -> tuple[str, bool]:
    """Return in one line why a cell failed, and whether that is its own fault."""
    if isinstance(error, DiedError) and error.exitcode < 0:
        try:
            name = signal.Signals(-error.exitcode).name
        except ValueError:
            name = f"signal {-error.exitcode}"
        if name != "SIGALRM":  # the timer of `limited`
            return f"its process died of {name}", name not in OUTSIDE
        error = TimeoutError()
    if isinstance(error, TimeoutError):
        return f"it ran past its limit of {limits.seconds:g} s", True
    if isinstance(error, MemoryError):
        return f"it wanted more memory than its limit of {limits.gigabytes:g} GB", True
    if isinstance(error, DiedError):
        return f"its process ended itself with status {error.exitcode}", True
    if isinstance(error, NotStartedError | FailedError):
        return str(error), isinstance(error, FailedError)
    return text_of(error), True


def text_of(error: BaseException) -> str:
    """Return an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
