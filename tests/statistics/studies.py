"""Simulated studies whose truth is known: instances, some harder than others, some noisier.

    python -m tests.statistics.studies

prints how often the 95 % intervals of a report hold the truth.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from posefit.report.contest import MIN_LOST
from posefit.statistics.means import Intervals, run_means

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


def holds(means: Intervals, true: float) -> NDArray[np.bool_]:
    """Return which intervals hold the truth."""
    return (means.low <= true) & (true <= means.high)


def coverage(draw: Draw, mean: float, shape: tuple[int, int], count: int) -> float:
    """Return the share of studies whose interval holds the truth."""
    runs = studies(draw, shape, count, np.random.default_rng(12))
    return float(holds(run_means(runs), truth(mean, shape[0])).mean())


def shown_coverage(lost_share: float, shape: tuple[int, int], count: int) -> float:
    """Return the share that hold the truth of the intervals that a report shows, where a share of runs is lost.

    For a method that lost none the truth is the mean of runs that are not lost.
    """
    rng = np.random.default_rng(13)
    lost = rng.random((count, *shape)) < lost_share
    noise = np.resize(NOISE, shape[0])[:, None]
    runs = studies(_gamma, shape, count, rng) + noise * LOSS * lost
    means = run_means(runs)
    counts = lost.sum(axis=(1, 2))
    true = holds(means, truth(1.0 + LOSS * lost_share, shape[0]))
    if_never_lost = holds(means, truth(1.0, shape[0]))
    inside = np.where(counts == 0, if_never_lost, true)
    return float(inside[(counts == 0) | (counts >= MIN_LOST)].mean())


def main() -> None:
    """Print a table of the shares, in percent."""
    count = 10_000
    for shape in SHAPES:
        shares = [coverage(draw, mean, shape, count) for draw, mean in DRAWS.values()]
        shares += [shown_coverage(lost, shape, count) for lost in (0.15, 0.05)]
        cells = " | ".join(f"{100 * share:.1f}" for share in shares)
        print(f"| {shape[0]} x {shape[1]} | {cells} |")


if __name__ == "__main__":
    main()
