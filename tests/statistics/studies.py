"""Simulated studies whose truth is known: instances, some harder than others, some noisier."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]
Draw = Callable[[np.random.Generator, tuple[int, ...]], Array]

NOISE = np.array([0.8, 1.3, 0.5, 1.0, 1.5, 0.7, 1.2, 0.6, 1.4, 0.9, 1.1, 0.75])
LOSS = 4.0  # how much worse a lost run is
SHAPES = ((12, 5), (8, 3), (4, 10))  # instances and seeds


def _gamma(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return rng.gamma(4.0, 0.25, size=shape)


def with_lost_runs(share: float) -> Draw:
    """Return draws of which a share are lost."""

    def draw(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
        return _gamma(rng, shape) + LOSS * (rng.random(shape) < share)

    return draw


def _ties(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    return np.rint(2.0 * _gamma(rng, shape)) / 2.0


# the probability of each multiple of a half that a tied error may have
_HALVES = np.arange(0.0, 20.0, 0.5)
_TIED = stats.gamma.cdf(_HALVES + 0.25, 4.0, scale=0.25)
_TIED -= stats.gamma.cdf(_HALVES - 0.25, 4.0, scale=0.25)

# draws, and their mean
DRAWS: dict[str, tuple[Draw, float]] = {
    "normal": (lambda rng, shape: rng.normal(size=shape), 0.0),
    "skewed": (_gamma, 1.0),
    "heavy-tailed": (lambda rng, shape: rng.standard_t(3, size=shape), 0.0),
    "30 % lost": (with_lost_runs(0.3), 1.0 + 0.3 * LOSS),
    "ties": (_ties, float(_HALVES @ _TIED)),
    "two values": (lambda rng, shape: 1.0 * (rng.random(shape) < 0.5), 0.5),
}


def studies(
    draw: Draw, shape: tuple[int, int], count: int, rng: np.random.Generator
) -> Array:
    """Return the runs (count, instances, seeds) of a method in each of some studies."""
    instances, seeds = shape
    hardness = np.linspace(2.0, 6.0, instances)[:, None]
    noise = np.resize(NOISE, instances)[:, None]
    return hardness + noise * draw(rng, (count, instances, seeds))


def truth(mean: float, instances: int) -> float:
    """Return the mean of all runs that there could be, of draws with a mean."""
    hardness = np.linspace(2.0, 6.0, instances)
    return float((hardness + np.resize(NOISE, instances) * mean).mean())
