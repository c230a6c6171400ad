"""Asks and tells a library that wants to call the objective itself."""

import threading
import weakref
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space, draw_population, repair

WORST = 1e15  # the largest cost that other libraries get to see: few bear nan, infinity or the square of 1e300
PATIENCE = 5.0  # seconds to wait for a library to leave when its search is dropped

Objective = Callable[[Array], Array]


def bearable(costs: Array) -> Array:
    """Return costs (n,) that any library bears: finite, at most 1e15 to either side, nan the worst of all."""
    return np.clip(np.where(np.isnan(costs), WORST, costs), -WORST, WORST)


class GlobalRandom:
    """Lends a library a global numpy generator of its own: within `with`, and put back as it was afterwards."""

    def __init__(self, seed: int) -> None:
        self._mine = np.random.RandomState(seed).get_state()

    def __enter__(self) -> None:
        self._yours = np.random.get_state()  # noqa: NPY002, the state to be left alone
        np.random.set_state(self._mine)  # noqa: NPY002

    def __exit__(self, *_: object) -> None:
        self._mine = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._yours)  # noqa: NPY002


class Bridge:
    """Runs `library(objective)` in a thread that waits inside the objective until the costs are told.

    The thread ends with the search: when this object is dropped, the library finds an exception instead of costs. A
    copy, or what comes out of a pickle, runs the library anew and tells it again what it was told, so `library` has to
    do the same every time, and has to be picklable for a pickle.
    """

    def __init__(self, library: Callable[[Objective], Any]) -> None:
        self._library = library
        self._told: list[Array] = []
        self._asked: Array | None = None
        self._line: _Line | None = None

    def ask(self) -> Array | None:
        """Return the proposals (n, d) whose costs the library waits for; None once it has ended."""
        ended = self._line is not None and self._asked is None
        if not ended and (self._line is None or not self._line.thread.is_alive()):  # not begun, copied, or forked
            self._line = _Line(self._library)
            weakref.finalize(self, self._line.close)
            self._asked = self._line.question()
            for costs in self._told:
                self._line.answers.put(costs)
                self._asked = self._line.question()
        return None if self._asked is None else self._asked.copy()

    def tell(self, costs: Array) -> None:
        """Give the library the costs (n,) of what `ask` returned."""
        if self._asked is None or self._line is None:
            raise ValueError("tell must follow ask, got costs that nobody asked for")
        if len(costs) != len(self._asked):
            raise ValueError(f"tell must get {len(self._asked)} costs, got {len(costs)}")
        self._told.append(bearable(costs))
        self._line.answers.put(self._told[-1])
        self._asked = self._line.question()

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_line": None, "_asked": None}


class Bridged:
    """An optimiser that is another library's: `library(space, rng, objective)` runs behind a bridge.

    What it asks for is moved to where it is feasible. It sees only costs that any library bears.
    """

    def __init__(
        self, space: Space, rng: np.random.Generator, library: Callable[[Space, np.random.Generator, Objective], Any]
    ) -> None:
        self._space, self._home = space, draw_population(space, rng, 1)[0]
        self._bridge = Bridge(partial(_seeded, library, space, int(rng.integers(2**63))))

    def ask(self) -> Array:
        """Return the population (n, d) that the library asks for; none once it has ended."""
        asked = self._bridge.ask()
        return np.empty((0, self._space.dimensions)) if asked is None else repair(self._space, asked, self._home)

    def tell(self, proposals: Array, costs: Array) -> None:  # noqa: ARG002, the library knows what it asked
        """Give the library the costs of what it asked for; ValueError where their number is another."""
        self._bridge.tell(costs)


def _seeded(library: Callable[..., Any], space: Space, seed: int, objective: Objective) -> None:
    library(space, np.random.default_rng(seed), objective)


class _DroppedError(BaseException):
    """Unwinds the library; not an Exception, which it might catch."""


class _Line:
    """What the two threads share. It does not know the bridge, or the bridge would never be dropped."""

    def __init__(self, library: Callable[[Objective], Any]) -> None:
        self._questions: SimpleQueue[Array | BaseException | None] = SimpleQueue()
        self.answers: SimpleQueue[Array | None] = SimpleQueue()
        self.thread = threading.Thread(target=self._work, args=(library,), daemon=True, name="posefit bridge")
        self.thread.start()

    def question(self) -> Array | None:
        asked = self._questions.get()
        if isinstance(asked, BaseException):
            raise RuntimeError(f"the library failed: {type(asked).__name__}: {asked}") from asked
        return asked

    def close(self) -> None:
        self.answers.put(None)
        if self.thread is not threading.current_thread():
            self.thread.join(PATIENCE)

    def _work(self, library: Callable[[Objective], Any]) -> None:
        try:
            library(self._costs)
            self._questions.put(None)
        except _DroppedError:
            pass
        except BaseException as error:  # whatever it is, the one who asks must hear of it
            self._questions.put(error)

    def _costs(self, proposals: Array) -> Array:
        self._questions.put(np.array(proposals, dtype=np.float64))
        costs = self.answers.get()
        if costs is None:
            raise _DroppedError
        return costs
