"""CMA-ES as the library cmaes implements it, within the box and the prior's constraint, with restarts.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, 2016. A. Auger, N. Hansen, A restart CMA evolution
strategy with increasing population size, CEC 2005.
"""

import math

import numpy as np
from cmaes import CMA

from posefit.fitting.box import Space
from posefit.fitting.check import at_least, positive
from posefit.geometry.rotation import Array

SPREAD = 0.5  # sigma_0 in an unknown place, in half-ranges of the box
GROWTH = 2  # IPOP: each restart has a population so many times as large
WORST = 1e30  # stands for a cost that is nan or infinite


class CMAES:
    """Covariance matrix adaptation. It starts around the prediction with its spread, or anywhere with `spread`.

    `population` of 0 is the tutorial's 4 + 3 ln d. When the search stagnates it restarts from a fresh draw with a
    population `growth` times as large; 1 keeps its size. A proposal that breaks a constraint is moved towards the mean
    until it keeps it, and the strategy learns from where it was moved to.
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
        self._population = population or 4 + math.floor(3 * math.log(space.dimensions))  # HANSEN2016 (48)
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
        seed = int(self._rng.integers(2**31))
        self._strategy = CMA(self._home.copy(), size, seed=seed, population_size=self._population, cov=covariance)

    def ask(self) -> Array:
        """Return the next population (n, d)."""
        if self._asked is None:
            drawn = np.array([self._strategy.ask() for _ in range(self._population)])  # HANSEN2016 (38)-(40)
            mean = self._space.repair(self._strategy.mean[None], self._home)[0]
            self._asked = self._space.repair(drawn, mean)
        return self._asked.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Adapt mean, step size and covariance, and restart where the search has come to an end."""
        known = np.where(np.isfinite(costs), costs, WORST)
        self._strategy.tell([(row, float(cost)) for row, cost in zip(proposals, known, strict=True)])
        self._home, self._asked = proposals[known.argmin()].copy(), None
        if self._strategy.should_stop():
            self._population *= self._growth
            self._restart(np.full(self._space.dimensions, self._spread))
