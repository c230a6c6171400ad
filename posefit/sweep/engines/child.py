"""A process for cells alone, of the driver or of a shared Dask worker: whatever a cell does ends with it.

`python -m posefit.sweep.engines.child` runs there. It reads jobs from its standard input and writes their results to
its standard output; what a cell prints goes to standard error. Dask's workers may not have children by
`multiprocessing`, so it is started as any other program.
"""

import os
import pickle
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from typing import IO, Any, TypeVar

from posefit.limits import memory
from posefit.sweep.engines.engine import DiedError, FailedError, Limits, NotStartedError, reason_of, text_of

IDLE_SECONDS = 60.0  # after which a process without a job ends; half of it after which it gets no other
START_SECONDS = 60.0  # that a process may take to start
GRACE_SECONDS = 5.0  # after its limit, in which a process ends itself
POLL_SECONDS = 0.5  # between two checks whether the parent lives
# Seconds that count at most between two checks: where the parent was stopped for an hour, its cells may finish
MAX_POLL_SECONDS = 1.0
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")

T = TypeVar("T")
R = TypeVar("R")


class Child:
    """A process that runs one job after the other."""

    def __init__(self) -> None:
        words = [sys.executable, "-m", "posefit.sweep.engines.child"]
        # a group of its own: Ctrl-C in a terminal is for the driver
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0)
        self._started = False
        self._used = time.monotonic()

    def call(self, run: Callable[[T], R], job: T, limits: Limits) -> R:
        """Return what `run` makes of a job, see `limited`.

        Raises DiedError where the process ends before, NotStartedError where it does so before the job begins.
        """
        assert self._process.stdout is not None
        if not self._started:
            try:
                self._answer(START_SECONDS)
            except (TimeoutError, EOFError, pickle.UnpicklingError):
                raise NotStartedError("its process died before the cell began") from None
            self._started = True
        try:
            # one message, and no other before its answer: a reader that reads ahead takes nothing of the next
            self._send((sys.path, _pickled((run, job, limits))))
            result, error = self._answer(limits.seconds + GRACE_SECONDS)
        except (EOFError, pickle.UnpicklingError, BrokenPipeError):
            raise DiedError(self._process.wait()) from None
        self._used = time.monotonic()
        if error is not None:
            raise error
        answer: R = result
        return answer

    @property
    def usable(self) -> bool:
        """Whether it takes another job."""
        return self._process.poll() is None and time.monotonic() - self._used < IDLE_SECONDS / 2.0

    def kill(self) -> None:
        """Kill it; who waits for its answer cleans up."""
        self._process.kill()

    def end(self) -> None:
        """End it, whatever it does."""
        self._process.kill()
        self._process.communicate()

    def _send(self, message: object) -> None:
        assert self._process.stdin is not None
        pickle.dump(message, self._process.stdin)
        self._process.stdin.flush()

    def _answer(self, seconds: float) -> Any:
        assert self._process.stdout is not None
        if not _readable(self._process.stdout, seconds):
            raise TimeoutError
        return pickle.load(self._process.stdout)


class Children:
    """The processes of one parent: as many as run jobs at a time, each used again."""

    def __init__(self) -> None:
        self._idle: list[Child] = []
        self._busy: set[Child] = set()
        self._closed = False
        self._lock = threading.Lock()

    def call(self, run: Callable[[T], R], job: T, limits: Limits) -> tuple[R | None, str | None, bool]:
        """Return what `run` makes of a job; or None, why, and whether that is the job's own fault."""
        child, kept = self._taken(), True
        try:
            return child.call(run, job, limits), None, True
        except Exception as error:
            kept = isinstance(error, FailedError)
            return None, *reason_of(error, limits)
        finally:
            with self._lock:
                self._busy.discard(child)
                kept = kept and not self._closed
                if kept:
                    self._idle.append(child)
            if not kept:
                child.end()

    def close(self) -> None:
        """End all processes."""
        with self._lock:
            self._closed = True
            for child in self._busy:
                child.kill()
            while self._idle:
                self._idle.pop().end()

    def _taken(self) -> Child:
        """Return a process that has no job."""
        with self._lock:
            child = self._idle.pop() if self._idle else Child()
            while not child.usable:
                child.end()
                child = self._idle.pop() if self._idle else Child()
            self._busy.add(child)
            if self._closed:
                child.kill()
            return child


OF_THIS_PROCESS = Children()


def called(run: Callable[[T], R], job: T, limits: Limits) -> tuple[R | None, str | None, bool]:
    """Return what `run` makes of a job in a process of its own, as `Children.call` does; a Dask worker runs this."""
    return OF_THIS_PROCESS.call(run, job, limits)


def limited(run: Callable[[T], R], job: T, limits: Limits) -> R:
    """Return what `run` makes of a job.

    Raises MemoryError where it wants more memory than it may have, FailedError where it raises anything else. Past its
    time the operating system ends the process, whatever it does.
    """
    failed: Exception
    with memory(limits.gigabytes):
        signal.setitimer(signal.ITIMER_REAL, limits.seconds)
        try:
            return run(job)
        except MemoryError:
            failed = MemoryError()  # a new one: that one holds on to everything that filled the memory
        except BaseException as error:  # an exit and an interrupt too: they are the cell's, and end nothing else
            failed = FailedError(text_of(error))
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    raise failed


def become_worker() -> None:
    """Make this process a worker: one thread of everything, deaf to Ctrl-C, and ended with its parent.

    It is for a process that runs cells and nothing else: what it changes holds for everything in the process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # it is the driver's
    signal.signal(signal.SIGTERM, signal.SIG_DFL)  # so that a kill from outside looks like one
    os.environ.update(dict.fromkeys(THREADS, "1"))  # before they are loaded
    if "numba" not in sys.modules:  # a loaded one takes another number for an error, at its next compilation
        os.environ["NUMBA_NUM_THREADS"] = "1"
    import cv2
    import numba
    from threadpoolctl import threadpool_limits

    cv2.setNumThreads(1)
    numba.set_num_threads(1)
    threadpool_limits(1)
    parent = os.getppid()

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(POLL_SECONDS)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def main() -> None:
    """Run jobs until none comes."""
    answers, jobs = os.fdopen(os.dup(1), "wb"), os.fdopen(os.dup(0), "rb")
    os.dup2(2, 1)  # what a cell prints is no answer
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    become_worker()
    answer = pickle.dumps("started")
    while True:
        try:
            answers.write(answer)
            answers.flush()
        except BrokenPipeError:  # the parent is gone
            os._exit(1)
        if not _readable(jobs, IDLE_SECONDS):
            return
        try:
            sys.path[:], pickled = pickle.load(jobs)
        except EOFError:
            return
        try:
            answer = pickle.dumps((limited(*pickle.loads(pickled)), None))
        except (MemoryError, FailedError) as error:
            answer = pickle.dumps((None, error))
        except Exception as error:  # a job or a result that cannot travel
            answer = pickle.dumps((None, FailedError(text_of(error))))


def _pickled(message: object) -> bytes:
    """Return a pickle, by Dask's own library where it is there: of functions of a driver's main module too."""
    try:
        import cloudpickle
    except ImportError:
        return pickle.dumps(message)
    pickled: bytes = cloudpickle.dumps(message)
    return pickled


def _readable(file: IO[bytes], seconds: float) -> bool:
    """Return whether something can be read from a file within so many seconds that this process was not stopped."""
    while seconds > 0.0:
        began = time.monotonic()
        if select.select([file], [], [], min(seconds, MAX_POLL_SECONDS))[0]:
            return True
        seconds -= min(time.monotonic() - began, MAX_POLL_SECONDS)
    return False


if __name__ == "__main__":
    main()
