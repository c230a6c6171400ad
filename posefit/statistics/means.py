"""The mean of many runs with its interval, for runs of several kinds of which some have a draw in common."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.statistics.pairing import finite

CONFIDENCE = 0.95
MIN_RUNS = 8  # of a method; the spread of fewer is too uncertain for an interval


@dataclass(frozen=True)
class Mean:
    """A mean and the ends of its interval, nan where it is unknown."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, eq=False)
class Intervals:
    """Values with the ends of their intervals, each (rows,)."""

    values: Array
    low: Array
    high: Array


def run_means(errors: ArrayLike) -> Intervals:
    """Return the mean error of each method with its 95 % interval.

    The interval is for other seeds on the same instances. It holds the true mean in 93 to 97 % of simulated studies
    of 12 instances with 5 seeds, 8 with 3 and 4 with 10: whether errors are normal, skewed like a gamma distribution
    or have ties, and where 30 % of the runs are lost. Two cases are worse. Where one run in twenty is lost, the few
    lost runs of a study say little about how many there are, and it holds the truth in 86 to 92 %. Where errors are
    log-normal with a standard deviation of 1 it is 88 to 91 %.

    Args:
        errors: Finite numbers (methods, instances, seeds).

    Returns:
        The means with their intervals, each (methods,). With one seed, or fewer than 8 runs of a method, `low` and
        `high` are nan.

    Raises:
        ValueError: If errors are not finite or have another shape.

    >>> run_means([[[1.0, 3.0], [5.0, 7.0], [2.0, 2.0], [4.0, 8.0]]]).values.tolist()
    [4.0]

    """
    array = finite("errors", errors, ("methods", "instances", "seeds"))
    methods, instances, seeds = array.shape
    strata = np.repeat(np.arange(instances), seeds)
    runs = array.reshape(methods, -1)
    return block_means(runs, strata)


def block_means(runs: ArrayLike, instances: ArrayLike) -> Intervals:
    """Return the means of runs (methods, n), of which each belongs to an instance (n,): see `run_means`."""
    array = np.asarray(runs)
    count = array.shape[1]
    means = mean_intervals(array, instances, np.arange(count))
    if count >= MIN_RUNS:
        return means
    unknown = np.full(len(array), np.nan)
    return Intervals(means.values, unknown, unknown)


def mean_interval(
    values: ArrayLike,
    strata: ArrayLike,
    clusters: ArrayLike,
    *,
    level: float = CONFIDENCE,
) -> Mean:
    """Return the mean of values (n,) with the interval that other clusters of the same strata would give.

    See `mean_intervals`, which does the same for several rows of values.
    """
    means = mean_intervals(
        finite("values", values, ("n",))[None], strata, clusters, level=level
    )
    return Mean(float(means.values[0]), float(means.low[0]), float(means.high[0]))


def mean_intervals(
    values: ArrayLike,
    strata: ArrayLike,
    clusters: ArrayLike,
    *,
    level: float = CONFIDENCE,
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
    names, stratum_index = np.unique(kinds, return_inverse=True)
    stratum = stratum_index.astype(np.int64)
    drawn_names, number = np.unique(drawn, return_inverse=True)
    pairs, cluster = np.unique(stratum * len(drawn_names) + number, return_inverse=True)
    stratum_of_cluster = pairs // len(drawn_names)
    cluster_counts = np.bincount(stratum_of_cluster)
    if cluster_counts.min() < 2:
        unknown = np.full(rows, np.nan)
        return Intervals(means, unknown, unknown)

    def sums(numbers: Array, group: NDArray[np.int64], groups: int) -> Array:
        """Return the sums (groups, k) of numbers (n, k)."""
        total = np.zeros((groups, numbers.shape[1]))
        np.add.at(total, group, numbers)
        return total

    columns = array.T  # (n, rows)
    stratum_means = sums(columns, stratum, len(names))
    stratum_means /= np.bincount(stratum)[:, None]
    totals = sums(columns - stratum_means[stratum], cluster, len(pairs))
    squares = sums(totals**2, stratum_of_cluster, len(names))
    freedoms = cluster_counts[:, None] - 1.0
    parts = (freedoms + 1.0) / freedoms * squares / count**2  # (strata, rows)
    variance = parts.sum(axis=0)
    weighed = (parts**2 / freedoms).sum(axis=0)
    freedom = np.divide(variance**2, weighed, out=np.ones(rows), where=weighed > 0.0)
    reach = stats.t.ppf(0.5 + level / 2.0, freedom) * np.sqrt(variance)
    return Intervals(means, means - reach, means + reach)
