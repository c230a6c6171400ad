"""Runs cells, or other jobs, in processes of this machine.

The processes are pebble's. Whatever a job does to its process ends with that process.
"""

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

# The longest that a process may take to begin a job. It doubles each time that none
# did.
START_SECONDS = 60.0
# Signals that nothing in a cell raises by mistake, so they came from outside. The
# kernel sends one too when memory runs out; but a cell reaches its own memory limit
# first if the machine has as much memory as all cells together may take.
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
    """An engine of worker processes on this machine.

    Args:
        workers: Number of processes.
        limits: The longest time and the most memory of a job.
        run: Called with a job in a worker; its result is the job's.
        prepare: Called once in each worker before its first job.
    """

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
        """Return the outcomes of the jobs that ended."""
        done = wait(self._running, seconds, FIRST_COMPLETED).done
        self._context.end_orphans()
        outcomes = []
        # a copy, because `_outcome` removes the job from `_running`
        for future in tuple(self._running):
            if future in done:
                outcomes.append(self._outcome(future))
        latest_start = time.monotonic() - self._start_seconds
        stuck = False
        for future, (_, start) in self._running.items():
            if start < latest_start and not future.running():
                stuck = True
        # A worker that dies while it takes a job from the common queue blocks the
        # others. Only a new pool helps.
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
            reason = f"it ran past its limit of {self._limits.seconds:g} s"
            return Outcome(job, None, reason)
        except ProcessExpired as error:
            code = error.exitcode or 0
            if code >= 0:
                status = 0 if code == EXIT_ZERO_STATUS else code
                reason = f"its process ended itself with status {status}"
                return Outcome(job, None, reason)
            # a negative exit code is the number of the signal that killed it
            number = -code
            name = f"signal {number}"
            for known in signal.Signals:
                if known == number:
                    name = known.name
                    break
            reason = f"its process died of {name}"
            is_own_fault = number not in EXTERNAL_SIGNALS
            return Outcome(job, None, reason, is_own_fault=is_own_fault)
        except (BrokenProcessPool, CancelledError):
            return Outcome(job)
        except Exception as error:  # a result that cannot be read
            return Outcome(job, None, text_of(error))


def _call(run: bytes, job: bytes, gigabytes: float) -> bytes:
    """Run a job, and return a pickled pair: its result, and the reason if it failed.

    Args:
        run: The pickled function.
        job: The pickled argument.
        gigabytes: The most memory that this process may have meanwhile.
    """
    try:
        with memory(gigabytes), left_as_it_was():
            result = pickle.loads(run)(pickle.loads(job))
        return cloudpickle.dumps((result, None))  # type: ignore[no-any-return]
    except MemoryError:
        reason = f"it wanted more memory than its limit of {gigabytes:g} GB"
    # also SystemExit: a cell that exits must not end its worker
    except BaseException as error:
        reason = text_of(error)
    return pickle.dumps((None, reason))


def cores() -> int:
    """Return how many processors this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return multiprocessing.cpu_count()
