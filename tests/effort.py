"""How much a call does, counted: the same on any machine, however slow and busy it is."""

from collections.abc import Callable
from cProfile import Profile
from dataclasses import dataclass
from pathlib import Path
from pstats import Stats


@dataclass(frozen=True)
class Effort:
    """What a call took."""

    calls: int  # of functions, those written in C too
    read: int  # bytes


def read_so_far() -> int:
    """Return how many bytes this process has read, from files or elsewhere."""
    status = dict(
        line.split(": ") for line in Path("/proc/self/io").read_text().splitlines()
    )
    return int(status["rchar"])


def effort(call: Callable[[], object]) -> Effort:
    """Return what a call takes; only what it does a second time and later is always the same."""
    profile = Profile()
    before = read_so_far()
    profile.runcall(call)
    read = read_so_far() - before
    return Effort(Stats(profile).total_calls, read)  # type: ignore[attr-defined]
