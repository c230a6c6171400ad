"""A search by covariance matrix adaptation (CMA-ES), from its first draw until it has come to an end."""

import math
from typing import final

import numpy as np

from posefit.arrays import Array, writeable
from posefit.evolution.constants import Constants
from posefit.evolution.kernels import adapt, stagnant

LAG = 0.1  # of the decomposition, appendix B.2
LEAST = 1e-6  # ours: the shortest axis at first, in overall step sizes
MENDED = 1e-8  # ours, as cmaes has it: an eigenvalue that rounding has made negative
FLAT, SMALL = 1e-12, 1e-12  # TolFun, and TolX in first step sizes: as cmaes has them


@final
class Strategy:
    """A normal distribution that is drawn from a generation at a time, and moves towards what costs least.

    `mean` (d,), `sigma` and `covariance` (d, d) are its mean m, step size sigma and covariance C: proposals have the
    covariance sigma^2 C. `step_path` and `path` (d,) are the evolution paths p_sigma and p_c. The decomposition of C
    is at most max(1, `lag` / (d (c_1 + c_mu))) generations old.
    """

    def __init__(self, mean: Array, spread: Array, population: int, *, lag: float = LAG) -> None:
        """Begin around `mean` (d,) with standard deviations `spread` (d,), generations of `population` proposals."""
        d, size = len(mean), math.sqrt(float((spread**2).mean()))
        self.mean, self.sigma, self.generation = np.array(mean, dtype=np.float64), size, 0
        self.covariance = np.diag(np.maximum(spread / size, LEAST) ** 2)
        self.step_path, self.path = np.zeros(d), np.zeros(d)
        constants = Constants.of(d, population)
        self._weights, self._rates, rates = constants.weights, tuple(constants.rates), constants.rates
        self._every = max(1, math.floor(lag / (d * (rates.c_1 + rates.c_mu))))  # HANSEN2016 (B.2)
        self._recent, self._small = np.zeros(2 * (10 + math.ceil(30 * d / population))), SMALL * size
        self._decompose()

    def sample(self, rng: np.random.Generator, count: int) -> Array:
        """Return so many draws (count, d)."""
        normal = rng.standard_normal((count, len(self.mean)))  # HANSEN2016 (38)
        steps = normal @ self._scaled  # HANSEN2016 (39)
        return self.mean + self.sigma * steps  # HANSEN2016 (40)

    def learn(self, proposals: Array, costs: Array) -> None:
        """Adapt to a generation of proposals (n, d), drawn here or moved since, and their finite costs (n,)."""
        order = costs.argsort(kind="stable")
        self.generation += 1
        slot = 2 * self.generation % len(self._recent)
        self._recent[slot : slot + 2] = costs[order[0]], costs[order[-1]]
        moved = self.mean, self._axes, self._lengths, self.step_path, self.path, self.covariance
        self.sigma = adapt(writeable(proposals), order, self._weights, self._rates, self.generation, self.sigma, *moved)
        if self.generation % self._every == 0:
            self._decompose()

    def ended(self) -> bool:
        """Return whether nothing more is to be found from here."""
        grown = self.mean, self._axes, self._lengths, self.path, self.covariance, self._recent
        return bool(stagnant(self.generation, self.sigma, *grown, FLAT, self._small))

    def _decompose(self) -> None:
        """Find the axes (d, d), in columns, and their lengths (d,): C = axes diag(lengths^2) axes'."""
        values, self._axes = np.linalg.eigh(self.covariance)
        if values[0] < 0.0:
            values = np.where(values < 0.0, MENDED, values)
            self.covariance = (self._axes * values) @ self._axes.T
        self._lengths = np.sqrt(values)
        self._scaled: Array = (self._axes * self._lengths).T
