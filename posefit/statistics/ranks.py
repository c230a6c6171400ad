"""Which of several methods is better, judged by the order of paired errors alone.

A block is what methods are ranked on. With errors (methods, instances, seeds) it is an instance with a seed, and a
result holds for these instances. For a claim about instances like these, make each instance one block: give
`errors.mean(axis=2, keepdims=True)`, for seeds of one instance are not independent of each other.
"""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from posefit.arrays import Array
from posefit.statistics.pairing import finite

LEVEL = 0.05  # of significance
# blocks, for which scipy has exact p-values with ties, too, and goes through all signs
# one by one
MAX_EXACT_TIES = 13
_SHAPE = ("methods", "instances", "seeds")


@dataclass(frozen=True)
class PairedTest:
    """Two methods by Wilcoxon's signed ranks."""

    first: int
    second: int
    difference: float  # median of first - second, below 0 where the first is better
    low: float  # of the median's 95 % interval, nan for fewer than 6 blocks
    high: float
    p_value: float
    adjusted: float  # Holm's, for all comparisons made together


def wilcoxon(errors: ArrayLike) -> list[PairedTest]:
    """Return two-sided paired comparisons of all pairs of methods; errors (methods, instances, seeds).

    Blocks in which both are equal are ranked but count for neither (Pratt, 1959). The p-value is exact for up to 50
    blocks without ties and up to 13 with ties, as in scipy. Holm's adjustment is over all pairs: Holm, 1979.
    The ends of a median's interval are order statistics, by the sign test: Conover, Practical nonparametric
    statistics, 1999, 3.2.
    """
    array = finite("errors", errors, _SHAPE, (2, 1, 1))
    pairs = list(combinations(range(len(array)), 2))
    differences = [(array[first] - array[second]).ravel() for first, second in pairs]
    p_values = [_signed_rank(values) for values in differences]
    return [
        PairedTest(
            *pair,
            float(np.median(values)),
            *_median_interval(values),
            p_value,
            adjusted,
        )
        for pair, values, p_value, adjusted in zip(
            pairs, differences, p_values, holm(p_values).tolist(), strict=True
        )
    ]


def _median_interval(values: Array) -> tuple[float, float]:
    # values below, and as many above
    outside = int(stats.binom.ppf(LEVEL / 2.0, len(values), 0.5))
    ends = (
        np.sort(values)[[outside - 1, len(values) - outside]]
        if outside
        else (math.nan, math.nan)
    )
    return float(ends[0]), float(ends[1])


def _signed_rank(differences: Array) -> float:
    if not differences.any():
        return 1.0
    if len(differences) > MAX_EXACT_TIES:
        return float(stats.wilcoxon(differences, zero_method="pratt").pvalue)
    # whole numbers, though ties share one
    ranks = np.rint(2.0 * stats.rankdata(np.abs(differences))).astype(np.int64)
    positive = int(ranks[differences > 0.0].sum())
    counts = np.ones(1)  # of signs whose positive ranks have the sum 0, 1, 2, ...
    for rank in ranks[differences != 0.0]:
        counts = np.pad(counts, (0, rank)) + np.pad(counts, (rank, 0))
    tail = min(counts[: positive + 1].sum(), counts[positive:].sum())
    return float(min(1.0, 2.0 * tail / counts.sum()))


def holm(p_values: ArrayLike) -> Array:
    """Return p-values (m,) adjusted so that all m may be judged at one level. Holm, 1979."""
    p = np.asarray(p_values, dtype=np.float64)
    order = np.argsort(p, kind="stable")
    factors = np.arange(len(p), 0, -1)
    adjusted = np.empty_like(p)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(p[order] * factors))
    return adjusted
