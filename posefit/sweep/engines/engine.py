"""What runs cells, somewhere else: an engine. It keeps no order and no state; the ledger does."""

import signal
from collections.abc import Callable
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from posefit.sweep.cell import Cell, CellResult
from posefit.sweep.engines.limits import Limits

J = TypeVar("J")  # a job: a cell, or whatever else its function takes
R = TypeVar("R")
Run = Callable[[Cell], CellResult]


@dataclass(frozen=True)
class Ended(Generic[J, R]):
    """What became of a job: a result, or the reason why there is none. With neither it was lost by no fault of its."""

    cell: J
    result: R | None = field(default=None, repr=False)
    reason: str | None = None


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


def reason_of(error: BaseException, limits: Limits) -> str:
    """Return in one line why a cell failed."""
    if isinstance(error, TimeoutError):
        return f"it ran past its limit of {limits.seconds:g} s"
    if isinstance(error, MemoryError):
        return f"it wanted more memory than its limit of {limits.gigabytes:g} GB"
    if isinstance(error, BrokenProcessPool):
        return "its process died"
    code = getattr(error, "exitcode", None)  # of pebble's ProcessExpired
    if isinstance(code, int):
        return f"its process died of {_signal(-code)}" if code < 0 else f"its process ended itself with status {code}"
    return f"{type(error).__name__}: {' '.join(str(error).split())}"


def _signal(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
