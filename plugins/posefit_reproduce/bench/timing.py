"""How jobs are timed: in turn, the fastest run of each."""

import time
from collections.abc import Callable

import numpy as np

ROUNDS = 12  # of all jobs in turn; of each, the fastest run counts
TURN = 0.05  # seconds; a job runs again until its turn is over


def fastest(jobs: dict[str, Callable[[], object]]) -> dict[str, float]:
    """Return the fastest run of each job in seconds; they take turns, so that a slow moment falls on all."""
    seconds = dict.fromkeys(jobs, np.inf)
    for job in jobs.values():
        job()
    for _ in range(ROUNDS):
        for name, job in jobs.items():
            until, ended = time.perf_counter() + TURN, -np.inf
            while ended < until:  # once at least, however late it is
                began = time.perf_counter()
                job()
                ended = time.perf_counter()
                seconds[name] = min(seconds[name], ended - began)
    return seconds
