"""An ask/tell optimiser made from a library that calls the objective itself, run in a thread of its own."""

import threading
import weakref
from collections.abc import Callable
from queue import SimpleQueue
from typing import Any, final

import numpy as np

from posefit.errors import InputError
from posefit.plugin import Array, Space, draw_population, finite_costs, repair

LEAVE_SECONDS = 5.0  # how long to wait for a library to leave when its search is dropped

Objective = Callable[[Array], Array]
Library = Callable[[Space, np.random.Generator, Objective], Any]


@final
class Bridged:
    """An optimiser that runs `library(space, rng, objective)` in a thread, which waits in the objective for the costs.

    Proposals are repaired where they are not feasible, and costs are finite. The thread ends with the search: when
    this object is dropped, the objective raises. A copy, or what comes out of a pickle, runs the library again and
    repeats the costs so far, so `library` has to do the same every time, and has to be picklable for a pickle.
    """

    def __init__(self, space: Space, rng: np.random.Generator, library: Library) -> None:
        self._space, self._home = space, draw_population(space, rng, 1)[0]
        self._library, self._seed = library, int(rng.integers(2**63))
        self._costs: list[Array] = []  # of all populations so far
        self._asked: Array | None = None
        self._channel: _Channel | None = None

    def ask(self) -> Array:
        """Return the population (n, d) whose costs the library waits for; an empty one once it has ended."""
        ended = self._channel is not None and self._asked is None
        if not ended and (self._channel is None or not self._channel.thread.is_alive()):  # not begun, copied or forked
            self._channel = _Channel(self._library, self._space, self._seed)
            weakref.finalize(self, self._channel.close)
            self._asked = self._channel.proposals()
            for costs in self._costs:
                self._channel.costs.put(costs)
                self._asked = self._channel.proposals()
        if self._asked is None:
            return np.empty((0, self._space.dimensions))
        return repair(self._space, self._asked, self._home)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Pass the costs (n,) on. Raises ValueError where there are no proposals, or another number of them."""
        if self._asked is None or self._channel is None:
            raise InputError("tell must follow ask, got costs before proposals")
        if len(costs) != len(self._asked):
            raise InputError(f"tell must get {len(self._asked)} costs, got {len(costs)}")
        self._costs.append(finite_costs(costs))
        self._channel.costs.put(self._costs[-1])
        self._asked = self._channel.proposals()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_channel": None, "_asked": None}


class _DroppedError(BaseException):
    """Unwinds the library; not an Exception, which it might catch."""


class _Channel:
    """What the two threads share. It does not refer to the optimiser, which could never be dropped otherwise."""

    def __init__(self, library: Library, space: Space, seed: int) -> None:
        self._proposals: SimpleQueue[Array | BaseException | None] = SimpleQueue()
        self.costs: SimpleQueue[Array | None] = SimpleQueue()
        self.thread = threading.Thread(
            target=self._run, args=(library, space, seed), daemon=True, name="posefit_scipy bridge"
        )
        self.thread.start()

    def proposals(self) -> Array | None:
        """Return the library's next proposals; None once it has ended."""
        proposals = self._proposals.get()
        if isinstance(proposals, BaseException):
            raise RuntimeError(f"the library failed: {type(proposals).__name__}: {proposals}") from proposals
        return proposals

    def close(self) -> None:
        """End the thread."""
        self.costs.put(None)
        if self.thread is not threading.current_thread():
            self.thread.join(LEAVE_SECONDS)

    def _run(self, library: Library, space: Space, seed: int) -> None:
        try:
            library(space, np.random.default_rng(seed), self._objective)
            self._proposals.put(None)
        except _DroppedError:
            pass
        except BaseException as error:  # whatever it is, `ask` or `tell` raises it
            self._proposals.put(error)

    def _objective(self, proposals: Array) -> Array:
        self._proposals.put(np.array(proposals, dtype=np.float64))
        costs = self.costs.get()
        if costs is None:
            raise _DroppedError
        return costs
