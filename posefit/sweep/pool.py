"""Runs cells, or other jobs, in processes of this machine, by pebble: whatever a job does ends with its process."""

import multiprocessing
import os
import pickle
import signal
import sys
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, CancelledError, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any

import cloudpickle
from pebble import ProcessExpired, ProcessFuture, ProcessPool

from posefit.errors import InputError
from posefit.limits import memory
from posefit.sweep.engine import Limits, Outcome, Run, text_of
from posefit.sweep.worker import (
    EXIT_ZERO_STATUS,
    Context,
    become_worker,
    left_as_it_was,
)

# that a process may take to begin a job; twice as long after each time that none did
START_SECONDS = 60.0
# Signals that nothing in a cell raises by mistake: they were sent from outside. So does the kernel where memory runs
# out; a cell's own limit of memory comes first, where the machine has as much as all cells may take.
EXTERNAL_SIGNALS = {
    signal.SIGKILL,
    signal.SIGTERM,
    signal.SIGINT,
    signal.SIGHUP,
    signal.SIGQUIT,
    signal.SIGUSR1,
    signal.SIGUSR2,
}


class Pool:
    """An engine of so many worker processes, each of which calls `prepare` first."""

    def __init__(
        self,
        workers: int,
        limits: Limits,
        run: Run,
        prepare: Callable[[], object] | None = None,
    ) -> None:
        if workers < 1:
            raise InputError(f"workers must be at least 1, got {workers}")
        self._workers = workers
        self._limits = limits
        self._run, self._prepare = cloudpickle.dumps(run), cloudpickle.dumps(prepare)
        self._running: dict[ProcessFuture[bytes], tuple[Any, float]] = {}
        self._start_seconds = START_SECONDS
        self._start()

    def window(self) -> int:
        """Return how many processes there are."""
        return self._workers

    def submit(self, job: Any) -> None:
        """Start a job in an idle process."""
        arguments = self._run, cloudpickle.dumps(job), self._limits.gigabytes
        future = self._pool.schedule(
            _call, args=arguments, timeout=self._limits.seconds
        )
        self._running[future] = job, time.monotonic()

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the jobs that ended."""
        done = wait(self._running, seconds, FIRST_COMPLETED).done
        self._context.end_orphans()
        outcomes = [
            self._outcome(future) for future in tuple(self._running) if future in done
        ]
        late = time.monotonic() - self._start_seconds
        stuck = any(
            start < late and not future.running()
            for future, (_, start) in self._running.items()
        )
        # a worker died while it took a job from the others' queue
        if stuck or not self._pool.active:
            outcomes += [Outcome(job) for job, _ in self._running.values()]
            self._running.clear()
            self._start_seconds *= 2.0
            self.close()
            self._start()
        return outcomes

    def close(self) -> None:
        """End all processes."""
        self._pool.stop()  # type: ignore[no-untyped-call]
        self._pool.join()
        self._context.end_orphans()

    def _start(self) -> None:
        arguments = os.getpid(), sys.path, self._prepare
        self._context = Context()
        self._pool = ProcessPool(
            self._workers,
            initializer=become_worker,
            initargs=arguments,
            context=self._context,
        )

    def _outcome(self, future: "ProcessFuture[bytes]") -> Outcome:
        job, _ = self._running.pop(future)
        try:
            return Outcome(job, *pickle.loads(future.result()))
        except TimeoutError:
            return Outcome(
                job, None, f"it ran past its limit of {self._limits.seconds:g} s"
            )
        except ProcessExpired as error:
            code = error.exitcode or 0
            if code >= 0:
                status = 0 if code == EXIT_ZERO_STATUS else code
                return Outcome(
                    job, None, f"its process ended itself with status {status}"
                )
            name = next(
                (number.name for number in signal.Signals if number == -code),
                f"signal {-code}",
            )
            return Outcome(
                job,
                None,
                f"its process died of {name}",
                is_own_fault=-code not in EXTERNAL_SIGNALS,
            )
        except (BrokenProcessPool, CancelledError):
            return Outcome(job)
        except Exception as error:  # a result that cannot be read
            return Outcome(job, None, text_of(error))


def _call(run: bytes, job: bytes, gigabytes: float) -> bytes:
    """Return, pickled, what a function makes of a job; or None, and why."""
    try:
        with memory(gigabytes), left_as_it_was():
            result = pickle.loads(run)(pickle.loads(job))
        return cloudpickle.dumps((result, None))  # type: ignore[no-any-return]
    except MemoryError:
        reason = f"it wanted more memory than its limit of {gigabytes:g} GB"
    # an exit too: it is the cell's, and ends nothing else
    except BaseException as error:
        reason = text_of(error)
    return pickle.dumps((None, reason))


def cores() -> int:
    """Return how many processors this process may use."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else multiprocessing.cpu_count()
    )
