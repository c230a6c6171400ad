"""A process of its own within somebody else's: what a cell does on a shared Dask worker ends in it.

`python -m posefit.sweep.engines.child` is what runs there. It reads tasks from its standard input and writes what
became of them; what a cell prints goes to the worker's standard error. Dask's workers may not have children by
`multiprocessing`, so it is started as any other program.
"""

import importlib
import os
import pickle
import select
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import IO, TypeVar

from posefit.sweep.engines.engine import DiedError, reason_of
from posefit.sweep.engines.limits import FailedError, Limits, alone, limited

IDLE = 60.0  # seconds after which a process ends that nobody gives a task
STARTING = 60.0  # seconds that it may take to start, which are not the cell's

T = TypeVar("T")
R = TypeVar("R")


class Child:
    """A process that runs one task after the other."""

    def __init__(self) -> None:
        words = [sys.executable, "-m", "posefit.sweep.engines.child"]
        # a group of its own: who stops the worker's group by Ctrl-C means the driver
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0)

    def call(self, run: Callable[[T], R], task: T, limits: Limits) -> R:
        """Return what `run` makes of a task; see `limited`. Raises DiedError where the process ends before."""
        assert self._process.stdout is not None
        try:
            # one message, and no other before its answer: a reader that reads ahead takes nothing of the next
            self._send((sys.path, _pickled((run, task, limits))))
            if not _readable(self._process.stdout, limits.seconds + STARTING):
                raise TimeoutError
            result, error = pickle.load(self._process.stdout)
        except (EOFError, pickle.UnpicklingError, BrokenPipeError):
            raise DiedError(self._process.wait()) from None
        if error is not None:
            raise error
        found: R = result
        return found

    @property
    def lives(self) -> bool:
        """Whether it takes another task."""
        return self._process.poll() is None

    def end(self) -> None:
        """End it, whatever it does."""
        self._process.kill()
        self._process.communicate()

    def _send(self, what: object) -> None:
        assert self._process.stdin is not None
        pickle.dump(what, self._process.stdin)
        self._process.stdin.flush()


class Children:
    """The processes of this worker: as many as run tasks at a time, each used again."""

    def __init__(self) -> None:
        self._idle: list[Child] = []
        self._lock = threading.Lock()

    def call(self, run: Callable[[T], R], task: T, limits: Limits) -> tuple[R | None, str | None, bool]:
        """Return what `run` makes of a task, or why it made nothing and whether that is the task's own fault."""
        child = self._one()
        failure: tuple[str, bool] | None = None
        try:
            result = child.call(run, task, limits)
        except Exception as error:
            if not isinstance(error, FailedError):
                child.end()
                return None, *reason_of(error, limits)
            failure = reason_of(error, limits)
        with self._lock:
            self._idle.append(child)
        return (result, None, True) if failure is None else (None, *failure)

    def _one(self) -> Child:
        with self._lock:
            while self._idle:
                child = self._idle.pop()
                if child.lives:
                    return child
                child.end()
        return Child()


HERE = Children()


def called(run: Callable[[T], R], task: T, limits: Limits) -> tuple[R | None, str | None, bool]:
    """Return what `run` makes of a task in a process of its own, as `Children.call` does; a worker runs this."""
    return HERE.call(run, task, limits)


def main() -> None:
    """Run tasks until nobody gives one."""
    answers, tasks = os.fdopen(os.dup(1), "wb"), os.fdopen(os.dup(0), "rb")
    os.dup2(2, 1)  # what a cell prints is no answer
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    alone()
    while _readable(tasks, IDLE):
        try:
            sys.path[:], told = pickle.load(tasks)
        except EOFError:
            return
        run, task, limits = pickle.loads(told)
        answer: tuple[object, Exception | None]
        try:
            answer = limited(run, task, limits, grace=0.0), None
        except (MemoryError, FailedError) as error:
            answer = None, error
        try:
            answers.write(pickle.dumps(answer))
            answers.flush()
        except BrokenPipeError:  # the worker is gone
            os._exit(1)


def _pickled(what: object) -> bytes:
    """Return a pickle of anything that Dask brought here, functions of a driver's main module among them."""
    pickled: bytes = importlib.import_module("cloudpickle").dumps(what)  # Dask's own
    return pickled


def _readable(file: IO[bytes], seconds: float) -> bool:
    return bool(select.select([file], [], [], seconds)[0])


if __name__ == "__main__":
    main()
