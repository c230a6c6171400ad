"""Runs cells, or other jobs, in processes of this machine, through pebble."""

import multiprocessing
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing.connection import Connection
from typing import Generic, Self

from pebble import ProcessExpired, ProcessPool

from posefit.sweep.engines.engine import DiedError, Ended, J, R, reason_of
from posefit.sweep.engines.limits import Limits, alone, limited

LOOK = 1.0  # seconds that count at most between two looks: a driver that was stopped for an hour lets its cells finish
CAME, BEGAN = "came", "began"  # what a worker says: that it is there, and that a cell begins

_said: list[Connection] = []  # of a worker: where it says so


class Processes(Generic[J, R]):
    """An engine of so many worker processes, each a pool of its own: what kills one touches no other's channels.

    Workers are started afresh, not forked: a driver may have threads.
    """

    def __init__(self, workers: int, limits: Limits, run: Callable[[J], R]) -> None:
        if workers < 1:
            raise ValueError(f"workers must be at least 1, got {workers}")
        self._limits, self._run = limits, run
        self._idle = [_Worker() for _ in range(workers)]
        self._running: dict[Future[R], tuple[J, _Worker]] = {}
        self._workers = workers

    def window(self) -> int:
        """Return how many processes there are."""
        return self._workers

    def submit(self, cell: J) -> None:
        """Start a cell in an idle process."""
        worker = self._idle.pop()
        arguments = self._run, cell, self._limits
        try:
            future = worker.pool.schedule(_told, args=arguments)
        except RuntimeError:  # its process died while it was idle
            worker = worker.renewed()
            future = worker.pool.schedule(_told, args=arguments)
        self._running[future] = cell, worker

    def wait(self, seconds: float) -> list[Ended[J, R]]:
        """Return the cells that ended."""
        wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)
        outcomes = [self._outcome(future) for future in tuple(self._running)]
        return [outcome for outcome in outcomes if outcome is not None]

    def close(self) -> None:
        """End all processes."""
        workers = [*self._idle, *(worker for _, worker in self._running.values())]
        for worker in workers:
            worker.pool.stop()
        for worker in workers:
            worker.pool.join()

    def _outcome(self, future: Future[R]) -> Ended[J, R] | None:
        """Return what became of a job, if anything has."""
        job, worker = self._running[future]
        error: BaseException | None = None
        worker.look()
        if future.done():
            error = future.exception()
        elif worker.replaced:  # which pebble says nothing of where the first one ended with status 0
            error = DiedError(0)
        elif worker.spent > self._limits.seconds:
            error = TimeoutError()
        else:
            return None
        del self._running[future]
        broken = not future.done() or isinstance(error, ProcessExpired | BrokenProcessPool)
        self._idle.append(worker.renewed() if broken else worker.rested())
        if error is None:
            return Ended(job, future.result())
        return Ended(job, None, *reason_of(error, self._limits))


class _Worker:
    """A pool of one process, and what that process has said."""

    def __init__(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._heard, said = context.Pipe(duplex=False)
        self.pool = ProcessPool(max_workers=1, initializer=_come, initargs=(said,), context=context)
        self.rested()

    def rested(self) -> Self:
        """Return this worker, with no cell."""
        self.began = self.replaced = False
        self.spent = 0.0  # seconds that its cell has had
        self._looked = time.monotonic()
        return self

    def renewed(self) -> Self:
        """Return another one, after the end of this one."""
        self.pool.stop()
        self.pool.join()
        return type(self)()

    def look(self) -> None:
        """Hear what its process has said. Time is that of a clock that nobody sets."""
        now = time.monotonic()
        if self.began:
            self.spent += min(now - self._looked, LOOK)
        self._looked = now
        while self._heard.poll():
            said = self._heard.recv()
            self.replaced |= self.began and said == CAME
            self.began |= said == BEGAN


def _come(said: Connection) -> None:
    """Make this process a worker, and say that it is there."""
    alone()
    _said.append(said)
    said.send(CAME)


def _told(run: Callable[[J], R], job: J, limits: Limits) -> R:
    """Return what `run` makes of a job, after saying that it begins."""
    _said[0].send(BEGAN)
    return limited(run, job, limits)
