"""Jobs in processes of the sweep engine: functions without arguments, whose results come back as they are."""

from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from contextlib import closing
from typing import Any, TypeVar

from posefit.errors import InputError
from posefit.sweep.command import cores
from posefit.sweep.engines.engine import Limits
from posefit.sweep.engines.processes import Processes

PATIENCE = 0.2  # seconds between checks for an interruption

Progress = Callable[[Iterator[Any], int], Iterator[Any]]
K = TypeVar("K", bound=Hashable)
T = TypeVar("T")


def each(jobs: Mapping[K, Callable[[], T]], workers: int | None, progress: Progress | None = None) -> dict[K, T]:
    """Return what every job gives, under its key, from so many processes; by default one a core.

    Jobs and results travel between processes. Raises ValueError where a job fails, and ends the others.
    """
    if workers is not None and workers < 1:
        raise InputError(f"workers must be at least 1, got {workers}")
    engine: Processes[tuple[K, Callable[[], T]], T] = Processes(min(workers or cores(), len(jobs)), Limits(), _called)
    with closing(engine):
        ended = _ended(jobs, engine)
        results = dict(progress(ended, len(jobs)) if progress else ended)
    return {key: results[key] for key in jobs}


def _ended(jobs: Mapping[K, Callable[[], T]], engine: Processes[tuple[K, Callable[[], T]], T]) -> Iterator[tuple[K, T]]:
    """Yield the keys and results of jobs as they end."""
    waiting, running = deque(jobs.items()), 0
    while waiting or running:
        while waiting and running < engine.window():
            engine.submit(waiting.popleft())
            running += 1
        for one in engine.wait(PATIENCE):
            running -= 1
            key = one.cell[0]
            if one.result is None:
                raise InputError(f"{key}: {one.reason}")
            yield key, one.result


def _called(job: tuple[K, Callable[[], T]]) -> T:
    return job[1]()


def check_seeds(seeds: int) -> None:
    """Return nothing. Raises ValueError where it is no number of seeds."""
    if seeds < 1:
        raise InputError(f"seeds must be at least 1, got {seeds}")
