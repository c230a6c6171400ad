"""The mean of many runs with its interval, where some of them have a draw in common and others are of another kind."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from posefit.errors import InputError
from posefit.statistics.intervals import LEVEL, Intervals
from posefit.statistics.pairing import finite


@dataclass(frozen=True)
class Mean:
    """A mean and the ends of its interval, nan where it is unknown."""

    value: float
    low: float
    high: float


def mean_interval(
    values: ArrayLike, strata: ArrayLike, clusters: ArrayLike, *, level: float = LEVEL
) -> Mean:
    """Return the mean of values (n,) with the interval that other clusters of the same strata would give.

    See `mean_intervals`, which does the same for several rows of values.
    """
    means = mean_intervals(
        finite("values", values, ("n",))[None], strata, clusters, level=level
    )
    return Mean(float(means.values[0]), float(means.low[0]), float(means.high[0]))


def mean_intervals(
    values: ArrayLike, strata: ArrayLike, clusters: ArrayLike, *, level: float = LEVEL
) -> Intervals:
    """Return the means (rows,) of values (rows, n) with the intervals that other clusters of the strata would give.

    Each value belongs to a stratum (n,), such as a kind of problem, and in it to a cluster (n,), such as an instance
    that was drawn: values of one cluster need not be independent of each other, clusters are. The variance is that of
    a stratified sample of clusters, by linearisation (Cochran, Sampling techniques, 1977, 5.9 and 11.8), the interval
    Student's with Satterthwaite's degrees of freedom (1946). A stratum with one cluster gives no interval:
    low and high are nan. Raises ValueError where values are not finite or the three are not equally long.
    """
    array = finite("values", values, ("rows", "n"))
    rows, count = array.shape
    kinds = np.asarray(strata)
    drawn = np.asarray(clusters)
    if kinds.shape != (count,) or drawn.shape != (count,):
        raise InputError(
            f"strata and clusters must have shape {(count,)}, got {kinds.shape} and {drawn.shape}"
        )
    means = array.mean(axis=1)
    variance = np.zeros(rows)
    weighed = np.zeros(rows)
    for kind in np.unique(kinds):
        of_kind = array[:, kinds == kind]
        names, cluster = np.unique(drawn[kinds == kind], return_inverse=True)
        if (number := len(names)) < 2:
            return Intervals(means, np.full(rows, np.nan), np.full(rows, np.nan))
        totals = np.zeros((number, rows))
        np.add.at(totals, cluster, (of_kind - of_kind.mean(axis=1, keepdims=True)).T)
        part = number / (number - 1.0) * (totals**2).sum(axis=0) / count**2
        variance += part
        weighed += part**2 / (number - 1.0)
    freedom = np.divide(variance**2, weighed, out=np.ones(rows), where=weighed > 0.0)
    reach = stats.t.ppf(0.5 + level / 2.0, freedom) * np.sqrt(variance)
    return Intervals(means, means - reach, means + reach)
