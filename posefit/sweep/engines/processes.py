"""Runs cells, or other jobs, in processes of this machine, through pebble."""

import multiprocessing
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Generic

from pebble import ProcessExpired, ProcessPool

from posefit.sweep.engines.engine import Ended, J, R, reason_of
from posefit.sweep.engines.limits import Limits, alone, limited


class Processes(Generic[J, R]):
    """An engine of so many worker processes, each a pool of its own: what kills one touches no other's channels.

    Workers are started afresh, not forked: a driver may have threads.
    """

    def __init__(self, workers: int, limits: Limits, run: Callable[[J], R]) -> None:
        if workers < 1:
            raise ValueError(f"workers must be at least 1, got {workers}")
        self._limits, self._run = limits, run
        self._idle = [_pool() for _ in range(workers)]
        self._running: dict[Future[R], tuple[J, ProcessPool]] = {}
        self._workers = workers

    def window(self) -> int:
        """Return how many processes there are."""
        return self._workers

    def submit(self, cell: J) -> None:
        """Start a cell in an idle process."""
        pool = self._idle.pop()
        arguments = self._run, cell, self._limits
        try:
            future = pool.schedule(limited, args=arguments, timeout=self._limits.seconds)
        except RuntimeError:  # its process died while it was idle
            pool = _renewed(pool)
            future = pool.schedule(limited, args=arguments, timeout=self._limits.seconds)
        self._running[future] = cell, pool

    def wait(self, seconds: float) -> list[Ended[J, R]]:
        """Return the cells that ended."""
        done, _ = wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)
        return [self._outcome(future) for future in done]

    def close(self) -> None:
        """End all processes."""
        pools = [*self._idle, *(pool for _, pool in self._running.values())]
        for pool in pools:
            pool.stop()
        for pool in pools:
            pool.join()

    def _outcome(self, future: Future[R]) -> Ended[J, R]:
        cell, pool = self._running.pop(future)
        error = future.exception()
        if isinstance(error, ProcessExpired | BrokenProcessPool):
            pool = _renewed(pool)
        self._idle.append(pool)
        if error is None:
            return Ended(cell, future.result())
        return Ended(cell, None, reason_of(error, self._limits))


def _pool() -> ProcessPool:
    return ProcessPool(max_workers=1, initializer=alone, context=multiprocessing.get_context("spawn"))


def _renewed(pool: ProcessPool) -> ProcessPool:
    pool.stop()
    pool.join()
    return _pool()
