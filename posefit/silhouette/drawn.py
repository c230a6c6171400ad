"""Counts of drawn poses, by which the evaluations that a plugin reports are checked."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from posefit.silhouette.mask import Silhouette

T = TypeVar("T")


class PoseCount:
    """Counts the poses that are drawn within `counting`, by posefit's threads too.

    Several may count at once, in one thread or in many. Poses drawn in threads that a plugin starts, in other processes
    or by direct calls of the compiled loops are not counted.
    """

    def __init__(self) -> None:
        self.poses = 0.0
        self._lock = threading.Lock()

    def add(self, poses: float) -> None:
        """Count so many poses."""
        with self._lock:
            self.poses += poses

    def during(self, function: Callable[..., T], *arguments: Any) -> T:
        """Return what a function returns, and count what it draws; unlike `counting` an outer count gets nothing."""
        token = _current.set(self)
        try:
            return function(*arguments)
        finally:
            _current.reset(token)

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count what is drawn in the body; an outer count gets it as well."""
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
    """Count nothing in the body, though it is called within `counting`."""
    token = _current.set(None)
    try:
        yield
    finally:
        _current.reset(token)


def count_poses(poses: float, silhouette: Silhouette | None = None) -> None:
    """Add poses that are drawn now to the current count; in a smaller picture by its share of the pixels."""
    count = _current.get()
    if count is not None:
        count.add(poses if silhouette is None else poses / silhouette.scale**2)
