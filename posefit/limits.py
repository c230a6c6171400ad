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


@contextmanager
def timed(limit: float | None) -> Iterator[None]:
    """Raise TimeoutError in the body once it has run for `limit` seconds.

    That needs an operating system with timers, and a body that runs Python in the main thread: elsewhere, and inside a
    call of compiled code that does not return, there is no limit. An earlier limit of a caller's holds as well, and
    goes on afterwards.
    """
    if (
        limit is None
        or not hasattr(signal, "setitimer")
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return
    callers = signal.getitimer(signal.ITIMER_REAL)[0]
    if callers and callers <= limit:
        yield
        return

    def stop(_: int, __: FrameType | None) -> None:
        raise _OvertimeError

    began = time.monotonic()
    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit, AGAIN)
    try:
        yield
    except _OvertimeError as overtime:
        raise TimeoutError from overtime  # whose traceback says where it was
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        if callers:
            signal.setitimer(
                signal.ITIMER_REAL, max(callers - (time.monotonic() - began), SOON)
            )


def end_with_parent(parent: int) -> None:
    """End this process soon after `parent`, the one that started it, however that one ends."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(PARENT_POLL_SECONDS)
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
