"""Runs jobs in the worker processes of a sweep, for experiments and studies."""

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import closing
from typing import Any, TypeVar

from posefit.errors import InputError
from posefit.silhouette.sharing import cores
from posefit.sweep.engine import POLL_SECONDS, Limits
from posefit.sweep.pool import Pool

Progress = Callable[[Iterator[Any], int], Iterator[Any]]
K = TypeVar("K", bound=Hashable)
T = TypeVar("T")


def each(
    jobs: Mapping[K, Callable[[], T]],
    workers: int | None,
    progress: Progress | None = None,
    limits: Limits | None = None,
) -> dict[K, T]:
    """Return the result of every job under its key, computed in several processes.

    By default there is one process for each core. Jobs and results are pickled. If a
    job fails, raises InputError and ends the others.
    """
    wanted = cores() if workers is None else workers
    engine = Pool(min(wanted, len(jobs)), limits or Limits(), _called)

    def ended() -> Iterator[tuple[K, T]]:
        waiting = deque(jobs.items())
        running = 0
        while waiting or running:
            while waiting and running < engine.window():
                engine.submit(waiting.popleft())
                running += 1
            for outcome in engine.wait(POLL_SECONDS):
                running -= 1
                key = outcome.job[0]
                if outcome.result is None:
                    raise InputError(f"{key}: {outcome.reason or 'its process ended'}")
                yield key, outcome.result

    with closing(engine):
        results = dict(progress(ended(), len(jobs)) if progress else ended())
    return {key: results[key] for key in jobs}


def _called(job: tuple[K, Callable[[], T]]) -> T:
    return job[1]()
