"""CMA-ES within the box and the prior's constraint, with restarts.

N. Hansen, The CMA Evolution Strategy: A Tutorial, arXiv:1604.00772, 2016. A. Auger, N. Hansen, A restart CMA evolution
strategy with increasing population size, CEC 2005.
"""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.evolution.strategy import LAG, Strategy, default_population_size
from posefit.fitting.box import Space, displacement, draw_population, repair, wrap
from posefit.fitting.check import at_least, positive
from posefit.fitting.optimiser import finite_costs

SPREAD = 0.5  # sigma_0 in an unknown place, in half-ranges of the box
GROWTH = 2  # IPOP: each restart has a population so many times as large
ATTEMPTS = 4  # ours: without, a search from anywhere begins at the sides of the box; more find nothing better


class CMAES:
    """Covariance matrix adaptation. It starts around the prediction with its spread, or anywhere with `spread`.

    The strategy learns the covariance from evolution paths, the better half of a population and, against it, the worse
    one (active CMA), and its step size by cumulation (CSA). When the search stagnates it restarts from a fresh draw
    with a larger population (IPOP). A proposal that breaks a constraint is drawn again, and at last moved towards the
    mean until it keeps it; the strategy learns from where it was moved to.

    Settings:
        population_size (lambda): 5 or more, or 0 for 4 + 3 ln d, at least 5. Hansen 2016.
        spread (sigma): the first step size where no prediction is, in half-ranges of the box, above 0. Ours.
        growth: a restart's population is so many times as large, 1 or more. Auger and Hansen 2005.
        redraws: of a proposal that breaks a constraint before it is moved, 0 or more. Ours.
        lag: axes are decomposed every lag / (d (c_1 + c_mu)) generations, 0 or more. Hansen 2016, B.2.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 0,
        spread: float = SPREAD,
        growth: int = GROWTH,
        redraws: int = ATTEMPTS,
        lag: float = LAG,
    ) -> None:
        if population_size != 0:
            at_least("population_size", population_size, 5)
        positive("spread", spread)
        at_least("growth", growth, 1)
        at_least("redraws", redraws, 0)
        at_least("lag", lag, 0.0)
        self._space, self._rng, self._spread, self._growth = space, rng, spread, growth
        self._redraws, self._lag = redraws, lag
        self._population_size = max(population_size or default_population_size(space.dimensions), 5)
        self._asked: Array | None = None
        anywhere = np.full(space.dimensions, spread)
        self._strategy = self._begun(anywhere if space.start is None else space.start.spread)

    def ask(self) -> Array:
        """Return the next population (n, d)."""
        if self._asked is None:
            asked = wrap(self._space, self._strategy.sample(self._rng, self._population_size))
            broken = np.flatnonzero(~self._space.feasible(asked))
            if len(broken) and self._redraws:
                broken = self._redraw(asked, broken)
            if len(broken):
                mean = repair(self._space, self._strategy.mean[None], self._home)[0]
                asked[broken] = repair(self._space, asked[broken], mean)
            self._asked = asked
        return self._asked.copy()

    def _redraw(self, asked: Array, broken: NDArray[np.int64]) -> NDArray[np.int64]:
        """Put new draws that break no constraint in some rows of (n, d); return the rows for which there were none."""
        again = wrap(self._space, self._strategy.sample(self._rng, len(broken) * self._redraws))
        works = self._space.feasible(again).reshape(-1, self._redraws)
        first, mended = works.argmax(axis=1), works.any(axis=1)
        chosen = again.reshape(*works.shape, -1)[np.arange(len(broken)), first]
        asked[broken[mended]] = chosen[mended]
        return broken[~mended]

    def tell(self, proposals: Array, costs: Array) -> None:
        """Adapt mean, step size and covariance, and restart where the search has come to an end."""
        if len(proposals) != self._population_size:
            raise InputError(f"tell must get a population of {self._population_size}, got {len(proposals)}")
        known, mean = finite_costs(costs), self._strategy.mean
        # the mean goes on past the end of a circle, and so must what it learns from
        round_trip = self._space.periodic.any()
        self._strategy.learn(mean + displacement(self._space, mean, proposals) if round_trip else proposals, known)
        self._home, self._asked = proposals[known.argmin()].copy(), None
        if self._strategy.ended():
            self._restart()

    def _restart(self) -> None:
        self._population_size *= self._growth  # AUGER2005 (restart)
        self._strategy = self._begun(np.full(self._space.dimensions, self._spread))

    def _begun(self, spread: Array) -> Strategy:
        """Return a strategy around the prediction, or else around a fresh draw."""
        start = self._space.start
        self._home = draw_population(self._space, self._rng, 1)[0]
        if start is not None and self._space.feasible(start.mean[None])[0]:
            self._home = start.mean.copy()
        return Strategy(self._home, spread, self._population_size, lag=self._lag)
