"""What keeps a cell from harming others: how long it may take and how much memory, and one thread of everything."""

import os
import signal
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from posefit.limits import memory

SECONDS, GIGABYTES = 3600.0, 4.0
GRACE = 5.0  # seconds after which a process ends itself that nobody ended in time
WATCH = 0.5  # seconds between two looks whether the driver lives
THREADS = ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

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


def limited(run: Callable[[T], R], cell: T, limits: Limits, grace: float = GRACE) -> R:
    """Return what `run` makes of a cell.

    Raises MemoryError where it wants more memory than it may have. A process that is still at it `grace` seconds after
    its time is ended by the operating system, whatever it does.
    """
    with _one_at_a_time, memory(limits.gigabytes):
        timer = getattr(signal, "setitimer", None)
        if timer is not None:
            timer(signal.ITIMER_REAL, limits.seconds + grace)
        try:
            return run(cell)
        except MemoryError:
            pass  # a new one is raised below: this one holds on to everything that filled the memory
        finally:
            if timer is not None:
                timer(signal.ITIMER_REAL, 0.0)
    raise MemoryError


def alone() -> None:
    """Make this process a worker: one thread of everything, no interest in Ctrl-C, and no life without its driver."""
    single_threaded()
    driver = os.getppid()

    def watch() -> None:
        while os.getppid() == driver:
            time.sleep(WATCH)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def single_threaded() -> None:
    """Give numba, BLAS and OpenCV one thread each in this process, and leave Ctrl-C to the driver."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before they are loaded
    import cv2
    import numba
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    threadpool_limits(1)
