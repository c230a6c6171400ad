"""What runs cells in other processes: an engine. It keeps no order and no state; the ledger does.

    with closing(Pool(2, Limits(seconds=600.0), run_cell)) as engine:    # so many worker processes: pool.py
        engine.submit(cell)
        outcomes = engine.wait(1.0)                                      # what ended within a second

The workers of a Dask scheduler are one too: cluster.py.
"""

import os
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from posefit.errors import printable
from posefit.fitting.check import between
from posefit.limits import GIGABYTES, SECONDS

Run = Callable[[Any], Any]
POLL_SECONDS = 0.2
THREADS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)


@dataclass(frozen=True)
class Limits:
    """How many seconds a cell may take, and how much memory its process may have."""

    seconds: float = 3600.0
    gigabytes: float = 4.0

    def __post_init__(self) -> None:
        between("the limit of seconds", self.seconds, *SECONDS)
        between("the limit of gigabytes", self.gigabytes, *GIGABYTES)


@dataclass(frozen=True)
class Outcome:
    """What became of a job, a cell or whatever an engine's function takes: a result, or the reason why there is none.

    With neither it was lost with what ran it, and counts as not tried.
    """

    job: Any
    result: Any = field(default=None, repr=False)
    reason: str | None = None
    # its own fault: a limit, an exception, a segfault, an exit; not a kill from outside
    is_own_fault: bool = True


class Engine(Protocol):
    """Runs so many jobs at a time."""

    def window(self) -> int:
        """Return how many jobs may run at the moment. Raises InputError where the engine is gone for good."""
        ...

    def submit(self, job: Any) -> None:
        """Start a job."""
        ...

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the jobs that ended, once one has or the time is over."""
        ...

    def close(self) -> None:
        """Stop everything, whatever still runs."""
        ...


def text_of(error: BaseException) -> str:
    """Return an exception in one line."""
    return printable(
        f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")
    )


def single_thread() -> None:
    """Leave this process one thread of everything: cells run side by side."""
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before they are loaded
    # a loaded one takes another number for an error, at its next compilation
    if "numba" not in sys.modules:
        os.environ["NUMBA_NUM_THREADS"] = "1"
    import cv2
    import numba
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    threadpool_limits(1)
