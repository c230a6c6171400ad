"""Limits: time of a call into a plugin, memory, and the ranges of numbers."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from pathlib import Path
from types import FrameType

from posefit.errors import InputError
from posefit.reading import quoted

SECONDS = 1e-3, 1e8  # range of a time limit that operating systems' timers accept
GIGABYTES = 1e-3, 1e6
RATES = 1e-3, 1e6  # frames per second
HEIGHTS = 0.3, 2.8  # stature of a person, metres
# between repeated interrupts, for code that swallowed the first one
REPEAT_SECONDS = 1.0
PARENT_POLL_SECONDS = 0.5
# set for a caller's timer that should have ended meanwhile; 0 would switch it off
OVERDUE_SECONDS = 1e-6
# until an alarm that arrived while the `with` block began or ended is repeated
RETRY_SECONDS = 1e-3
# environment variable that `check_decoded` reads, and its default
DECODED = "POSEFIT_DECODED_GIGABYTES"
DECODED_GIGABYTES = 20.0
# files of Linux with a container's memory limit, by version 2 and 1 of control groups
_CONTAINER = (
    Path("/sys/fs/cgroup/memory.max"),
    Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"),
)


class _OvertimeError(BaseException):
    """Ends a call that takes too long.

    It is not an Exception, because the call might swallow one.
    """


class timed:  # noqa: N801, named like the context managers of contextlib
    """Raise TimeoutError if the body of a `with` runs longer than `limit` seconds.

    None sets no limit. A limit needs an operating system with timers, and a body that
    runs Python in the main thread. Elsewhere, and inside a call of compiled code that
    does not return, there is no limit. An earlier limit of a caller holds as well, and
    continues afterwards.
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
        # the earlier limit of a caller would end the body first
        if 0.0 < self._callers[0] <= self._limit:
            return
        self._began = time.monotonic()
        self._before = signal.signal(signal.SIGALRM, self._stop)
        self._runs = True
        signal.setitimer(signal.ITIMER_REAL, self._limit, REPEAT_SECONDS)

    def _stop(self, _: int, frame: FrameType | None) -> None:
        """End the body.

        An alarm may come while the body is entered or left. It would then end the
        caller instead, so it is repeated a little later.
        """
        # whether this object is still being entered, or already being left
        own = (timed.__enter__.__code__, timed.__exit__.__code__)
        outside = False
        while frame is not None and not outside:
            outside = frame.f_code in own and frame.f_locals["self"] is self
            frame = frame.f_back
        if not self._runs:
            return
        if outside:
            signal.setitimer(signal.ITIMER_REAL, RETRY_SECONDS, REPEAT_SECONDS)
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
            signal.setitimer(signal.ITIMER_REAL, max(left, OVERDUE_SECONDS), again)
        if isinstance(error, _OvertimeError):
            raise TimeoutError from error  # the cause's traceback says where it was


def end_with_parent(parent: int, clean_up: Callable[[], None] | None = None) -> None:
    """End this process soon after its parent process has ended in any way.

    Args:
        parent: The parent's process id.
        clean_up: Is called before.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_POLL_SECONDS)
        if clean_up is not None:
            clean_up()
        # also end what this process has started, if it leads a process group
        if hasattr(os, "getpgrp") and os.getpgrp() == os.getpid():
            os.killpg(0, signal.SIGKILL)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def memory(gigabytes: float) -> Iterator[None]:
    """Limit this process' memory in the body, on systems with such limits.

    Code that allocates more gets a MemoryError.
    """
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
    """Raise InputError if masks unpack to more bytes than POSEFIT_DECODED_GIGABYTES.

    Such masks take time rather than memory if they are unpacked frame by frame.

    Args:
        name: The name of the masks, for the message.
        size: Bytes that they unpack to.
    """
    text = os.environ.get(DECODED, "")
    try:
        most = float(text or DECODED_GIGABYTES)
    except ValueError:
        raise InputError(f"{DECODED} must be a number, got {quoted(text)}") from None
    if not size <= most * 1e9:
        raise InputError(
            f"{name}: expected masks that unpack to at most {most:g} GB, "
            f"got {size / 1e9:.3g} GB: set {DECODED} to allow more"
        )


def allowed_bytes() -> int:
    """Return the memory in bytes that this process may use.

    It is the least of the limits of the machine, its container and the process.
    """
    limits = []
    with suppress(ImportError):
        import resource

        for kind in (resource.RLIMIT_DATA, resource.RLIMIT_AS):
            soft = resource.getrlimit(kind)[0]
            if soft != resource.RLIM_INFINITY:
                limits.append(soft)
    return min([_machine_bytes(), *limits])


@lru_cache(maxsize=1)
def _machine_bytes() -> int:
    """Return the memory of this machine, or of this process' container, in bytes."""
    limits = [sys.maxsize]
    with suppress(AttributeError, ValueError, OSError):
        limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    for path in _CONTAINER:
        with suppress(OSError, ValueError):  # the file may say "max"
            limits.append(int(path.read_text()))
    return min(limits)


def trim_memory() -> None:
    """Return freed memory to the operating system, if the C library can.

    glibc keeps what was freed for later requests. Between the stages of a track, whose
    arrays have different sizes, that is 12 to 22 % of its memory.
    """
    import ctypes  # not needed by most commands

    with suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL(None).malloc_trim(0)


_ARENA_MAX = -8  # glibc's number of this setting, M_ARENA_MAX in malloc.h


def share_heap() -> None:
    """Let all threads of this process allocate from one heap, if the C library can.

    glibc gives each thread a separate heap, and keeps freed memory in it, which is a
    tenth of the memory of a track. This is for whole programs: it changes every later
    thread of the process.
    """
    import ctypes

    with suppress(OSError, TypeError, AttributeError):
        ctypes.CDLL(None).mallopt(_ARENA_MAX, 1)
