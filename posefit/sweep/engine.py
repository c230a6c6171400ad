"""The protocol of an engine, which runs cells in other processes.

    with closing(Pool(2, Limits(seconds=600.0), run_cell)) as engine:  # two processes
        engine.submit(cell)
        outcomes = engine.wait(1.0)  # the outcomes within a second

There are two engines: the processes of this machine (pool.py) and the workers of a Dask
scheduler (cluster.py). The ledger decides the order and keeps the state.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from posefit.errors import printable
from posefit.fitting.check import between
from posefit.limits import GIGABYTES, SECONDS

Run = Callable[[Any], Any]
POLL_SECONDS = 0.2


@dataclass(frozen=True)
class Limits:
    """The longest time of a cell, and the most memory of its process."""

    seconds: float = 3600.0
    gigabytes: float = 4.0

    def __post_init__(self) -> None:
        between("the limit of seconds", self.seconds, *SECONDS)
        between("the limit of gigabytes", self.gigabytes, *GIGABYTES)


@dataclass(frozen=True)
class Outcome:
    """The outcome of a job: its result, or the reason of its failure.

    A job is a cell, or any other argument of the engine's function. If both are None,
    the job was lost together with its worker, and counts as not tried.
    """

    job: Any
    result: Any = field(default=None, repr=False)
    reason: str | None = None
    # False only if the job was killed from outside
    is_own_fault: bool = True


class Engine(Protocol):
    """Runs a limited number of jobs at a time."""

    def window(self) -> int:
        """Return how many jobs may run at the moment.

        Raises InputError if the engine is gone for good.
        """
        ...

    def submit(self, job: Any, tenant: str = "") -> None:
        """Start a job.

        Args:
            job: The job.
            tenant: Whose job it is. Jobs of different tenants never share a process, so
                what one leaves behind in its process cannot reach another.
        """
        ...

    def wait(self, seconds: float) -> list[Outcome]:
        """Return the outcomes of the jobs that ended.

        Waits until a job ends, or for that many seconds.
        """
        ...

    def close(self) -> None:
        """Stop everything, including running jobs."""
        ...


def text_of(error: BaseException) -> str:
    """Return an exception's type and message in one line."""
    message = " ".join(str(error).split())
    return printable(f"{type(error).__name__}: {message}".removesuffix(": "))
