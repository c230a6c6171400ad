"""What covariance matrix adaptation fixes before it begins: population, weights and learning rates."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array

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


@dataclass(frozen=True, eq=False)
class Constants:
    """The weights of a population, best first, and the rates that follow from them."""

    weights: Array  # (lambda,) the better half sums to 1, the worse half is negative
    rates: Rates

    @classmethod
    def of(cls, dimensions: int, population: int) -> "Constants":
        """Return the constants of a population (lambda, 4 or more) in so many dimensions (n)."""
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
        return cls(weights, Rates(mu_eff, c_sigma, d_sigma, c_c, c_1, c_mu, chi))


def usual_population(dimensions: int) -> int:
    """Return lambda, how many proposals a generation in so many dimensions usually has."""
    return 4 + math.floor(3.0 * math.log(dimensions))  # HANSEN2016 (48)


def _worth(weights: Array) -> float:
    """Return how many equal weights select as these do: mu_eff."""
    return float(weights.sum() ** 2 / (weights**2).sum())  # HANSEN2016 (8)
