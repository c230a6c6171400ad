"""Runs cells on Dask workers, as its users know it: `submit` with a bounded window, and what is ready is written.

Each thread of a worker runs its cells in a process that pool.py starts, so limits hold, and whatever a cell does, its
worker goes on: a worker that is lost was ended from outside.
"""

import logging
import multiprocessing
import pickle
import secrets
import threading
import time
from contextlib import ExitStack, suppress
from functools import partial
from typing import Any

from posefit.errors import InputError
from posefit.sweep.cell import run_cell
from posefit.sweep.engine import POLL_SECONDS, Limits, Outcome, Run, text_of
from posefit.sweep.pool import Pool

PATIENCE = 30.0  # seconds to wait for a scheduler, or for workers, that are not there
CONNECT_SECONDS = 5.0  # for one try
LOOPBACK = "127.0.0.1"
LOCAL = {
    "distributed.scheduler.allowed-failures": 0,  # attempts are counted by the ledger
    "distributed.deploy.lost-worker-timeout": "3650 days",  # a nanny goes on, however often its worker dies
    "distributed.worker.preload": ["import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"],  # the driver's
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
}
_thread = threading.local()


class Cluster:
    """An engine of Dask workers: of a scheduler at an address, or, with `workers` instead, so many on this machine.

    Those of this machine speak TLS with a certificate made for the run, so that no other user of it can have them run
    anything. A scheduler that is not there, or has no workers, is waited for `patience` seconds; after that InputError
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
        try:
            import dask
            import distributed
        except ImportError as error:
            raise ImportError("Dask needs the library distributed: python -m pip install 'posefit[dask]'") from error
        self._distributed, self._patience = distributed, patience
        # of a scheduler that went away; AttributeError of a client that closed meanwhile
        self._gone = OSError, TimeoutError, ValueError, AttributeError, distributed.CancelledError
        self._call = partial(_call, run, limits or Limits())
        self._running: dict[Any, Any] = {}  # the job of each future
        self._open = ExitStack()
        self._address, security = scheduler, None
        if workers is not None:
            self._open.enter_context(dask.config.set(LOCAL))
            local = _local(distributed, workers)
            self._open.callback(local.close, timeout=CONNECT_SECONDS)
            self._address, security = local.scheduler_address, local.security
        self._new_client = partial(
            distributed.Client, self._address, timeout=min(CONNECT_SECONDS, patience), set_as_default=False,
            security=security,
        )  # fmt: skip
        self._client: Any = None
        try:
            self._connect()
        except InputError:
            self.close()
            raise

    def window(self) -> int:
        """Return how many threads the workers have, once there are any."""
        until = time.monotonic() + self._patience
        while True:
            with suppress(*self._gone):
                if threads := int(sum(self._client.nthreads().values())):
                    return threads
            if self._running:
                return 0
            if time.monotonic() > until:
                raise InputError(f"scheduler {self._address} must have workers, got none for {self._patience:g} s")
            if self._client.status != "running":
                self._connect()
            time.sleep(POLL_SECONDS)

    def submit(self, job: Any) -> None:
        """Send a job; Dask chooses the worker."""
        key = f"posefit-{secrets.token_hex(16)}"
        self._running[self._client.submit(self._call, job, key=key, pure=False, retries=0)] = job

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the jobs that ended."""
        if self._client.status != "running":  # the scheduler went away, and all that it had
            lost = [Outcome(job) for job in self._running.values()]
            self._running.clear()
            self._connect()
            return lost
        if self._running:
            with suppress(*self._gone):
                self._distributed.wait(tuple(self._running), seconds, "FIRST_COMPLETED")  # type: ignore[no-untyped-call]
        return [self._outcome(future) for future in tuple(self._running) if future.done()]

    def close(self) -> None:
        """Leave the scheduler, and end the workers of this machine."""
        for future in self._running:
            future.cancel()
        if self._client is not None:
            self._client.close(timeout=CONNECT_SECONDS)
        self._open.close()

    def _outcome(self, future: Any) -> Outcome:
        job = self._running.pop(future)
        try:
            return Outcome(job, *future.result(timeout=CONNECT_SECONDS))
        except self._distributed.KilledWorker:
            return Outcome(job, None, "its worker was lost", own=False)
        except self._gone:
            return Outcome(job)  # with its worker or the scheduler
        except Exception as error:
            return Outcome(job, None, text_of(error))

    def _connect(self) -> None:
        until = time.monotonic() + self._patience
        while True:
            if self._client is not None:
                self._client.close(timeout=CONNECT_SECONDS)
            try:
                self._client = self._new_client()
                return
            except (OSError, ValueError, TimeoutError) as error:
                if isinstance(error, ValueError) or time.monotonic() > until:
                    cause = " ".join(str(error).split())
                    raise InputError(f"scheduler must be one that answers, got {self._address}: {cause}") from None
                time.sleep(min(POLL_SECONDS, self._patience))


def _call(run: Run, limits: Limits, job: Any) -> tuple[Any, str | None, bool]:
    """Return, on a thread of a worker, what a function makes of a job; or None, why, and whose fault it is."""
    if getattr(_thread, "runs", None) != (wanted := (pickle.dumps(run), limits)):
        if hasattr(_thread, "pool"):
            _thread.pool.close()
        multiprocessing.current_process().daemon = False  # which Dask's nanny makes it, and no daemon has processes
        _thread.runs, _thread.pool = wanted, Pool(1, limits, run)
    _thread.pool.submit(job)
    while not (outcomes := _thread.pool.wait(POLL_SECONDS)):
        pass
    return outcomes[0].result, outcomes[0].reason, outcomes[0].own


def _local(distributed: Any, workers: int) -> Any:
    """Return a cluster of worker processes on this machine, one thread each, unreachable from elsewhere."""
    return distributed.LocalCluster(
        n_workers=workers,
        threads_per_worker=1,
        memory_limit=0,  # each cell has a limit of its own
        host=LOOPBACK,
        protocol="tls://",
        security=distributed.Security.temporary(),
        dashboard_address=f"{LOOPBACK}:0",  # None would take a port that others may have
        scheduler_kwargs={"dashboard": False},
        silence_logs=logging.CRITICAL,
    )
