"""Simulated studies whose truth is known: 12 instances, some harder than others, some noisier."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy import stats

Array = NDArray[np.float64]

INSTANCES = 12
HARDNESS = np.linspace(2.0, 6.0, INSTANCES)
NOISE = np.array([0.8, 1.3, 0.5, 1.0, 1.5, 0.7, 1.2, 0.6, 1.4, 0.9, 1.1, 0.75])
LOST = 0.15  # share of runs that lose the person, and are worse by 4

DRAWS: dict[str, Callable[[np.random.Generator, tuple[int, ...]], Array]] = {
    "normal": lambda rng, shape: rng.normal(size=shape),
    "skewed": lambda rng, shape: rng.lognormal(0.0, 1.0, size=shape),
    "heavy-tailed": lambda rng, shape: rng.standard_t(3, size=shape),
    "with lost runs": lambda rng, shape: (
        rng.gamma(4.0, 0.25, size=shape) + 4.0 * (rng.random(shape) < LOST)
    ),
}
_EVEN = (np.arange(20000) + 0.5) / 20000
_GAMMA = stats.gamma.ppf(_EVEN, 4.0, scale=0.25)
QUANTILES = {
    "normal": stats.norm.ppf(_EVEN),
    "skewed": stats.lognorm.ppf(_EVEN, 1.0),
    "heavy-tailed": stats.t.ppf(_EVEN, 3),
    "with lost runs": np.concatenate(
        [np.repeat(_GAMMA, 17), np.repeat(_GAMMA + 4.0, 3)]
    ),
}


def truth(kind: str) -> float:
    """Return the interquartile mean of all runs that there could be, from even quantiles of each instance."""
    runs = np.sort((HARDNESS + np.multiply.outer(QUANTILES[kind], NOISE)).ravel())
    return float(runs[len(runs) // 4 : -(len(runs) // 4)].mean())


def studies(
    kind: str, seeds: int, count: int, rng: np.random.Generator
) -> Iterator[Array]:
    """Yield the runs (1, 12, seeds) of one method in each of some studies."""
    for _ in range(count):
        yield (
            HARDNESS[:, None] + NOISE[:, None] * DRAWS[kind](rng, (INSTANCES, seeds))
        )[None]
