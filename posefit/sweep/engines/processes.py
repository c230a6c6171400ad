"""Runs cells, or other jobs, in processes of this machine."""

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import Generic

from posefit.errors import InputError
from posefit.sweep.engines.child import Children
from posefit.sweep.engines.engine import Ended, J, Limits, R


class Processes(Generic[J, R]):
    """An engine of so many worker processes, each with pipes of its own: what kills one touches no other's."""

    def __init__(self, workers: int, limits: Limits, run: Callable[[J], R]) -> None:
        if workers < 1:
            raise InputError(f"workers must be at least 1, got {workers}")
        self._workers, self._limits, self._run = workers, limits, run
        self._children, self._threads = Children(), ThreadPoolExecutor(workers)
        self._running: dict[Future[tuple[R | None, str | None, bool]], J] = {}

    def window(self) -> int:
        """Return how many processes there are."""
        return self._workers

    def submit(self, cell: J) -> None:
        """Start a cell in an idle process."""
        self._running[self._threads.submit(self._children.call, self._run, cell, self._limits)] = cell

    def wait(self, seconds: float) -> list[Ended[J, R]]:
        """Return the cells that ended."""
        wait(self._running, timeout=seconds, return_when=FIRST_COMPLETED)
        done = [future for future in self._running if future.done()]
        return [Ended(self._running.pop(future), *future.result()) for future in done]

    def close(self) -> None:
        """End all processes."""
        self._children.close()
        self._threads.shutdown()
