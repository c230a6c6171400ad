"""What keeps a cell from harming others: how long it may take and how much memory, and one thread of everything."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from posefit.limits import memory

SECONDS, GIGABYTES = 3600.0, 4.0
GRACE = 5.0  # seconds after which a process ends itself that nobody ended in time
WATCH = 0.5  # seconds between two looks whether the driver lives
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

T = TypeVar("T")
R = TypeVar("R")
_one_at_a_time = threading.Lock()  # the limits are those of a process


@dataclass(frozen=True)
class Limits:
    """How many seconds a cell may take, and how much memory its process may have."""

    seconds: float = SECONDS
    gigabytes: float = GIGABYTES

    def __post_init__(self) -> None:
        for name in ("seconds", "gigabytes"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"the limit of {name} must be above 0, got {getattr(self, name)}")


class FailedError(Exception):
    """A cell raised something, told in one line: what a plugin raises need not survive the way to another process."""


def text_of(error: BaseException) -> str:
    """Return an exception in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())}".removesuffix(": ")


def limited(run: Callable[[T], R], cell: T, limits: Limits, grace: float = GRACE) -> R:
    """Return what `run` makes of a cell.

    Raises MemoryError where it wants more memory than it may have, FailedError where it raises anything else. A process
    that is still at it `grace` seconds after its time is ended by the operating system, whatever it does.
    """
    with _one_at_a_time, memory(limits.gigabytes):
        timer = getattr(signal, "setitimer", None)
        if timer is not None:
            timer(signal.ITIMER_REAL, limits.seconds + grace)
        try:
            return run(cell)
        except MemoryError:
            failed: Exception = MemoryError()  # a new one: that one holds on to everything that filled the memory
        except BaseException as error:  # an exit and an interrupt too: they are the cell's, and end nothing else
            failed = FailedError(text_of(error))
        finally:
            if timer is not None:
                timer(signal.ITIMER_REAL, 0.0)
    raise failed


def alone() -> None:
    """Make this process a worker: one thread of everything, no interest in Ctrl-C, and no life without its driver.

    It is for a process that runs cells and nothing else: what it changes holds for everything in the process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is the driver's
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # so that a kill from outside looks like one
    _single_threaded()
    driver = os.getppid()

    def watch() -> None:
        while os.getppid() == driver:
            time.sleep(WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _single_threaded() -> None:
    """Give numba, BLAS and OpenCV one thread each in this process."""
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before they are loaded
    if "numba" not in sys.modules:  # one that is loaded takes another number for an error, at its next compilation
        os.environ["NUMBA_NUM_THREADS"] = "1"
    import cv2
    import numba
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    threadpool_limits(1)
