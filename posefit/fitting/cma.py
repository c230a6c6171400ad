"""CMA-ES, the evolution strategy with covariance matrix adaptation, with restarts.

It searches a box with a constraint. N. Hansen, The CMA Evolution Strategy: A Tutorial,
arXiv:1604.00772, 2016. A. Auger, N. Hansen, A restart CMA evolution strategy with
increasing population size, CEC 2005. Details that the tutorial leaves open follow the
library cmaes.
"""

import math
from collections import deque
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space, displacement, draw_population, repair, wrap
from posefit.fitting.check import at_least, positive
from posefit.fitting.optimiser import check_tell, finite_costs
from posefit.fitting.weights import effective_sample_size
from posefit.reading import cut

ALPHA_COV = 2.0
LAG = 0.1  # lag of the decomposition, appendix B.2
GROWTH = 2  # IPOP: factor on the population of a restart
SURPLUS = 1.25  # ours: draws over the number needed
MIN_SHARE = 0.25  # ours: the least share of feasible draws that is assumed
CHECKED = 10  # ours: generations between checks of whether a search has ended
# Values of cmaes. TolX is in first step sizes.
TOL_FUN = 1e-12
TOL_X = 1e-12
TOL_X_UP = 1e4
# Longest axis over the shortest, as in cmaes. The tutorial means their squares.
CONDITION = 1e14
# Ours, as in cmaes. It replaces eigenvalues that rounding makes negative, and keeps
# divisors from 0.
SMALL = 1e-8


class Rates(NamedTuple):
    """The learning rates of mean, step size and covariance: the tutorial's Table 1."""

    mu_eff: float  # effective number of selected steps
    c_sigma: float  # rate of the step size's path
    d_sigma: float  # damping of the step size
    c_c: float  # rate of the covariance's path
    c_1: float  # rate of the covariance, from its path
    c_mu: float  # rate of the covariance, from the population
    chi: float  # the mean length of a standard normal vector


def default_population_size(dimensions: int) -> int:
    """Return lambda, the usual number of proposals per generation."""
    return 4 + math.floor(3.0 * math.log(dimensions))  # HANSEN2016 (48)


def constants(dimensions: int, population: int) -> tuple[Array, Rates]:
    """Return the weights (lambda,) of a population, best first, and their rates.

    The population must be 4 or more.
    """
    n = dimensions
    mu = population // 2
    # HANSEN2016 (49)
    raw = math.log((population + 1) / 2) - np.log(np.arange(1, population + 1))
    # HANSEN2016 (8)
    mu_eff = effective_sample_size(raw[:mu])
    mu_eff_minus = effective_sample_size(raw[mu:])
    c_sigma = (mu_eff + 2.0) / (n + mu_eff + 5.0)  # HANSEN2016 (55)
    d_sigma = (
        1.0 + 2.0 * max(0.0, math.sqrt((mu_eff - 1.0) / (n + 1.0)) - 1.0) + c_sigma
    )
    c_c = (4.0 + mu_eff / n) / (n + 4.0 + 2.0 * mu_eff / n)  # HANSEN2016 (56)
    c_1 = ALPHA_COV / ((n + 1.3) ** 2 + mu_eff)  # HANSEN2016 (57)
    # HANSEN2016 (58)
    c_mu = (
        ALPHA_COV
        * (mu_eff - 2.0 + 1.0 / mu_eff)
        / ((n + 2.0) ** 2 + ALPHA_COV * mu_eff / 2.0)
    )
    c_mu = min(1.0 - c_1 - SMALL, c_mu)
    negative = min(
        1.0 + c_1 / c_mu,  # HANSEN2016 (50)
        1.0 + 2.0 * mu_eff_minus / (mu_eff + 2.0),  # HANSEN2016 (51)
        (1.0 - c_1 - c_mu) / (n * c_mu),  # HANSEN2016 (52)
    )
    better = raw[raw > 0.0].sum()
    worse = -raw[raw < 0.0].sum()
    # HANSEN2016 (53)
    weights = np.where(raw >= 0.0, raw / better, negative * raw / worse)
    # HANSEN2016 (chi)
    chi = math.sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n))
    return weights, Rates(mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi)


class Strategy:
    """A normal distribution N(m, sigma^2 C) that moves towards the least costs.

    `mean` (d,), `sigma` and `covariance` (d, d) are m, sigma and C. `step_path` and
    `path` (d,) are the evolution paths p_sigma and p_c. `axes` (d, d) and `lengths`
    (d,) are B and D, with C = B D^2 B' at the last decomposition.
    """

    def __init__(self, mean: Array, spread: Array, population: int) -> None:
        """Start around a mean.

        Args:
            mean: (d,) the mean of the first generation.
            spread: (d,) its standard deviations.
            population: The number of proposals in a generation.
        """
        d = len(mean)
        self.mean = np.array(mean, dtype=np.float64)
        self.sigma = math.sqrt(float((spread**2).mean()))
        # the least deviation is ours
        self.covariance = np.diag(np.maximum(spread / self.sigma, 1e-6) ** 2)
        self.step_path = np.zeros(d)
        self.path = np.zeros(d)
        self.generation = 0
        self.weights, self.rates = constants(d, population)
        self.total = float(self.weights.sum())
        # HANSEN2016 (B.2)
        self.every = max(1, math.floor(LAG / (d * (self.rates.c_1 + self.rates.c_mu))))
        self.tol_x = TOL_X * self.sigma
        self.recent = deque[Array](maxlen=10 + math.ceil(30 * d / population))
        self.decompose()

    def decompose(self) -> None:
        """Compute B and D from C, and B D and C^(-1/2) from them."""
        self.covariance = 0.5 * (self.covariance + self.covariance.T)
        squares, self.axes = np.linalg.eigh(self.covariance)
        if squares[0] < 0.0:
            squares = np.where(squares < 0.0, SMALL, squares)
            self.covariance = self.axes * squares @ self.axes.T
        self.lengths = np.sqrt(squares)
        self.scaled = self.axes * self.lengths
        self.whitening = self.axes / self.lengths @ self.axes.T

    def sample(self, rng: np.random.Generator, count: int) -> Array:
        """Return draws (count, d)."""
        z = rng.standard_normal((count, len(self.mean)))  # HANSEN2016 (38)
        y = z @ self.scaled.T  # HANSEN2016 (39)
        return np.asarray(self.mean + self.sigma * y)  # HANSEN2016 (40)

    def learn(self, proposals: Array, costs: Array) -> None:
        """Adapt to a generation of proposals (n, d) with finite costs (n,).

        The proposals were drawn here, and may have been moved since.
        """
        weights = self.weights
        mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi = self.rates
        d = len(self.mean)
        mu = len(costs) // 2
        order = costs.argsort(kind="stable")
        self.recent.append(costs[order[[0, -1]]])
        self.generation += 1
        y = (proposals[order] - self.mean) / self.sigma
        step = weights[:mu] @ y[:mu]  # HANSEN2016 (41)
        self.mean += self.sigma * step  # HANSEN2016 (42)
        white = math.sqrt(c_sigma * (2.0 - c_sigma) * mu_eff) * (self.whitening @ step)
        self.step_path = (1.0 - c_sigma) * self.step_path + white  # HANSEN2016 (43)
        length = math.sqrt(self.step_path @ self.step_path)
        # HANSEN2016 (44)
        self.sigma *= math.exp(c_sigma / d_sigma * (length / chi - 1.0))
        usual = (
            math.sqrt(1.0 - (1.0 - c_sigma) ** (2.0 * (self.generation + 1.0))) * chi
        )
        # HANSEN2016 (h_sigma)
        if length < (1.4 + 2.0 / (d + 1.0)) * usual:
            h_sigma = 1.0
        else:
            h_sigma = 0.0
        fresh = h_sigma * math.sqrt(c_c * (2.0 - c_c) * mu_eff) * step
        self.path = (1.0 - c_c) * self.path + fresh  # HANSEN2016 (45)
        white = y[mu:] @ self.whitening
        signed = weights.copy()
        # HANSEN2016 (46)
        signed[mu:] *= d / (np.einsum("ij,ij->i", white, white) + SMALL)
        retained = (
            1.0 + c_1 * (1.0 - h_sigma) * c_c * (2.0 - c_c) - c_1 - c_mu * self.total
        )
        rank_one = self.path[:, None] * self.path
        rank_mu = y.T * signed @ y
        # HANSEN2016 (47)
        self.covariance = retained * self.covariance + c_1 * rank_one + c_mu * rank_mu
        if self.generation % self.every == 0:
            self.decompose()

    def ended(self) -> bool:
        """Return whether the search has ended: nothing changes, or it diverges."""
        variances = self.covariance.diagonal()
        axis = self.scaled[:, self.generation % len(self.mean)]
        return bool(  # HANSEN2016 (B.3)
            (self.generation > len(self.recent) and np.ptp(self.recent) < TOL_FUN)
            or self.sigma * max(variances.max(), self.path.max()) < self.tol_x
            or (self.mean == self.mean + 0.2 * self.sigma * np.sqrt(variances)).any()
            or (self.mean == self.mean + 0.1 * self.sigma * axis).all()
            or self.sigma * self.lengths[-1] > TOL_X_UP
            or self.lengths[-1] > CONDITION * self.lengths[0]
        )


class CMAES:
    """Covariance matrix adaptation, from the prediction or anywhere.

    It starts around the prediction with its spread, or anywhere with `spread`. It
    learns from the better half of a population and against the worse half (active CMA).
    When it stagnates, it starts again from a fresh draw with twice the population
    (IPOP).

    More points are drawn than needed, so that enough of them are feasible. If there are
    too few, others are moved towards the best of the last generation until they are
    feasible. A point drawn outside the box is evaluated where it was moved to, but
    learned where it was drawn, and ranked below all points inside: its cost counts only
    towards the best proposal.

    Settings:
        population_size (lambda): Size of a population, 5 or more, or 0 for 4 + 3 ln d,
            at least 5. Hansen 2016.
        spread (sigma): The initial step size without a prediction, in half-ranges of
            the box, above 0. Ours.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 0,
        spread: float = 0.5,
    ) -> None:
        if population_size != 0:
            at_least("population_size", population_size, 5)
        positive("spread", spread)
        self.space = space
        self.rng = rng
        self.waiting = 0
        self.population_size = population_size or max(
            default_population_size(space.dimensions), 5
        )
        self.anywhere = np.full(space.dimensions, spread)
        self._start(self.anywhere if space.start is None else space.start.spread)

    def _start(self, spread: Array) -> None:
        """Start around a feasible prediction, or around a fresh draw."""
        if not (np.isfinite(spread).all() and (spread >= 0.0).all() and spread.any()):
            raise InputError(
                "spread must be 0 or more in each coordinate, and above 0 in one,"
                f" got {cut(str(spread))}"
            )
        start = self.space.start
        self.home = draw_population(self.space, self.rng, 1)[0]
        if start is not None and self.space.feasible(start.mean[None])[0]:
            self.home = start.mean
        self.strategy = Strategy(self.home, spread, self.population_size)
        self.share = MIN_SHARE
        self.asked = self._drawn()

    def _drawn(self) -> Array:
        """Return the next population (n, d), and keep the points that are learned."""
        n = self.population_size
        count = math.ceil(SURPLUS * n / self.share)
        drawn = wrap(self.space, self.strategy.sample(self.rng, count))
        feasible = self.space.feasible(drawn)
        self.share = max(np.count_nonzero(feasible) / len(drawn), MIN_SHARE)
        population = drawn[feasible][:n]
        moved = drawn[~feasible][: n - len(population)]
        self.learned = population
        self.beyond = np.zeros(n)
        if not len(moved):
            return population
        repaired = repair(self.space, moved, self.home)
        # A point moved to a side of the box was not drawn there. If many of them were
        # learned as if they were, they would widen the distribution across the box, and
        # nothing would narrow it.
        beyond = np.linalg.norm(moved - np.clip(moved, -1.0, 1.0), axis=1)
        self.beyond[len(population) :] = beyond
        learned = np.where(beyond[:, None] > 0.0, moved, repaired)
        self.learned = np.concatenate([population, learned])
        return np.concatenate([population, repaired])

    def ask(self) -> Array:
        """Return the next population (n, d)."""
        self.waiting = len(self.asked)
        return self.asked.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Adapt mean, step size and covariance, and restart if the search has ended."""
        check_tell(self.waiting, proposals, costs)
        self.waiting = 0
        known = finite_costs(costs)
        mean = self.strategy.mean
        self.home = self.asked[known.argmin()]
        # draws outside the box cost more than all inside, and more the farther they are
        # HANSEN2016 (B.5)
        ranked = np.where(self.beyond > 0.0, known.max() + self.beyond, known)
        learned = self.learned
        # the mean of a periodic coordinate is never wrapped: learned points must be
        # near it
        if self.space.periodic.any():
            learned = mean + displacement(self.space, mean, learned)
        self.strategy.learn(learned, ranked)
        if self.strategy.generation % CHECKED == 0 and self.strategy.ended():
            self.population_size *= GROWTH  # AUGER2005 (restart)
            self._start(self.anywhere)
        else:
            self.asked = self._drawn()
