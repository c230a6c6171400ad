"""Work on many poses, in parts that fit a core's cache, shared by threads."""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context
from functools import lru_cache
from threading import Lock
from typing import Any

# poses of a part: the decoded ones take 0.5 MB, which stays in the cache of a core
PART = 384
# poses of a part that threads take in turn: smaller, as all wait for the last part
SHARED_PART = 128
POOL = "posefit"  # the name of the pool's threads, which end with the process
# poses: with fewer for each, another thread is not worth its overhead
LEAST_SHARE = 16
MAX_THREADS = 4  # by default: more hardly help, as the batches of a frame are small


def cores() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def default_threads() -> int:
    """Return the processors that this process may use, at most `MAX_THREADS`.

    OMP_NUM_THREADS, which limits other libraries, limits this number too. Workers of a
    sweep have it set to 1.
    """
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    limit = int(wanted) if wanted.isdecimal() else MAX_THREADS
    return max(min(cores(), limit, MAX_THREADS), 1)


@lru_cache
def parts_of(n: int, threads: int) -> tuple[slice, ...]:
    """Return slices of n rows, of about equal length, enough for each thread."""
    shares = max(min(threads, n // LEAST_SHARE), 1)
    if shares == 1 and n <= PART:
        return (slice(0, n),)
    longest = PART if shares == 1 else SHARED_PART
    rounds = max(-(-n // (shares * longest)), 1)  # rounded up
    return _equal_slices(n, shares * rounds)


@lru_cache
def shares_of(n: int, threads: int) -> tuple[slice, ...]:
    """Return slices of n rows, one for each thread, if each row takes long."""
    return _equal_slices(n, max(min(threads, n), 1))


def _equal_slices(n: int, count: int) -> tuple[slice, ...]:
    """Return slices of n rows, `count` of about equal length."""
    slices = []
    for part in range(count):
        slices.append(slice(n * part // count, n * (part + 1) // count))
    return tuple(slices)


def work_through(
    parts: Sequence[slice],
    threads: int,
    take: Callable[[slice], Sequence[Any]],
    work: Callable[..., None],
) -> None:
    """Call `work(part, *take(part))` for every part, shared by threads.

    Only one thread at a time calls `take`, so it need not be safe for threads; several
    call `work` at once.
    """
    if len(parts) == 1 or threads == 1:
        for part in parts:
            work(part, *take(part))
        return
    waiting = iter(parts)
    turn = Lock()

    def take_turns() -> None:
        while True:
            with turn:
                part = next(waiting, None)
                if part is None:
                    return
                taken = take(part)
            work(part, *taken)

    # in a copy of this thread's context, which contains the count of drawn poses
    others = []
    for _ in range(min(threads, len(parts)) - 1):
        others.append(_pool(threads).submit(copy_context().run, take_turns))
    take_turns()
    for other in others:
        if not other.cancel():
            other.result()


@lru_cache(maxsize=1)
def _pool(threads: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads - 1, thread_name_prefix=POOL)


if hasattr(os, "register_at_fork"):
    # A forked child has no threads of the pool: without this its first call would wait
    # for ever.
    os.register_at_fork(after_in_child=_pool.cache_clear)
