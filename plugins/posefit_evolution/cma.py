"""CMA-ES as the library cmaes implements it, within the box and the prior's constraint, with restarts.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, 2016. A. Auger, N. Hansen, A restart CMA evolution
strategy with increasing population size, CEC 2005.
"""

import math
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.bridge import bearable
from posefit.fitting.check import at_least, positive

SPREAD = 0.5  # sigma_0 in an unknown place, in half-ranges of the box
GROWTH = 2  # IPOP: each restart has a population so many times as large


def _library(*arguments: Any, **settings: Any) -> Any:
    from cmaes import CMA  # here, as it loads scipy.stats, which takes more than a second

    return CMA(*arguments, **settings)


class CMAES:
    """Covariance matrix adaptation. It starts around the prediction with its spread, or anywhere with `spread`.

    The library learns the covariance from evolution paths and its step size by cumulation (CSA). When the
    search stagnates it restarts from a fresh draw with a larger population (IPOP). A proposal that breaks a constraint
    is moved towards the mean until it keeps it, and the strategy learns from where it was moved to.

    Settings:
        population (lambda): 5 or more, or 0 for 4 + 3 ln d, at least 5. Hansen 2016.
        spread (sigma): the first step size where no prediction is, in half-ranges of the box, above 0. Ours.
        growth: a restart's population is so many times as large, 1 or more. Auger and Hansen 2005.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population: int = 0,
        spread: float = SPREAD,
        growth: int = GROWTH,
    ) -> None:
        if population != 0:
            at_least("population", population, 5)
        positive("spread", spread)
        at_least("growth", growth, 1)
        self._space, self._rng, self._spread, self._growth = space, rng, spread, growth
        self._population = population or 4 + math.floor(3 * math.log(space.dimensions))  # HANSEN2016 (population)
        self._population = max(self._population, 5)
        self._asked: Array | None = None
        self._restart(space.start.spread if space.start is not None else np.full(space.dimensions, spread))

    def _restart(self, spread: Array) -> None:
        start = self._space.start
        self._home = self._space.draw(self._rng, 1)[0]
        if start is not None and self._space.feasible(start.mean[None])[0]:
            self._home = start.mean.copy()
        size = math.sqrt(float((spread**2).mean()))
        covariance = np.diag(np.maximum(spread / size, 1e-6) ** 2)
        self._strategy = _library(self._home.copy(), size, population_size=self._population, cov=covariance)

    def ask(self) -> Array:
        """Return the next population (n, d)."""
        if self._asked is None:
            self._strategy.reseed_rng(int(self._rng.integers(2**31)))  # its own generator is lost in a pickle
            drawn = np.array([self._strategy.ask() for _ in range(self._population)])  # HANSEN2016 (sampling)
            mean = self._space.repair(self._strategy.mean[None], self._home)[0]
            self._asked = self._space.repair(drawn, mean)
        return self._asked.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Adapt mean, step size and covariance, and restart where the search has come to an end."""
        if len(proposals) != self._population:
            raise ValueError(f"tell must get a population of {self._population}, got {len(proposals)}")
        known = bearable(costs)
        self._strategy.tell(
            [(row, float(cost)) for row, cost in zip(proposals, known, strict=True)]
        )  # HANSEN2016 (update)
        self._home, self._asked = proposals[known.argmin()].copy(), None
        if self._strategy.should_stop():
            self._population *= self._growth  # AUGER2005 (restart)
            self._restart(np.full(self._space.dimensions, self._spread))

    def __getstate__(self) -> dict[str, Any]:
        # the library's own pickle rounds the covariance, and the copy would drift away from the original
        return {**self.__dict__, "_strategy": vars(self._strategy)}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._strategy = _library(np.zeros(2), 1.0)
        self._strategy.__dict__.update(state["_strategy"])
