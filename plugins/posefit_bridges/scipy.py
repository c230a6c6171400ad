"""Optimisers of SciPy for posefit: `scipy:differential_evolution` and `scipy:dual_annealing`.

R. Storn, K. Price, Differential evolution, Journal of Global Optimization 11, 1997; Y. Xiang et al., Generalized
simulated annealing for global optimization, The R Journal 5(1), 2013.

>>> import posefit
>>> track = posefit.track("walk", method="scipy:differential_evolution", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

import threading
import weakref
from collections.abc import Callable
from functools import partial
from queue import SimpleQueue
from typing import Any, Literal, final

import numpy as np

from posefit.plugin import Adapter, Array, Space, at_least, choices, draw_population

LEAVE_SECONDS = 5.0  # how long to wait for a library to leave when its search is dropped

Objective = Callable[[Array], Array]
Library = Callable[[Space, np.random.Generator, Objective], Any]


@final
class Bridged(Adapter):
    """An optimiser that runs `library(space, rng, objective)` in a thread, which waits in the objective for the costs.

    Proposals are repaired where they are not feasible, and costs are finite. The thread ends with the search: when
    this object is dropped, the objective raises. A copy, or what comes out of a pickle, runs the library again and
    repeats the costs so far, so `library` has to do the same every time, and has to be picklable for a pickle.
    """

    def __init__(self, space: Space, rng: np.random.Generator, library: Library) -> None:
        super().__init__(space, draw_population(space, rng, 1)[0])
        self._library, self._seed = library, int(rng.integers(2**63))
        self._costs: list[Array] = []  # of all populations so far
        self._channel: _Channel | None = None

    def propose(self) -> Array:
        """Return the population (n, d) whose costs the library waits for; an empty one once it has ended."""
        told: list[Array | None] = [*self._costs[-1:]]
        if self._channel is None or not self._channel.thread.is_alive():  # not begun, copied or forked
            self._channel, told = _Channel(self._library, self._space, self._seed), [None, *self._costs]
            weakref.finalize(self, self._channel.close)
        for costs in told:
            asked = self._channel.proposals(costs)
        return np.empty((0, self._space.dimensions)) if asked is None else asked

    def learn(self, proposals: Array, costs: Array) -> None:
        """Pass the costs (n,) on."""
        self._costs.append(costs)

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
            target=self._run, args=(library, space, seed), daemon=True, name="posefit_bridges.scipy"
        )
        self.thread.start()

    def proposals(self, told: Array | None) -> Array | None:
        """Return the library's next proposals, after the costs of the last ones; None once it has ended."""
        if told is not None:
            self.costs.put(told)
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
        except BaseException as error:  # whatever it is, `ask` raises it
            self._proposals.put(error)

    def _objective(self, proposals: Array) -> Array:
        self._proposals.put(np.array(proposals, dtype=np.float64))
        costs = self.costs.get()
        if costs is None:
            raise _DroppedError
        return costs


Variant = Literal["differential_evolution", "dual_annealing"]


def scipy(
    space: Space, rng: np.random.Generator, *, variant: Variant = "differential_evolution", population_size: int = 40
) -> Bridged:
    """SciPy's differential evolution, or its dual annealing, which proposes one at a time.

    A search that has converged starts again. Dual annealing goes without its local search, which needs gradients.

    Settings:
        variant: "differential_evolution" or "dual_annealing"; `scipy:NAME` sets it.
        population_size: size of differential evolution's population, 5 or more; dual annealing has none.
    """
    at_least("population_size", population_size, 5)
    choices(scipy, locals())
    return Bridged(space, rng, partial(_evolve, population_size) if variant == "differential_evolution" else _anneal)


def _evolve(population_size: int, space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from scipy.optimize import differential_evolution

    box: Any = [(-1.0, 1.0)] * space.dimensions
    settings: Any = {"vectorized": True, "updating": "deferred", "polish": False, "maxiter": 10**9, "tol": 0.0}

    def columns(proposals: Any) -> Any:
        return objective(proposals.T)

    while True:
        first: Any = draw_population(space, rng, population_size)
        differential_evolution(columns, box, init=first, rng=rng, **settings)


def _anneal(space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from scipy.optimize import dual_annealing

    box: Any = [(-1.0, 1.0)] * space.dimensions

    def row(proposal: Any) -> Any:
        return float(objective(proposal[None])[0])

    while True:
        first = draw_population(space, rng, 1)[0]
        dual_annealing(row, box, x0=first, rng=rng, no_local_search=True)
