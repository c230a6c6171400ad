"""Runs cells on Dask workers, as its users know it: `submit` with a bounded window, and what is ready is written.

A worker runs a cell itself. Its memory is limited while a cell runs; one that runs too long has its worker restarted,
which needs Dask's nanny, as `dask worker` has by default; a cell that ends its worker is not distinguished from a
worker that was killed, and is tried again after all others.
"""

import importlib
import logging
import secrets
import signal
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from typing import Any

from posefit.limits import memory
from posefit.sweep.cell import run_cell
from posefit.sweep.engine import EngineError, Limits, Outcome, Run, single_thread, text_of

PATIENCE = 30.0  # seconds to wait for a scheduler, or for workers, that are not there
CONNECT_SECONDS = 5.0  # for one try
LOOPBACK = "127.0.0.1"
POLL_SECONDS = 0.5


class Cluster:
    """An engine of Dask workers: of a scheduler at an address, or, with `workers` instead, so many on this machine.

    Those of this machine speak TLS with a certificate made for the run, so that no other user of it can have them run
    anything. A scheduler that is not there, or has no workers, is waited for `patience` seconds; after that EngineError
    is raised.
    """

    def __init__(
        self,
        scheduler: str | None = None,
        workers: int | None = None,
        limits: Limits | None = None,
        run: Run = run_cell,
        patience: float = PATIENCE,
    ) -> None:
        self._limits, self._patience = limits or Limits(), patience
        self._call = partial(_call, run, self._limits)
        self._distributed = _library()
        self._settings = ExitStack()
        self._local = None if workers is None else _local(self._distributed, workers, self._settings)
        self._client: Any = None
        self._address = scheduler if self._local is None else self._local.scheduler_address
        self._running: dict[Any, tuple[Any, float]] = {}  # the job of each future, and when it was sent
        try:
            self._connect()
        except EngineError:
            self.close()
            raise

    def window(self) -> int:
        """Return how many threads the workers have, once there are any."""
        until = time.monotonic() + self._patience
        while not (threads := int(sum(self._asked(self._client.nthreads, {}).values()))) and not self._running:
            if time.monotonic() > until:
                raise EngineError(f"scheduler {self._address} must have workers, got none for {self._patience:g} s")
            time.sleep(POLL_SECONDS)
        return threads

    def submit(self, job: Any) -> None:
        """Send a job; Dask chooses the worker."""
        key = f"posefit-{secrets.token_hex(16)}"
        future = self._client.submit(self._call, job, key=key, pure=False, retries=0)
        self._running[future] = job, time.monotonic()

    def wait(self, seconds: float) -> list[Outcome[Any, Any]]:
        """Return the jobs that ended."""
        if self._client.status != "running":  # the scheduler went away, and all that it had
            lost = [Outcome[Any, Any](job) for job, _ in self._running.values()]
            self._running.clear()
            self._connect()
            return lost
        if self._running:
            first = partial(self._distributed.wait, tuple(self._running), seconds, "FIRST_COMPLETED")
            self._asked(first, None)
        outcomes = [self._outcome(future) for future in tuple(self._running) if future.done()]
        late = time.monotonic() - self._limits.seconds
        return outcomes + [self._ended(future) for future, (_, sent) in tuple(self._running.items()) if sent < late]

    def close(self) -> None:
        """Leave the scheduler, and end the workers of this machine."""
        for future in self._running:
            future.cancel()
        if self._client is not None:
            self._client.close(timeout=CONNECT_SECONDS)
        if self._local is not None:
            self._local.close(timeout=CONNECT_SECONDS)
        self._settings.close()

    def _outcome(self, future: Any) -> Outcome[Any, Any]:
        job, _ = self._running.pop(future)
        try:
            return Outcome(job, *future.result(timeout=CONNECT_SECONDS))
        except self._distributed.KilledWorker:
            return Outcome(job, None, "its worker was lost", own=False)
        except (TimeoutError, OSError, self._distributed.CancelledError):
            return Outcome(job)  # with its worker or the scheduler
        except Exception as error:
            return Outcome(job, None, text_of(error))

    def _ended(self, future: Any) -> Outcome[Any, Any]:
        """Restart the worker of a job that takes too long: nothing else ends a call."""
        job, _ = self._running.pop(future)
        processing = self._asked(self._client.processing, {})
        workers = [worker for worker, keys in processing.items() if future.key in keys]
        future.cancel()
        self._asked(partial(self._client.restart_workers, workers, timeout=PATIENCE, raise_for_error=False), None)
        return Outcome(job, None, self._limits.overtime)

    def _asked(self, ask: Callable[[], Any], otherwise: Any) -> Any:
        """Return what the scheduler answers; something else where it does not: the next `wait` connects again."""
        try:
            return ask()
        except (OSError, TimeoutError, ValueError, self._distributed.CancelledError):
            return otherwise

    def _connect(self) -> None:
        until = time.monotonic() + self._patience
        while True:
            if self._client is not None:
                self._client.close(timeout=CONNECT_SECONDS)
            try:
                security = None if self._local is None else self._local.security
                limit = min(CONNECT_SECONDS, self._patience)
                self._client = self._distributed.Client(
                    self._address, timeout=limit, set_as_default=False, security=security
                )
                if self._local is not None:
                    self._client.register_plugin(_plugin(self._distributed))
                return
            except (OSError, ValueError, TimeoutError) as error:
                if isinstance(error, ValueError) or time.monotonic() > until:
                    cause = " ".join(str(error).split())
                    raise EngineError(f"scheduler must be one that answers, got {self._address}: {cause}") from None
                time.sleep(min(POLL_SECONDS, self._patience))


def _call(run: Run, limits: Limits, job: Any) -> tuple[Any, str | None]:
    """Return, on a worker, what a function makes of a job; or None, and why."""
    single_thread()
    try:
        with memory(limits.gigabytes):
            return run(job), None
    except MemoryError:
        return None, limits.too_large
    except BaseException as error:  # an exit too: it is the cell's, and ends no worker
        return None, text_of(error)


def _local(distributed: Any, workers: int, stack: ExitStack) -> Any:
    """Return a cluster of worker processes on this machine, one thread each, unreachable from elsewhere."""
    import dask

    settings: dict[str, Any] = {
        "distributed.scheduler.allowed-failures": 0,  # attempts are counted by the ledger
        "distributed.deploy.lost-worker-timeout": "3650 days",  # a nanny goes on, however often its worker dies
    }
    settings |= {f"distributed.{part}.http.routes": [] for part in ("scheduler", "worker")}
    stack.enter_context(dask.config.set(settings))
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        processes=True,
        memory_limit=0,  # each cell has a limit of its own
        host=LOOPBACK,
        protocol="tls://",
        security=distributed.Security.temporary(),
        dashboard_address=f"{LOOPBACK}:0",  # None would take a port that others may have
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
    )


def _plugin(distributed: Any) -> Any:
    """Return what makes each worker of this machine, also one that comes later, leave Ctrl-C to the driver."""

    class Ours(distributed.WorkerPlugin):  # type: ignore[misc]
        name = "posefit"

        def setup(self, **_: Any) -> None:
            if threading.current_thread() is threading.main_thread():
                signal.signal(signal.SIGINT, signal.SIG_IGN)

    return Ours()


def _library() -> Any:
    try:
        return importlib.import_module("distributed")
    except ImportError as error:
        raise ImportError("Dask needs the library distributed: python -m pip install 'posefit[dask]'") from error
