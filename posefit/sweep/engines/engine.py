"""What runs cells in other processes: an engine. It keeps no order and no state; the ledger does."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from posefit.errors import InputError
from posefit.fitting.check import between
from posefit.limits import GIGABYTES, SECONDS
from posefit.sweep.cell import Cell, CellResult

J = TypeVar("J")  # a job: a cell, or whatever else its function takes
R = TypeVar("R")  # its result
Run = Callable[[Any], CellResult]


@dataclass(frozen=True)
class Limits:
    """How many seconds a cell may take, and how much memory its process may have."""

    seconds: float = 3600.0
    gigabytes: float = 4.0

    def __post_init__(self) -> None:
        between("the limit of seconds", self.seconds, *SECONDS)
        between("the limit of gigabytes", self.gigabytes, *GIGABYTES)


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


def text_of(error: BaseException) -> str:
    """Return an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
