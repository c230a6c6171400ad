"""Counts of drawn poses, to check the evaluations that a plugin reports."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from posefit.silhouette.mask import Silhouette

T = TypeVar("T")


class PoseCount:
    """Counts the poses drawn within `counting`, also in posefit's threads.

    Several counts may be active at once, in one thread or in many. Poses drawn in
    threads that a plugin starts, in other processes or by direct calls of the compiled
    loops are not counted.
    """

    def __init__(self) -> None:
        self.poses = 0.0
        self._lock = threading.Lock()

    def add(self, poses: float) -> None:
        """Add a number of poses to the count."""
        with self._lock:
            self.poses += poses

    def during(self, function: Callable[..., T], *arguments: Any) -> T:
        """Call a function, count the poses that it draws, and return its result.

        Unlike `counting` it adds nothing to an outer count.
        """
        token = _current.set(self)
        try:
            return function(*arguments)
        finally:
            _current.reset(token)

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count poses drawn in the `with` block; an outer count gets them as well."""
        outer = _current.get()
        before = self.poses
        token = _current.set(self)
        try:
            yield
        finally:
            _current.reset(token)
            if outer is not None:
                outer.add(self.poses - before)


_current: ContextVar[PoseCount | None] = ContextVar("drawn", default=None)


@contextmanager
def uncounted() -> Iterator[None]:
    """Count nothing in the `with` block, even within `counting`."""
    token = _current.set(None)
    try:
        yield
    finally:
        _current.reset(token)


def count_poses(poses: float, silhouette: Silhouette | None = None) -> None:
    """Add poses to the current count.

    A pose in a smaller image counts as a fraction: the image's share of the pixels.
    """
    count = _current.get()
    if count is None:
        return
    if silhouette is not None:
        poses = poses / silhouette.scale**2
    count.add(poses)
