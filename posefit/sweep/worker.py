"""A process of this machine that runs jobs, one after the other: the driver's side.

`posefit.sweep.serve` is the code that this process runs.

A spawned process would import the script that started it again. So `__main__` names no
file while a process is started.
"""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import inf
from multiprocessing import resource_tracker
from multiprocessing.context import SpawnProcess
from secrets import token_hex
from typing import Any

import cloudpickle

from posefit.sweep.engine import Limits, Outcome, text_of
from posefit.sweep.serve import MARK, STARTED, end_marked, serve

START_SECONDS = 600.0  # the longest that a process takes to start
END_SECONDS = 1.0  # the longest that a process without a connection takes to end
_starting = threading.Lock()
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


class Worker:
    """The driver's side of a process that runs jobs.

    Args:
        task: A pickled pair: the function that is called with each job, and a function
            to call before the first job, or None.
        limits: The longest time and the most memory of a job.
        tenant: Whose jobs it runs, see `posefit.sweep.engine.Engine.submit`.

    Attributes:
        tenant: Whose jobs it runs.
        connection: Becomes readable when the process has started, or a job ends.
    """

    def __init__(self, task: bytes, limits: Limits, tenant: str) -> None:
        self.tenant = tenant
        self._limits = limits
        self._job: Any = None
        self._deadline = inf
        self._late = f"its process did not start within {START_SECONDS:g} s"
        self._has_started = False
        self.connection, other_end = multiprocessing.Pipe()
        self._process = _Process(
            target=serve,
            args=(os.getpid(), sys.path, other_end, task, limits.gigabytes),
            daemon=True,
        )
        self._process.start()
        other_end.close()

    @property
    def is_busy(self) -> bool:
        """Whether it has a job."""
        return self._job is not None

    @property
    def is_alive(self) -> bool:
        """Whether its process has not ended."""
        return self._process.exitcode is None

    def begin(self, job: Any) -> None:
        """Send a job to the process."""
        self._job = job
        self._deadline = time.monotonic() + START_SECONDS
        if self._has_started:
            self._limit_job()
        # `outcome` tells what became of a process that ended meanwhile
        with suppress(OSError):
            self.connection.send_bytes(cloudpickle.dumps(job))

    def _limit_job(self) -> None:
        """Limit the time of the job, which begins now."""
        self._deadline = time.monotonic() + self._limits.seconds
        self._late = f"it ran past its limit of {self._limits.seconds:g} s"

    def outcome(self) -> Outcome | None:
        """Return the outcome of the job, or None if it has not ended.

        Unless the job returned or raised an error, its process has ended.
        """
        answer = STARTED
        try:
            while answer == STARTED and self.connection.poll():
                answer = self.connection.recv_bytes()
                if answer == STARTED:
                    self._has_started = True
                    self._limit_job()
        except (EOFError, OSError):
            # The process has ended, or a job has closed the connection. `join` would
            # wait without limit for a job that has closed its other files, too.
            until = time.monotonic() + END_SECONDS
            while self.is_alive and time.monotonic() < until:
                time.sleep(0.01)
            return self._ended()
        if answer == STARTED:
            if not self.is_alive:
                return self._ended()
            if time.monotonic() > self._deadline:
                return self._failed(self._late)
            return None
        try:
            outcome = Outcome(self._job, *pickle.loads(answer))
        except Exception as error:  # a result that cannot be read
            return self._failed(text_of(error))
        self._job = None
        self._deadline = inf
        return outcome

    def _ended(self) -> Outcome:
        """Return the outcome of the job after its process has ended."""
        code = self._process.exitcode
        if code is None:
            return self._failed("it closed the connection of its process")
        if code >= 0:
            return self._failed(f"its process ended itself with status {code}")
        # a negative code is the number of the signal that killed it
        number = -code
        name = f"signal {number}"
        if number in set(signal.Signals):
            name = signal.Signals(number).name
        is_own_fault = number not in EXTERNAL_SIGNALS
        return self._failed(f"its process died of {name}", is_own_fault=is_own_fault)

    def _failed(self, reason: str, *, is_own_fault: bool = True) -> Outcome:
        """End the process, and return the outcome of the job."""
        job = self._job
        self.end()
        return Outcome(job, None, reason, is_own_fault=is_own_fault)

    def end(self) -> None:
        """End the process and all processes that its jobs have started."""
        if self.connection.closed:
            return
        pid = self._process.pid
        assert pid is not None
        # a process that a job starts belongs to the worker's process group
        with suppress(OSError, AttributeError):
            os.killpg(pid, signal.SIGKILL)
        # unless it has left the group
        end_marked(self._process.mark)
        self._process.kill()
        self._process.join()
        self.connection.close()
        self._job = None


class _Process(SpawnProcess):
    """A process that does not import the script that started it.

    The script may start a comparison without an `if __name__ == "__main__"`.

    Attributes:
        mark: The value of an environment variable that only this process and those that
            it starts have.
    """

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.mark = token_hex()

    @staticmethod
    def _Popen(process: Any) -> Any:  # noqa: N802
        main = sys.modules["__main__"]
        with _starting, _interrupts_blocked():
            before = {
                name: getattr(main, name, None) for name in ("__file__", "__spec__")
            }
            try:
                vars(main).update(dict.fromkeys(before))
                os.environ[MARK] = process.mark
                return SpawnProcess._Popen(process)  # type: ignore[attr-defined]
            finally:
                os.environ.pop(MARK, None)
                vars(main).update(before)


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Block Ctrl-C while the body starts processes, which inherit the block.

    A terminal sends Ctrl-C to all processes. A worker ignores it only once it has
    imported `become_worker`; before that, Ctrl-C would end it with a traceback. This
    process receives it after the body.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # Starting the first process would start the tracker as well, which unblocks the
    # interrupt. So start it before the block.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
