"""Runs cells on Dask workers.

A limited number of cells is submitted at a time, and each result is written when it is
ready. Each thread of a worker runs its cells in a process of pool.py. So limits hold,
and no cell can end its worker: if a worker is lost, it was killed from outside.
"""

import multiprocessing
import pickle
import secrets
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from typing import Any

from posefit.errors import InputError
from posefit.sweep.engine import POLL_SECONDS, Limits, Outcome, Run, text_of
from posefit.sweep.pool import Pool
from posefit.version import posefit_build

CONNECT_TIMEOUT_SECONDS = 30.0  # the longest wait for a scheduler and its workers
CLOSE_SECONDS = 5.0  # the longest wait for a ready result, and for the end
# An expression for the posefit build of a process. It is a string, because a function
# of posefit could not be sent to a process that lacks posefit.
_BUILD = "__import__('posefit.version', fromlist=['version']).posefit_build()"
_thread = threading.local()  # the pool of each thread of a Dask worker


class Cluster:
    """An engine of a Dask scheduler's workers.

    Args:
        scheduler: The scheduler's address.
        limits: The longest time and the most memory of a job.
        run: Called with a job in a worker; its result is the job's.
        patience: Seconds to wait for the scheduler, and for its first worker.

    Raises:
        ImportError: The library distributed is not installed.
        InputError: The scheduler does not answer in time, has no workers, or is lost;
            or a worker has another build of posefit.
    """

    def __init__(
        self,
        scheduler: str,
        limits: Limits,
        run: Run,
        patience: float = CONNECT_TIMEOUT_SECONDS,
    ) -> None:
        try:
            import distributed
        except ImportError as error:
            raise ImportError(
                "Dask needs the library distributed: "
                "python -m pip install 'posefit[dask]'"
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
            raise InputError(f"cannot use the scheduler {scheduler}: {cause}") from None

    def _check_versions(self) -> None:
        """Raise InputError if posefit is missing or another build on a remote process.

        Dask would otherwise end such a worker, or each job would seem to fail by its
        own fault. The scheduler needs posefit to read a job.
        """
        wanted = posefit_build()
        # a build, or the error of a process without posefit
        builds = self._client.run(eval, _BUILD, on_error="return")
        for worker, build in builds.items():
            if build == wanted:
                continue
            if not isinstance(build, str):
                build = f"none ({text_of(build)})"
            raise InputError(f"the worker {worker} must have {wanted}, got {build}")
        try:
            self._client.run_on_scheduler(eval, _BUILD)
        except ImportError as error:
            raise InputError(
                f"the scheduler {self._address} cannot import posefit: {text_of(error)}"
            ) from None

    def window(self) -> int:
        """Return twice the number of threads of all workers, but at least one.

        So a worker that ends a job already has the next one. While there are no
        workers, Dask keeps the job.
        """
        try:
            return max(1, 2 * int(sum(self._client.nthreads().values())))
        # raised by a client whose scheduler went away
        except (OSError, TimeoutError, ValueError, AttributeError):
            raise self._lost_connection() from None

    def submit(self, job: Any, tenant: str = "") -> None:
        """Send a job; Dask chooses the worker."""
        key = f"posefit-{secrets.token_hex(16)}"
        future = self._client.submit(
            self._call, job, tenant, key=key, pure=False, retries=0
        )
        self._running[future] = job

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the outcomes of the jobs that ended."""
        if self._client.status != "running":
            raise self._lost_connection()
        if self._running:
            with (
                suppress(TimeoutError, self._distributed.CancelledError),
                self._client.as_current(),
            ):
                futures = tuple(self._running)
                wait: Any = self._distributed.wait
                wait(futures, seconds, "FIRST_COMPLETED")
        done = [future for future in self._running if future.done()]
        if not done:
            return []
        # in parallel, because fetching a result from a worker takes time
        with ThreadPoolExecutor(len(done)) as threads:
            return list(threads.map(self._outcome, done))

    def close(self) -> None:
        """Leave the scheduler."""
        for future in self._running:
            future.cancel()
        if self._client is not None:
            self._client.close(timeout=CLOSE_SECONDS)

    def _lost_connection(self) -> InputError:
        return InputError(f"lost the connection to the scheduler {self._address}")

    def _outcome(self, future: Any) -> Outcome:
        job = self._running.pop(future)
        try:
            return Outcome(job, *future.result(timeout=CLOSE_SECONDS))
        except self._distributed.KilledWorker:
            return Outcome(job, None, "its worker was lost", is_own_fault=False)
        except (OSError, TimeoutError, self._distributed.CancelledError):
            return Outcome(job)  # lost with its worker or the scheduler
        except Exception as error:
            return Outcome(job, None, text_of(error))


def _call(
    run: Run, limits: Limits, job: Any, tenant: str
) -> tuple[Any, str | None, bool]:
    """Run a job on a thread of a Dask worker.

    Returns:
        The job's result, the reason if it failed, and whether that was its own fault.
    """
    current = pickle.dumps(run), limits
    if getattr(_thread, "runs", None) != current:
        if hasattr(_thread, "pool"):
            _thread.pool.close()
        # Dask's nanny makes its worker a daemon, and a daemon may not start processes
        multiprocessing.current_process().daemon = False
        _thread.pool = Pool(1, limits, run)
        _thread.runs = current
    _thread.pool.submit(job, tenant)
    while not (outcomes := _thread.pool.wait(POLL_SECONDS)):
        pass
    return outcomes[0].result, outcomes[0].reason, outcomes[0].is_own_fault
