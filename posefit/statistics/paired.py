"""Paired tests of which of several methods has the lower mean error.

Methods are compared on blocks. With errors (methods, instances, seeds) a block is an
instance with a seed, and the result holds for these instances. For a claim about other
instances of the same kind, each instance must be one block, because seeds of one
instance are not independent of each other: pass `errors.mean(axis=2, keepdims=True)`.
"""

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from posefit.arrays import Array
from posefit.statistics.pairing import finite

SIGNIFICANCE = 0.05
POWER = 0.8
_SHAPE = ("methods", "instances", "seeds")


@dataclass(frozen=True)
class PairedTest:
    """Two methods, compared by a paired t test.

    Attributes:
        first: The index of a method.
        second: The index of another.
        difference: The mean of first - second: below 0 if the first is better.
        low: The lower end of the difference's 95 % interval, adjusted like p. It is nan
            if there are too few blocks to show any difference.
        high: The upper end.
        p_value: The p-value of the test.
        adjusted: The p-value after Holm's correction for all comparisons.
        blocks_needed: How many blocks would show a difference of this size, inf if the
            difference is 0.
    """

    first: int
    second: int
    difference: float
    low: float
    high: float
    p_value: float
    adjusted: float
    blocks_needed: float

    @property
    def turned(self) -> "PairedTest":
        """The same test with the second method first."""
        return replace(
            self,
            first=self.second,
            second=self.first,
            difference=-self.difference,
            low=-self.high,
            high=-self.low,
        )


def paired_tests(errors: ArrayLike) -> list[PairedTest]:
    """Return two-sided paired t tests of all pairs of methods.

    The test compares means, so a lost run counts as much as its error. A test of ranks
    counts it as one run among many. For two methods with the same mean, one of which
    loses 15 % of its 24 runs, Wilcoxon's test calls one better in 29 % of simulated
    studies, and this test in 7 %.

    p is at least 2 / 2^n for n blocks, the lowest p that a test of signs can give. So
    fewer than 6 blocks show nothing, however similar their differences are. Holm's
    adjustment (1979) is over all pairs. Intervals are adjusted in the same way, so that
    an interval excludes 0 exactly if the adjusted p is below 0.05. `blocks_needed` is
    for a power of 80 % at Bonferroni's level, given the observed difference and spread.

    Args:
        errors: Finite numbers (methods, instances, seeds), of at least two methods and
            two blocks.

    Returns:
        A test for each pair of methods, in the order of `itertools.combinations`.

    Raises:
        ValueError: Errors are not finite or have another shape.

    Example:
        >>> from posefit import paired_tests
        >>> first = [[1.0], [2.0], [3.0]]  # 3 instances, one seed
        >>> second = [[2.0], [3.5], [3.5]]
        >>> (pair,) = paired_tests([first, second])
        >>> pair.difference, round(pair.p_value, 2)
        (-1.0, 0.25)
    """
    array = finite("errors", errors, _SHAPE, (2, 1, 1))
    runs = array.reshape(len(array), -1)  # (methods, blocks)
    blocks = runs.shape[1]
    pairs = list(combinations(range(len(runs)), 2))
    differences = np.array([runs[first] - runs[second] for first, second in pairs])
    means = differences.mean(axis=1)
    least_p = min(1.0, 2.0 ** (1 - blocks))
    if blocks < 2:
        spreads = np.full(len(pairs), np.nan)
        p_values = np.ones(len(pairs))
    else:
        spreads = differences.std(axis=1, ddof=1)
        # rounding gives equal differences a small spread
        scale = np.abs(runs).max(initial=0.0)
        spreads[spreads < 1e-12 * scale] = 0.0
        p_values = np.maximum(_p_values(means, spreads, blocks), least_p)
    accumulated = _accumulated(p_values)
    adjusted = np.minimum(1.0, accumulated)
    # no interval where so few blocks cannot show any difference
    reach = np.full(len(pairs), np.nan)
    if least_p * len(pairs) < SIGNIFICANCE:
        # Holm's method judges each difference at a different level, stricter than 5 %
        levels = SIGNIFICANCE * p_values / accumulated
        t = stats.t.ppf(1.0 - levels / 2.0, blocks - 1)
        reach = t * spreads / math.sqrt(blocks)
    needed = _blocks_needed(means, spreads)
    table = zip(
        pairs,
        means.tolist(),
        (means - reach).tolist(),
        (means + reach).tolist(),
        p_values.tolist(),
        adjusted.tolist(),
        needed.tolist(),
        strict=True,
    )
    return [PairedTest(*pair, *numbers) for pair, *numbers in table]


def _p_values(means: Array, spreads: Array, blocks: int) -> Array:
    """Return the p-values (pairs,) of paired t tests.

    Without spread a p-value is 0, or 1 if the mean difference is 0 as well.
    """
    # pairs without spread divide by 0, and get their p in the last line
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.abs(means) * math.sqrt(blocks) / spreads
    p = 2.0 * stats.t.sf(t, blocks - 1)
    return np.where(spreads > 0.0, p, np.where(np.abs(means) > 0.0, 0.0, 1.0))


def _blocks_needed(means: Array, spreads: Array) -> Array:
    """Return how many blocks would show each difference (pairs,)."""
    # Bonferroni's level, which Holm's method has for the lowest p
    level = SIGNIFICANCE / len(means)
    reach = stats.norm.ppf(1.0 - level / 2.0) + stats.norm.ppf(POWER)
    with np.errstate(divide="ignore", invalid="ignore"):
        by_spread = np.ceil((reach * spreads / means) ** 2)
    fewest = fewest_blocks(len(means))
    return np.where(means == 0.0, np.inf, np.maximum(by_spread, fewest))


def fewest_blocks(comparisons: int) -> int:
    """Return the fewest blocks that can show a difference among some comparisons.

    The lowest p of n blocks, 2 / 2^n, must be below Bonferroni's level.

    Example:
        >>> fewest_blocks(1)
        6
    """
    return math.ceil(1.0 - math.log2(SIGNIFICANCE / comparisons))


def holm(p_values: ArrayLike) -> Array:
    """Return p-values (m,) adjusted for m tests at one level. Holm, 1979."""
    return np.minimum(1.0, _accumulated(np.asarray(p_values, dtype=np.float64)))


def _accumulated(p_values: Array) -> Array:
    """Return Holm's products (m,) of p-values and remaining tests, not cut at 1."""
    order = np.argsort(p_values, kind="stable")
    factors = np.arange(len(p_values), 0, -1)
    products = np.empty_like(p_values)
    # an adjusted p-value is never below that of a clearer difference
    products[order] = np.maximum.accumulate(p_values[order] * factors)
    return products
