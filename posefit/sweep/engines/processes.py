"""Runs cells, or other jobs, in processes of this machine: whatever a cell does ends with its process.

`python -m posefit.sweep.engines.processes` runs in each. It reads jobs from its standard input and writes their results
to its standard output; what a cell prints goes to standard error. Dask's workers may not have children by
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
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from typing import IO, Any, Generic

from posefit.errors import InputError
from posefit.limits import end_with_parent, memory
from posefit.sweep.engines.engine import Ended, J, Limits, R, text_of

IDLE_SECONDS = 60.0  # after which a process without a job ends; half of it after which it gets no other
START_SECONDS = 60.0  # that a process may take to start
GRACE_SECONDS = 5.0  # after its limit, in which a process ends itself
# Seconds that count at most between two checks: where the parent was stopped for an hour, its cells may finish
MAX_POLL_SECONDS = 1.0
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
# Signals that nothing in a cell raises by mistake: they were sent from outside. So does the kernel where memory runs
# out; a cell's own limit of memory comes first, where the machine has as much as all cells may take.
OUTSIDE = ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP", "SIGQUIT", "SIGUSR1", "SIGUSR2", "SIGPWR")

Ending = tuple[R | None, str | None, bool]  # a job's result; or None, why, and whether that is the job's own fault


class Processes(Generic[J, R]):
    """An engine of so many worker processes, each with pipes of its own: what kills one touches no other's."""

    def __init__(self, workers: int, limits: Limits, run: Callable[[J], R]) -> None:
        if workers < 1:
            raise InputError(f"workers must be at least 1, got {workers}")
        self._workers, self._limits, self._run = workers, limits, run
        self._children, self._threads = Children(), ThreadPoolExecutor(workers)
        self._running: dict[Future[Ending[R]], J] = {}

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


class Child:
    """A process that runs one job after the other."""

    def __init__(self) -> None:
        words = [sys.executable, "-m", "posefit.sweep.engines.processes"]
        # a group of its own: Ctrl-C in a terminal is for the driver
        self._process = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, process_group=0)
        self._started, self._reusable = False, True
        self._used = time.monotonic()

    def call(self, run: Callable[[J], R], job: J, limits: Limits) -> Ending[R]:
        """Return what `run` makes of a job, see `limited`; or None, why, and whether that is the job's own fault."""
        assert self._process.stdin is not None
        self._reusable = False
        try:
            if not self._started:
                self._answer(START_SECONDS)
            self._started = True
        except (TimeoutError, EOFError, pickle.UnpicklingError):
            return None, "its process died before the cell began", False
        try:
            # one message, and no other before its answer: a reader that reads ahead takes nothing of the next
            pickle.dump((sys.path, _pickled((run, job, limits))), self._process.stdin)
            self._process.stdin.flush()
            ending: Ending[R]
            ending, self._reusable = self._answer(limits.seconds + GRACE_SECONDS)
        except TimeoutError:
            return None, overtime_text(limits), True
        except (EOFError, pickle.UnpicklingError, BrokenPipeError):
            return None, *_death(self._process.wait(), limits)
        self._used = time.monotonic()
        return ending

    @property
    def usable(self) -> bool:
        """Whether it takes another job."""
        recent = time.monotonic() - self._used < IDLE_SECONDS / 2.0
        return self._reusable and self._process.poll() is None and recent

    def kill(self) -> None:
        """Kill it; who waits for its answer cleans up."""
        self._process.kill()

    def end(self) -> None:
        """End it, whatever it does."""
        self._process.kill()
        self._process.communicate()

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

    def call(self, run: Callable[[J], R], job: J, limits: Limits) -> Ending[R]:
        """Return what `Child.call` returns, of a process that has no other job."""
        child = self._taken()
        try:
            return child.call(run, job, limits)
        except Exception as error:  # a job that cannot travel
            return None, text_of(error), True
        finally:
            with self._lock:
                self._busy.discard(child)
                if kept := child.usable and not self._closed:
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


def called(run: Callable[[J], R], job: J, limits: Limits) -> Ending[R]:
    """Return what `run` makes of a job in a process of its own, as `Children.call` does; a Dask worker runs this."""
    return OF_THIS_PROCESS.call(run, job, limits)


def overtime_text(limits: Limits) -> str:
    """Return why a cell failed that took too long."""
    return f"it ran past its limit of {limits.seconds:g} s"


def _death(status: int, limits: Limits) -> tuple[str, bool]:
    """Return why a process ended before its cell did, and whether that is the cell's own fault."""
    if status >= 0:
        return f"its process ended itself with status {status}", True
    names = {int(number): number.name for number in signal.Signals}
    name = names.get(-status, f"signal {-status}")
    if name == "SIGALRM":  # the timer of `limited`
        return overtime_text(limits), True
    return f"its process died of {name}", name not in OUTSIDE


def limited(run: Callable[[J], R], job: J, limits: Limits) -> tuple[Ending[R], bool]:
    """Return what `run` makes of a job, and whether the process may run another one.

    Past its time the operating system ends the process, whatever it does.
    """
    too_large = f"it wanted more memory than its limit of {limits.gigabytes:g} GB"
    with memory(limits.gigabytes):
        signal.setitimer(signal.ITIMER_REAL, limits.seconds)
        try:
            return (run(job), None, True), True
        except MemoryError:
            return (None, too_large, True), False
        except BaseException as error:  # an exit and an interrupt too: they are the cell's, and end nothing else
            return (None, text_of(error), True), True
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)


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
    end_with_parent(os.getppid())


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
            answer = pickle.dumps(limited(*pickle.loads(pickled)))
        except Exception as error:  # a job or a result that cannot travel
            answer = pickle.dumps(((None, text_of(error), True), True))


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
