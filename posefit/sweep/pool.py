"""An engine that runs cells, or other jobs, in processes of this machine.

Whatever a job does to its process ends with that process.
"""

from collections.abc import Callable
from multiprocessing import connection
from typing import Any

import cloudpickle

from posefit.errors import InputError
from posefit.sweep.engine import Limits, Outcome, Run
from posefit.sweep.worker import Worker

# The most processes beyond one for each job that may run. They are idle, and wait for
# the next job of their tenant, as starting one takes about a second.
SPARE = 4


class Pool:
    """An engine of worker processes on this machine.

    Args:
        workers: Number of jobs that run at a time, each in its own process.
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
        self._count = workers
        self._limits = limits
        self._task = cloudpickle.dumps((run, prepare))
        self._workers: list[Worker] = []  # sorted by the time of their last use

    def window(self) -> int:
        """Return how many jobs may run at a time."""
        return self._count

    def submit(self, job: Any, tenant: str = "") -> None:
        """Start a job in an idle process of its tenant, or in a new one."""
        idle = [worker for worker in self._workers if not worker.is_busy]
        for worker in idle.copy():
            # an idle process may have been killed meanwhile
            if not worker.is_alive:
                self._end(worker)
                idle.remove(worker)
        of_tenant = [worker for worker in idle if worker.tenant == tenant]
        if of_tenant:
            worker = of_tenant[-1]
            self._workers.remove(worker)
        else:
            if idle and len(self._workers) >= self._count + SPARE:
                self._end(idle[0])
            worker = Worker(self._task, self._limits, tenant)
        self._workers.append(worker)
        worker.begin(job)

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the outcomes of the jobs that ended.

        Returns after that many seconds, or earlier if a process starts or a job ends.
        """
        busy = [worker for worker in self._workers if worker.is_busy]
        connection.wait([worker.connection for worker in busy], seconds)
        outcomes = []
        for worker in busy:
            outcome = worker.outcome()
            if outcome is not None:
                outcomes.append(outcome)
            if not worker.is_alive:
                self._end(worker)
        return outcomes

    def close(self) -> None:
        """End all processes."""
        for worker in self._workers.copy():
            self._end(worker)

    def _end(self, worker: Worker) -> None:
        worker.end()
        self._workers.remove(worker)
