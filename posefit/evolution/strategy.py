"""A search by covariance matrix adaptation (CMA-ES), from its first draw until it has come to an end."""

import math
from typing import NamedTuple, final

import numpy as np

from posefit.arrays import Array, writeable
from posefit.evolution.kernels import decompose, learn, sample, stagnant

ALPHA = 2.0  # alpha_cov
SLACK = 1e-8  # ours, as cmaes has it: what the rates of the covariance leave of 1 where populations are huge


class Rates(NamedTuple):
    """How fast mean, step size and covariance follow what is selected: the tutorial's Table 1."""

    mu_eff: float  # how many selected steps the weighted ones are worth
    c_sigma: float  # of the step size's path
    d_sigma: float  # the step size's damping
    c_c: float  # of the covariance's path
    c_1: float  # of the covariance, from its path
    c_mu: float  # of the covariance, from the population
    chi: float  # how long a standard normal vector is, on average


def constants(dimensions: int, population: int) -> tuple[Array, Rates]:
    """Return the weights of a population (lambda, 4 or more), best first, and the rates that follow from them.

    The better half of the weights sums to 1, the worse half is negative.
    """
    n, mu = dimensions, population // 2
    raw = math.log((population + 1) / 2) - np.log(np.arange(1, population + 1))  # HANSEN2016 (49)
    mu_eff, mu_eff_minus = _worth(raw[:mu]), _worth(raw[mu:])
    c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0)  # HANSEN2016 (55)
    d_sigma = 1.0 + 2.0 * max(0.0, math.sqrt((mu_eff - 1.0) / (n + 1.0)) - 1.0) + c_sigma
    c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n)  # HANSEN2016 (56)
    c_1 = ALPHA / ((n + 1.3) ** 2 + mu_eff)  # HANSEN2016 (57)
    c_mu = ALPHA * (mu_eff - 2.0 + 1.0 / mu_eff) / ((n + 2.0) ** 2 + ALPHA * mu_eff / 2.0)  # HANSEN2016 (58)
    c_mu = min(1.0 - c_1 - SLACK, c_mu)
    least = min(
        1.0 + c_1 / c_mu,  # HANSEN2016 (50)
        1.0 + 2.0 * mu_eff_minus / (mu_eff + 2.0),  # HANSEN2016 (51)
        (1.0 - c_1 - c_mu) / (n * c_mu),  # HANSEN2016 (52)
    )
    better, worse = raw[raw > 0.0].sum(), -raw[raw < 0.0].sum()
    weights = np.where(raw >= 0.0, raw / better, least * raw / worse)  # HANSEN2016 (53)
    chi = math.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n))  # HANSEN2016 (chi)
    return weights, Rates(mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi)


def default_population_size(dimensions: int) -> int:
    """Return lambda, how many proposals a generation in so many dimensions usually has."""
    return 4 + math.floor(3.0 * math.log(dimensions))  # HANSEN2016 (48)


def _worth(weights: Array) -> float:
    """Return how many equal weights select as these do: mu_eff."""
    return float(weights.sum() ** 2 / (weights**2).sum())  # HANSEN2016 (8)


LAG = 0.1  # of the decomposition, appendix B.2
LEAST = 1e-6  # ours: the shortest axis at first, in overall step sizes
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
        self._weights, rates = constants(d, population)
        self._rates = tuple(rates)
        self._every = max(1, math.floor(lag / (d * (rates.c_1 + rates.c_mu))))  # HANSEN2016 (B.2)
        self._recent, self._small = np.zeros(2 * (10 + math.ceil(30 * d / population))), SMALL * size
        self._axes, self._lengths, self._scaled = np.empty((d, d)), np.empty(d), np.empty((d, d))
        self._decompose()

    def sample(self, rng: np.random.Generator, count: int) -> Array:
        """Return so many draws (count, d)."""
        drawn = np.empty((count, len(self.mean)))
        sample(rng, self.mean, self.sigma, self._scaled, drawn)
        return drawn

    def learn(self, proposals: Array, costs: Array) -> None:
        """Adapt to a generation of proposals (n, d), drawn here or moved since, and their finite costs (n,)."""
        self.generation += 1
        population = writeable(proposals), writeable(costs)
        self.sigma = learn(*population, *self.settings, self.generation, self.sigma, self.state)

    def ended(self) -> bool:
        """Return whether the search has come to an end."""
        return bool(stagnant(self.generation, self.sigma, self.state, *self.ending))

    @property
    def settings(self) -> tuple[Array, tuple[float, ...], int]:
        """Weights (n,), rates, and how many generations old the decomposition becomes, as compiled loops take them."""
        return self._weights, self._rates, self._every

    @property
    def ending(self) -> tuple[float, float]:
        """Costs and proposals that differ by less end the search."""
        return FLAT, self._small

    @property
    def state(self) -> tuple[Array, ...]:
        """The arrays that `learn` changes, as the compiled loops take them."""
        axes = self.mean, self._axes, self._lengths
        return *axes, self.step_path, self.path, self.covariance, self._scaled, self._recent

    def _decompose(self) -> None:
        """Find the axes (d, d), in columns, and their lengths (d,): C = axes diag(lengths^2) axes'."""
        decompose(self.covariance, self._axes, self._lengths, self._scaled)
