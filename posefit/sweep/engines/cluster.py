"""Runs cells on a Dask cluster, through its own client."""

import importlib
import logging
import secrets
import signal
import threading
import time
from dataclasses import dataclass
from typing import Any

from posefit.sweep.cell import Cell, run_cell
from posefit.sweep.engines.engine import EngineError, Limits, Outcome, Run, text_of
from posefit.sweep.engines.processes import called

PATIENCE = 30.0  # seconds to wait for a scheduler, or for workers, that are not there
CONNECT_SECONDS = 5.0  # for one try
RESULT_SECONDS = 10.0  # for a result that is ready to come over
LOOPBACK = "127.0.0.1"
POLL_SECONDS = 1.0  # between two checks which workers there are


@dataclass
class _Sent:
    """A cell on its way."""

    cell: Cell
    worker: str  # the address that it was sent to
    missed: int = 0  # checks in a row at which the worker was gone


class Cluster:
    """An engine of Dask workers: of a scheduler at an address, or, with `workers` instead, so many on this machine.

    Each cell is sent to one worker that has no other. So it starts at once, no other cell dies with it, and Dask does
    not run it again by itself. The worker runs it in a process of its own, see `posefit.sweep.engines.processes`:
    limits, threads and a cell's end touch nothing else on it. With `dashboard` the workers of this machine have Dask's
    page, on the loopback. A scheduler that is not there, or has no workers, is waited for `patience` seconds; after
    that EngineError is raised.
    """

    def __init__(
        self,
        scheduler: str | None = None,
        workers: int | None = None,
        limits: Limits | None = None,
        run: Run = run_cell,
        patience: float = PATIENCE,
        dashboard: bool = False,
    ) -> None:
        self._limits, self._run, self._patience = limits or Limits(), run, patience
        self._distributed = _library()
        self._local = None if workers is None else _local(self._distributed, workers, dashboard)
        self._address = scheduler if self._local is None else self._local.scheduler_address
        self._running: dict[Any, _Sent] = {}
        self._idle: list[str] = []
        self._checked = 0.0
        self._woken = threading.Event()
        self._client: Any = None
        try:
            self._connect()
        except EngineError:
            self.close()
            raise

    def window(self) -> int:
        """Return how many workers there are, once there are any."""
        until = time.monotonic() + self._patience
        self._check_workers()
        while not self._idle and not self._running:
            if time.monotonic() > until:
                raise EngineError(f"scheduler {self._address} must have workers, got none for {self._patience:g} s")
            time.sleep(POLL_SECONDS)
            self._check_workers()
        return len(self._idle) + len(self._running)

    def submit(self, cell: Cell) -> None:
        """Send a cell to an idle worker."""
        worker = self._idle.pop()
        arguments = self._run, cell, self._limits
        name = f"{cell.key}-{secrets.token_hex(4)}"
        future = self._client.submit(called, *arguments, key=name, workers=[worker], pure=False, retries=0)
        self._running[future] = _Sent(cell, worker)
        future.add_done_callback(lambda _: self._woken.set())

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the cells that ended."""
        self._woken.wait(seconds if self._running else 0.0)
        self._woken.clear()
        if self._client.status != "running":
            lost = [
                Outcome(sent.cell) for sent in self._running.values()
            ]  # with the scheduler, once there is one again
            self._running.clear()
            self._connect()
            return lost
        self._check_workers()
        outcomes = [self._outcome(future) for future in tuple(self._running)]
        return [outcome for outcome in outcomes if outcome is not None]

    def close(self) -> None:
        """Leave the scheduler, and end the workers of this machine."""
        for future in self._running:
            future.release()
        if self._client is not None:
            self._client.close(timeout=CONNECT_SECONDS)
        if self._local is not None:
            self._local.close(timeout=CONNECT_SECONDS)

    def _outcome(self, future: Any) -> Outcome | None:
        sent = self._running[future]
        try:
            if future.status == "finished":
                ended = Outcome(sent.cell, *future.result(timeout=RESULT_SECONDS))
            elif future.status == "error":
                ended = self._unrun(sent, future.exception(timeout=RESULT_SECONDS))
            elif sent.missed > 1:
                ended = self._unrun(sent, None)
            else:
                return None
        except (TimeoutError, OSError, self._distributed.CancelledError):
            return None  # its worker died with the result
        except Exception as error:  # a result that cannot be read
            ended = Outcome(sent.cell, None, text_of(error))
        finished = future.status == "finished"
        del self._running[future]
        future.cancel()
        if finished:
            self._idle.append(sent.worker)
        else:
            self._checked = 0.0  # the worker may be gone
        return ended

    def _unrun(self, sent: _Sent, error: BaseException | None) -> Outcome:
        """Return that a worker did not run a cell: nothing that a cell does ends a worker, or raises in it."""
        if error is None or type(error).__name__ == "KilledWorker":
            return Outcome(sent.cell, None, "its worker was lost", own=False)
        return Outcome(sent.cell, None, f"its worker could not run it: {text_of(error)}", own=False)

    def _check_workers(self) -> None:
        if time.monotonic() - self._checked < POLL_SECONDS:
            return
        try:
            present = set(self._client.nthreads())
        except (OSError, TimeoutError, self._distributed.CancelledError):
            return  # the next `wait` handles it
        for sent in self._running.values():
            sent.missed = 0 if sent.worker in present else sent.missed + 1
        self._idle = sorted(present - {sent.worker for sent in self._running.values()})
        self._checked = time.monotonic()

    def _connect(self) -> None:
        until = time.monotonic() + self._patience
        while True:
            if self._client is not None:
                self._client.close(timeout=CONNECT_SECONDS)
            try:
                limit = min(CONNECT_SECONDS, self._patience)
                self._client = self._distributed.Client(self._address, timeout=limit, set_as_default=False)
                if self._local is not None:
                    self._client.register_plugin(_plugin(self._distributed))
                return
            except (OSError, ValueError, TimeoutError) as error:
                if isinstance(error, ValueError) or time.monotonic() > until:
                    cause = " ".join(str(error).split())
                    raise EngineError(f"scheduler must be one that answers, got {self._address}: {cause}") from None
                time.sleep(min(POLL_SECONDS, self._patience))


def _local(distributed: Any, workers: int, dashboard: bool) -> Any:
    """Return a cluster of worker processes on this machine, one thread each, unreachable from elsewhere."""
    import dask

    settings: dict[str, Any] = {"distributed.scheduler.allowed-failures": 0}  # attempts are counted by the ledger
    if not dashboard:
        settings |= {f"distributed.{one}.http.routes": [] for one in ("scheduler", "worker")}
    with dask.config.set(settings):
        return distributed.LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            memory_limit=0,  # each cell has a limit of its own
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",  # None would take a port that others may have
            scheduler_kwargs={"dashboard": dashboard},
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
