"""The mean of many runs with its interval, for runs in strata and clusters."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.statistics.pairing import finite

CONFIDENCE = 0.95
MIN_RUNS = 8  # with fewer, a method's spread is too uncertain for an interval


@dataclass(frozen=True)
class Mean:
    """A mean and the ends of its interval, which are nan if unknown."""

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

    The interval is for other seeds on the same instances. It contains the true mean in
    93 to 97 % of simulated studies with 12 instances and 5 seeds, 8 and 3, or 4 and 10:
    with errors that are normal, skewed like a gamma distribution or tied, and also if
    30 % of the runs are lost. Two cases are worse. If one run in twenty is lost, a
    study has too few lost runs to estimate their frequency, and the interval contains
    the true mean in 86 to 92 % of the studies. With log-normal errors of standard
    deviation 1, it does so in 88 to 91 %.

    Args:
        errors: Finite numbers (methods, instances, seeds).

    Returns:
        The means with their intervals, each (methods,). With one seed, or fewer than 8
        runs of a method, `low` and `high` are nan.

    Raises:
        ValueError: Errors are not finite or have another shape.

    Example:
        >>> from posefit import run_means
        >>> errors = [[[1.0, 3.0], [5.0, 7.0], [2.0, 2.0], [4.0, 8.0]]]
        >>> run_means(errors).values.tolist()  # one method, 4 instances, 2 seeds
        [4.0]
    """
    array = finite("errors", errors, ("methods", "instances", "seeds"))
    methods, instances, seeds = array.shape
    strata = np.repeat(np.arange(instances), seeds)
    runs = array.reshape(methods, -1)
    return block_means(runs, strata)


def block_means(runs: ArrayLike, instances: ArrayLike) -> Intervals:
    """Return the mean error of each method with its 95 % interval, as `run_means` does.

    Args:
        runs: Errors (methods, n), finite.
        instances: The instance of each run (n,).

    Returns:
        The means with their intervals, each (methods,).

    Raises:
        ValueError: Errors are not finite or have another shape.
    """
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
    """Return the mean of values (n,) with its interval.

    `mean_intervals` does the same for several rows of values, and describes the
    arguments.
    """
    row = finite("values", values, ("n",))[None]
    means = mean_intervals(row, strata, clusters, level=level)
    return Mean(float(means.values[0]), float(means.low[0]), float(means.high[0]))


def mean_intervals(
    values: ArrayLike,
    strata: ArrayLike,
    clusters: ArrayLike,
    *,
    level: float = CONFIDENCE,
) -> Intervals:
    """Return the mean of each row of values with its interval.

    The interval is for other clusters of the same strata. Clusters are independent of
    each other; values of one cluster need not be. The variance is the one of a
    stratified sample of clusters, by linearisation (Cochran, Sampling techniques, 1977,
    5.9 and 11.8). The interval is Student's, with Satterthwaite's degrees of freedom
    (1946).

    Args:
        values: Finite numbers (rows, n).
        strata: The stratum of each value (n,), such as a kind of problem.
        clusters: The cluster of each value (n,), such as a random instance. Equal
            clusters in different strata are different.
        level: The confidence of the interval.

    Returns:
        The means with their intervals, each (rows,). If a stratum has only one cluster,
        `low` and `high` are nan.

    Raises:
        ValueError: Values are not finite, or the three are not equally long.
    """
    array = finite("values", values, ("rows", "n"))
    rows, count = array.shape
    stratum_of_value = np.asarray(strata)
    cluster_of_value = np.asarray(clusters)
    if stratum_of_value.shape != (count,) or cluster_of_value.shape != (count,):
        raise InputError(
            f"strata and clusters must have shape {(count,)}, "
            f"got {stratum_of_value.shape} and {cluster_of_value.shape}"
        )
    means = array.mean(axis=1)
    names, stratum_index = np.unique(stratum_of_value, return_inverse=True)
    stratum = stratum_index.astype(np.int64)
    cluster_names, number = np.unique(cluster_of_value, return_inverse=True)
    # a cluster is a pair: its stratum and its name
    pair_of_value = stratum * len(cluster_names) + number
    pairs, cluster = np.unique(pair_of_value, return_inverse=True)
    stratum_of_cluster = pairs // len(cluster_names)
    cluster_counts = np.bincount(stratum_of_cluster)
    if cluster_counts.min() < 2:
        unknown = np.full(rows, np.nan)
        return Intervals(means, unknown, unknown)

    def sums(numbers: Array, group: NDArray[np.int64], groups: int) -> Array:
        """Return the sums (groups, k) of numbers (n, k) whose groups are (n,)."""
        total = np.zeros((groups, numbers.shape[1]))
        np.add.at(total, group, numbers)
        return total

    columns = array.T  # (n, rows)
    stratum_means = sums(columns, stratum, len(names))
    stratum_means /= np.bincount(stratum)[:, None]
    totals = sums(columns - stratum_means[stratum], cluster, len(pairs))
    squares = sums(totals**2, stratum_of_cluster, len(names))
    freedoms = cluster_counts[:, None] - 1.0  # (strata, 1)
    parts = (freedoms + 1.0) / freedoms * squares / count**2  # (strata, rows)
    variance = parts.sum(axis=0)
    # Satterthwaite's degrees of freedom; any number will do for a row without variance
    weighed = (parts**2 / freedoms).sum(axis=0)
    freedom = np.divide(variance**2, weighed, out=np.ones(rows), where=weighed > 0.0)
    reach = stats.t.ppf(0.5 + level / 2.0, freedom) * np.sqrt(variance)
    return Intervals(means, means - reach, means + reach)
