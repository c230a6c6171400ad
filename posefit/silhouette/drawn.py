"""Counts of drawn poses, by which the evaluations that a plugin reports are checked."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from copy import copy
from weakref import WeakKeyDictionary

from posefit.silhouette.mask import Silhouette


class PoseCount:
    """Counts the poses that are drawn within `counting`, and in any thread those compared with its `own` silhouettes.

    Several may count at once, in one thread or in many. In threads started by a plugin, poses are counted by their
    silhouettes alone; direct calls of the compiled loops, and other processes, are not counted.
    """

    def __init__(self) -> None:
        self.poses = 0.0
        self._lock = threading.Lock()

    def add(self, poses: float) -> None:
        """Count so many poses."""
        with self._lock:
            self.poses += poses

    @contextmanager
    def counting(self) -> Iterator[None]:
        """Count what is drawn in the body; an outer count gets it as well."""
        outer, before = _current.get(), self.poses
        token = _current.set(self)
        try:
            yield
        finally:
            _current.reset(token)
            if outer is not None:
                outer.add(self.poses - before)

    def own(self, silhouettes: Sequence[Silhouette]) -> list[Silhouette]:
        """Return the same silhouettes, as new objects whose poses this count gets."""
        mine = [copy(one) for one in silhouettes]
        for one in mine:
            _owners[one] = self
        return mine


def belongs(silhouette: Silhouette, origin: Silhouette) -> Silhouette:
    """Return a silhouette, counted from now on by the count that owns the one it was made of."""
    if _owners and (owner := _owners.get(origin)) is not None:
        _owners[silhouette] = owner
    return silhouette


_current: ContextVar[PoseCount | None] = ContextVar("drawn", default=None)
_owners: WeakKeyDictionary[Silhouette, PoseCount] = WeakKeyDictionary()


@contextmanager
def uncounted() -> Iterator[None]:
    """Count nothing in the body, though it is called within `counting`."""
    token = _current.set(None)
    try:
        yield
    finally:
        _current.reset(token)


def count_poses(poses: int, silhouette: Silhouette | None = None) -> None:
    """Add poses that are drawn now to the current count; in a smaller picture by its share of the pixels."""
    counted = _current.get()
    if counted is None and _owners and silhouette is not None:
        counted = _owners.get(silhouette)
    if counted is not None:
        counted.add(poses if silhouette is None else poses / silhouette.scale**2)
