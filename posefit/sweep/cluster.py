"""Runs cells on Dask workers, as its users know it: `submit` with a bounded window, and what is ready is written.

Each thread of a worker runs its cells in a process that pool.py starts, so limits hold, and whatever a cell does, its
worker goes on: a worker that is lost was ended from outside.
"""

import multiprocessing
import pickle
import secrets
import threading
from contextlib import suppress
from functools import partial
from typing import Any

from posefit.errors import InputError
from posefit.sweep.cell import run_cell
from posefit.sweep.engine import POLL_SECONDS, Limits, Outcome, Run, text_of
from posefit.sweep.pool import Pool
from posefit.version import posefit_build

CONNECT_TIMEOUT_SECONDS = 30.0  # seconds to wait for a scheduler, and for its workers
CLOSE_SECONDS = 5.0
# what a process answers, also without posefit, to which build it has
_BUILD = "__import__('posefit.version', fromlist=['version']).posefit_build()"
_thread = threading.local()


class Cluster:
    """An engine of the Dask workers of a scheduler at an address.

    Raises InputError where the scheduler does not answer, has no workers within `patience` seconds, or goes away.
    """

    def __init__(
        self,
        scheduler: str,
        limits: Limits,
        run: Run = run_cell,
        patience: float = CONNECT_TIMEOUT_SECONDS,
    ) -> None:
        try:
            import distributed
        except ImportError as error:
            raise ImportError(
                "Dask needs the library distributed: python -m pip install 'posefit[dask]'"
            ) from error
        self._distributed = distributed
        self._address = scheduler
        self._call = partial(_call, run, limits)
        self._running: dict[Any, Any] = {}  # the job of each future
        self._client: Any = None
        try:
            self._client = distributed.Client(
                scheduler, timeout=patience, set_as_default=False
            )  # type: ignore[no-untyped-call]
            self._client.wait_for_workers(1, timeout=patience)
            self._check_versions()
        except InputError:
            self.close()
            raise
        except (OSError, ValueError, TimeoutError) as error:
            self.close()
            cause = " ".join(str(error).split())
            raise InputError(
                f"scheduler must be one with workers that answers, got {scheduler}: {cause}"
            ) from None

    def _check_versions(self) -> None:
        """Raise InputError if a worker has another posefit or none, or if the scheduler cannot read a job.

        Dask would end such a worker, or have each job fail by what looks like the job's own fault.
        """
        wanted = posefit_build()
        for worker, found in self._client.run(eval, _BUILD, on_error="return").items():
            if found != wanted:
                came = found if isinstance(found, str) else f"none ({text_of(found)})"
                raise InputError(f"the worker {worker} must have {wanted}, got {came}")
        try:
            self._client.run_on_scheduler(eval, _BUILD)
        except ImportError as error:
            raise InputError(
                f"the scheduler {self._address} must have posefit, got none ({text_of(error)})"
            ) from None

    def window(self) -> int:
        """Return how many threads the workers have; while there is none, Dask waits for one with a job."""
        try:
            return max(1, int(sum(self._client.nthreads().values())))
        # it went away, and all that it had
        except (OSError, TimeoutError, ValueError, AttributeError):
            raise InputError(
                f"scheduler must stay, got {self._address}, which went away"
            ) from None

    def submit(self, job: Any) -> None:
        """Send a job; Dask chooses the worker."""
        key = f"posefit-{secrets.token_hex(16)}"
        self._running[
            self._client.submit(self._call, job, key=key, pure=False, retries=0)
        ] = job

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the jobs that ended."""
        if self._client.status != "running":
            raise InputError(
                f"scheduler must stay, got {self._address}, which went away"
            )
        if self._running:
            with (
                suppress(TimeoutError, self._distributed.CancelledError),
                self._client.as_current(),
            ):
                self._distributed.wait(tuple(self._running), seconds, "FIRST_COMPLETED")  # type: ignore[no-untyped-call]
        return [
            self._outcome(future) for future in tuple(self._running) if future.done()
        ]

    def close(self) -> None:
        """Leave the scheduler."""
        for future in self._running:
            future.cancel()
        if self._client is not None:
            self._client.close(timeout=CLOSE_SECONDS)

    def _outcome(self, future: Any) -> Outcome:
        job = self._running.pop(future)
        try:
            return Outcome(job, *future.result(timeout=CLOSE_SECONDS))
        except self._distributed.KilledWorker:
            return Outcome(job, None, "its worker was lost", is_own_fault=False)
        except (OSError, TimeoutError, self._distributed.CancelledError):
            return Outcome(job)  # with its worker or the scheduler
        except Exception as error:
            return Outcome(job, None, text_of(error))


def _call(run: Run, limits: Limits, job: Any) -> tuple[Any, str | None, bool]:
    """Return, on a thread of a worker, what a function makes of a job; or None, why, and whose fault it is."""
    if getattr(_thread, "runs", None) != (current := (pickle.dumps(run), limits)):
        if hasattr(_thread, "pool"):
            _thread.pool.close()
        # which Dask's nanny makes it, and no daemon has processes
        multiprocessing.current_process().daemon = False
        _thread.runs, _thread.pool = current, Pool(1, limits, run)
    _thread.pool.submit(job)
    while not (outcomes := _thread.pool.wait(POLL_SECONDS)):
        pass
    return outcomes[0].result, outcomes[0].reason, outcomes[0].is_own_fault
