"""Ways to move a population that are not a swarm's: by differences, and by a normal distribution."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import Space, displacement, fold, repair

GREEDY = 0.1  # p: the share of the bests that pull, JADE
CROSSED = 0.9  # CR: the share of coordinates that move
MIDDLE = 0.6  # the stride at which a normal distribution is drawn from as it is
ELITE = 0.5  # the share of the bests that it describes


def differential(
    space: Space, rng: np.random.Generator, mine: Array, bests: Array, order: NDArray[np.int64], weight: float
) -> Array:
    """Return feasible trials (k, d) for points (k, d) among n bests (n, d): current to p-best, binomial crossover.

    `order` ranks the bests (n,), the cheapest first; differences count by `weight`. J. Zhang, A. C. Sanderson, JADE:
    adaptive differential evolution with optional external archive, IEEE Trans. Evolutionary Computation 13(5), 2009,
    equation (7), without its archive and with one weight for all.
    """
    k, (n, d) = len(mine), bests.shape
    leading = bests[order[rng.integers(max(1, round(GREEDY * n)), size=k)]]
    one, other = rng.integers(n, size=(2, k))
    step = displacement(space, mine, leading) + displacement(space, bests[other], bests[one])
    crossed = rng.random((k, d)) < CROSSED
    crossed[np.arange(k), rng.integers(d, size=k)] = True
    return repair(space, fold(space, mine + np.where(crossed, weight * step, 0.0)), bests[order[0]])


def normal(
    space: Space, rng: np.random.Generator, bests: Array, order: NDArray[np.int64], count: int, stride: float
) -> Array:
    """Return feasible draws (count, d) from the normal distribution of the cheaper half of n bests (n, d).

    `order` ranks the bests (n,), the cheapest first. The distribution has their mean and covariance, and is wider by
    `stride` / 0.6: one generation of an estimation of multivariate normal algorithm.
    """
    elite = bests[order[: max(2, round(ELITE * len(order)))]]
    ways = displacement(space, elite[0], elite)
    middle = ways.mean(axis=0)
    steps = rng.standard_normal((count, len(elite))) @ (ways - middle) / np.sqrt(len(elite))
    return repair(space, fold(space, elite[0] + middle + stride / MIDDLE * steps), bests[order[0]])
