"""The mean of many runs with its interval, where some of them have a draw in common and others are of another kind."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from posefit.errors import InputError
from posefit.statistics.intervals import LEVEL
from posefit.statistics.pairing import finite


@dataclass(frozen=True)
class Mean:
    """A mean and the ends of its interval, nan where it is unknown."""

    value: float
    low: float
    high: float


def mean_interval(values: ArrayLike, strata: ArrayLike, clusters: ArrayLike, *, level: float = LEVEL) -> Mean:
    """Return the mean of values (n,) with the interval that other clusters of the same strata would give.

    Each value belongs to a stratum (n,), such as a kind of problem, and in it to a cluster (n,), such as an instance
    that was drawn: values of one cluster need not be independent of each other, clusters are. The variance is that of
    a stratified sample of clusters, by linearisation (Cochran, Sampling techniques, 1977, 5.9 and 11.8), the interval
    Student's with Satterthwaite's degrees of freedom (1946). A stratum with one cluster gives no interval:
    low and high are nan. Raises ValueError where values are not finite or the three are not equally long.
    """
    array = finite("values", values, ("n",))
    kinds, drawn = np.asarray(strata), np.asarray(clusters)
    if kinds.shape != array.shape or drawn.shape != array.shape:
        raise InputError(f"strata and clusters must have shape {array.shape}, got {kinds.shape} and {drawn.shape}")
    value = float(array.mean())
    variances, freedoms = [], []
    for kind in np.unique(kinds):
        mine = kinds == kind
        _, cluster = np.unique(drawn[mine], return_inverse=True)
        totals = np.bincount(cluster, array[mine] - array[mine].mean())
        count = len(totals)
        if count < 2:
            return Mean(value, np.nan, np.nan)
        variances.append(count / (count - 1.0) * float((totals**2).sum()) / len(array) ** 2)
        freedoms.append(count - 1.0)
    variance = sum(variances)
    if variance == 0.0:
        return Mean(value, value, value)
    freedom = variance**2 / sum(one**2 / free for one, free in zip(variances, freedoms, strict=True))
    reach = float(stats.t.ppf(0.5 + level / 2.0, freedom)) * variance**0.5
    return Mean(value, value - reach, value + reach)
