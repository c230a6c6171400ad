"""How long a call into a plugin may take, how much memory there may be, and in which range numbers must lie."""

import os
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from types import FrameType

from posefit.errors import InputError
from posefit.reading import quoted

SECONDS = 1e-3, 1e8  # of a limit: what timers of operating systems take
GIGABYTES = 1e-3, 1e6
RATES = 1e-3, 1e6  # frames a second
HEIGHTS = 0.3, 2.8  # metres that a person may stand
AGAIN = 1.0  # seconds until something that swallowed its limit meets it again
PARENT_POLL_SECONDS = 0.5
# seconds, for a timer that should have ended meanwhile; 0 would switch it off
SOON = 1e-6
# seconds until an alarm that came before the body comes again
EARLY = 1e-3
# the variable of `check_decoded`, and its default
DECODED = "POSEFIT_DECODED_GIGABYTES"
DECODED_GIGABYTES = 4.0
# of Linux: the memory that a container may have, in control groups of version 2 and 1
_CONTAINER = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)


class _OvertimeError(BaseException):
    """Ends what takes too long; no Exception, which it might swallow."""


class timed:  # noqa: N801, a context as those of contextlib
    """Raise TimeoutError in the body of a `with` once it has run for `limit` seconds; None is no limit.

    That needs an operating system with timers, and a body that runs Python in the main thread: elsewhere, and inside a
    call of compiled code that does not return, there is no limit. An earlier limit of a caller's holds as well, and
    goes on afterwards.
    """

    def __init__(self, limit: float | None) -> None:
        self._limit = limit
        self._runs = False

    def __enter__(self) -> None:
        if (
            self._limit is None
            or not hasattr(signal, "setitimer")
            or threading.current_thread() is not threading.main_thread()
        ):
            return
        self._callers = signal.getitimer(signal.ITIMER_REAL)
        if 0.0 < self._callers[0] <= self._limit:
            return
        self._began = time.monotonic()
        self._before = signal.signal(signal.SIGALRM, self._stop)
        self._runs = True
        signal.setitimer(signal.ITIMER_REAL, self._limit, AGAIN)

    def _stop(self, _: int, frame: FrameType | None) -> None:
        """End the body. An alarm may come while it is entered or left, and would then end the caller instead."""
        own = [method.__code__ for method in (timed.__enter__, timed.__exit__)]
        outside = False
        while frame is not None and not outside:
            outside = frame.f_code in own and frame.f_locals["self"] is self
            frame = frame.f_back
        if not self._runs:
            return
        if outside:
            signal.setitimer(signal.ITIMER_REAL, EARLY, AGAIN)
        else:
            raise _OvertimeError

    def __exit__(self, _: object, error: BaseException | None, __: object) -> None:
        if not self._runs:
            return
        self._runs = False
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, self._before)
        callers, again = self._callers
        if callers:
            left = callers - (time.monotonic() - self._began)
            signal.setitimer(signal.ITIMER_REAL, max(left, SOON), again)
        if isinstance(error, _OvertimeError):
            raise TimeoutError from error  # whose traceback says where it was


def end_with_parent(parent: int) -> None:
    """End this process soon after `parent`, the one that started it, however that one ends."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_POLL_SECONDS)
        # with what it has started, if it leads a group of its own
        if hasattr(os, "getpgrp") and os.getpgrp() == os.getpid():
            os.killpg(0, signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def memory(gigabytes: float) -> Iterator[None]:
    """Let this process have so much memory in the body, on systems with limits: to want more is a MemoryError."""
    try:
        import resource
    except ImportError:
        yield
        return
    before = resource.getrlimit(resource.RLIMIT_DATA)
    wanted = int(gigabytes * 1e9)
    if before[1] != resource.RLIM_INFINITY:
        wanted = min(wanted, before[1])
    resource.setrlimit(resource.RLIMIT_DATA, (wanted, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def check_decoded(name: str, size: int) -> None:
    """Raise InputError where masks unpack to more bytes than POSEFIT_DECODED_GIGABYTES allows.

    They take time rather than memory, where they become bits frame by frame.
    """
    text = os.environ.get(DECODED, "")
    try:
        most = float(text or DECODED_GIGABYTES)
    except ValueError:
        raise InputError(f"{DECODED} must be a number, got {quoted(text)}") from None
    if not size <= most * 1e9:
        came = f"{size / 1e9:.3g} GB; {DECODED} raises the limit"
        raise InputError(
            f"{name}: expected masks that unpack to at most {most:g} GB, got {came}"
        )


def allowed_bytes() -> int:
    """Return how much memory this process may have: what the machine, its container and its own limits leave."""
    limits = []
    with suppress(ImportError):
        import resource

        soft = (
            resource.getrlimit(kind)[0]
            for kind in (resource.RLIMIT_DATA, resource.RLIMIT_AS)
        )
        limits = [limit for limit in soft if limit != resource.RLIM_INFINITY]
    return min([_machine_bytes(), *limits])


@lru_cache(maxsize=1)
def _machine_bytes() -> int:
    """Return the memory of this machine, or of the container that this process is in."""
    limits = [sys.maxsize]
    with suppress(AttributeError, ValueError, OSError):
        limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for path in _CONTAINER:
        with suppress(OSError, ValueError):  # "max" is no number
            limits.append(int(path.read_text()))
    return min(limits)
