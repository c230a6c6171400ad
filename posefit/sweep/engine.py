"""What runs cells in other processes: an engine. It keeps no order and no state; the ledger does.

    with closing(Pool(2, Limits(seconds=600.0), run_cell)) as engine:    # so many worker processes: pool.py
        engine.submit(cell)
        outcomes = engine.wait(1.0)                                      # what ended within a second

A Dask cluster, here or elsewhere, is one too: cluster.py.
"""

import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Protocol, TypeVar

from posefit.errors import InputError
from posefit.fitting.check import between
from posefit.limits import GIGABYTES, SECONDS
from posefit.sweep.cell import Cell, CellResult

J = TypeVar("J")  # a job: a cell, or whatever else its function takes
R = TypeVar("R")  # its result
Run = Callable[[Any], CellResult]
TRIAL_SECONDS = 120.0  # that a trial of an estimate may take at most, whatever a cell may
POLL_SECONDS = 0.2
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


@dataclass(frozen=True)
class Limits:
    """How many seconds a cell may take, and how much memory its process may have."""

    seconds: float = 3600.0
    gigabytes: float = 4.0

    def __post_init__(self) -> None:
        between("the limit of seconds", self.seconds, *SECONDS)
        between("the limit of gigabytes", self.gigabytes, *GIGABYTES)

    @property
    def overtime(self) -> str:
        """Why a cell failed that took too long."""
        return f"it ran past its limit of {self.seconds:g} s"

    @property
    def too_large(self) -> str:
        """Why a cell failed that wanted too much memory."""
        return f"it wanted more memory than its limit of {self.gigabytes:g} GB"


@dataclass(frozen=True)
class Outcome(Generic[J, R]):
    """What became of a job: a result, or the reason why there is none, and whether that is the job's own fault.

    With neither it was lost with what ran it, and counts as not tried.
    """

    job: J
    result: R | None = field(default=None, repr=False)
    reason: str | None = None
    own: bool = True  # its own fault: a limit, an exception, a segfault, an exit; not a kill from outside


class Engine(Protocol):
    """Runs so many jobs at a time."""

    def window(self) -> int:
        """Return how many jobs may run at the moment. Raises EngineError where the engine is gone for good."""
        ...

    def submit(self, job: Any) -> None:
        """Start a job."""
        ...

    def wait(self, seconds: float) -> list[Outcome[Any, Any]]:
        """Return the jobs that ended, once one has or the time is over."""
        ...

    def close(self) -> None:
        """Stop everything, whatever still runs."""
        ...


class EngineError(InputError):
    """An engine cannot go on."""


def text_of(error: BaseException) -> str:
    """Return an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


def single_thread() -> None:
    """Leave this process one thread of everything: cells run side by side."""
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before they are loaded
    if "numba" not in sys.modules:  # a loaded one takes another number for an error, at its next compilation
        os.environ["NUMBA_NUM_THREADS"] = "1"
    import cv2
    import numba
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    threadpool_limits(1)


def estimate(cells: Sequence[Cell], engine: Engine) -> list[float | str]:
    """Return how many seconds each of some cells takes, run for the second time, or why it failed at the first."""
    taken: list[float | str] = []
    for cell in cells:
        for _ in range(2):  # the first compiles what is not compiled yet
            engine.submit(cell)
            while not (outcomes := engine.wait(POLL_SECONDS)):
                pass
            if (result := outcomes[0].result) is None:
                taken.append(outcomes[0].reason or "what ran it was lost")
                break
        else:
            assert result is not None
            taken.append(float(result.row["seconds"]))
    return taken
