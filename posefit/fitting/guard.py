"""Watches over an optimiser that somebody else wrote: whatever it does wrong ends the search with one line."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.optimiser import Optimiser


class BrokenRuleError(ValueError):
    """A plugin broke one of the rules that its kind has to keep."""


class Guarded:
    """An optimiser whose every answer is checked; `name` says whose it is in the error.

    `limit` is how many seconds an `ask` or a `tell` may take. It is kept where the operating system has timers and the
    search runs in the main thread, as in a sweep's workers; elsewhere it is not.
    """

    def __init__(self, optimiser: Optimiser, space: Space, name: str, limit: float | None = None) -> None:
        self._optimiser, self._space, self._name, self._limit = optimiser, space, name, limit

    def ask(self) -> Array:
        """Return the optimiser's next population. Raises BrokenRuleError where it is none."""
        with self._watched("ask"):
            proposals = self._optimiser.ask()
        shape = getattr(proposals, "shape", None)
        if not isinstance(proposals, np.ndarray) or proposals.shape[1:] != (self._space.dimensions,):
            came = type(proposals).__name__ if shape is None else f"shape {shape}"
            raise self._broken(f"ask must return an array of shape (n, {self._space.dimensions}), got {came}")
        if proposals.dtype.kind != "f":
            raise self._broken(f"ask must return numbers of type float64, got {proposals.dtype}")
        if proposals.size:
            reach = np.abs(proposals).max()
            if np.isnan(reach):
                raise self._broken("ask must return finite proposals, got nan")
            if reach > 1.0:
                raise self._broken(
                    f"ask must return proposals in [-1, 1], got {proposals.flat[abs(proposals).argmax()]}"
                )
        return proposals

    def tell(self, proposals: Array, costs: Array) -> None:
        """Pass the costs on."""
        with self._watched("tell"):
            self._optimiser.tell(proposals, costs)

    def advance(self, space: Space) -> None:
        """Pass the next frame's space on."""
        self._space = space
        with self._watched("advance"):
            self._optimiser.advance(space)  # type: ignore[attr-defined]

    @contextmanager
    def _watched(self, what: str) -> Iterator[None]:
        try:
            with timed(self._limit):
                yield
        except TimeoutError:
            raise self._broken(f"{what} must return within {self._limit:g} s, and did not") from None
        except Exception as error:  # a plugin may raise anything
            raise self._broken(f"{what} must not fail, got {type(error).__name__}: {error}") from error

    def _broken(self, rule: str) -> BrokenRuleError:
        return BrokenRuleError(f"{self._name}: {rule}")


@contextmanager
def timed(limit: float | None) -> Iterator[None]:
    """Raise TimeoutError in the body once it has run for `limit` seconds."""
    if limit is None or not hasattr(signal, "setitimer") or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_: int, __: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
