"""The probability that a run of one method beats a run of another on the same instance. Agarwal et al., 2021."""

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.statistics.intervals import LEVEL, RESAMPLES, check_bootstrap
from posefit.statistics.pairing import finite


def probability_of_improvement(errors: ArrayLike) -> Array:
    """Return in row a, column b the probability that method a has the lower error, (methods, methods).

    `errors` (methods, instances, seeds). On each instance every run of one is compared with every run of the other, a
    tie counting half (Mann and Whitney's U); instances weigh the same. The diagonal is 0.5.
    """
    array = finite("errors", errors, ("methods", "instances", "seeds"))
    methods, instances, seeds = array.shape
    wins = np.full((methods, methods), 0.5)
    for a, b in combinations(range(methods), 2):
        ranks = stats.rankdata(np.concatenate([array[a], array[b]], axis=1), axis=1)
        beaten = ranks[:, :seeds].sum() - instances * seeds * (seeds + 1) / 2.0
        wins[b, a] = beaten / (instances * seeds * seeds)
        wins[a, b] = 1.0 - wins[b, a]
    return wins


def improvement_interval(
    first: ArrayLike,
    second: ArrayLike,
    rng: np.random.Generator,
    *,
    resamples: int = RESAMPLES,
    level: float = LEVEL,
) -> tuple[float, float, float]:
    """Return the probability that `first` has a lower error than `second`, each (instances, seeds), and its interval.

    Seeds are resampled within each instance, the same for both, as they are paired. The percentiles are those of
    Hesterberg, What teachers should know about the bootstrap, 2015: moved out to the t distribution and by
    sqrt(n / (n - 1)), without which they are too narrow for few seeds n. Where a seed brings both methods the same
    luck, its own pair is unlike the others and shifts the value by the order of 1 / n. With one seed both ends are nan.
    """
    errors = finite("first", first, ("instances", "seeds"))
    others = finite("second", second, ("instances", "seeds"))
    if errors.shape != others.shape:
        raise InputError(f"second must have the shape of first, {errors.shape}, got {others.shape}")
    check_bootstrap(resamples, level)
    instances, seeds = errors.shape
    wins = (errors[:, :, None] < others[:, None, :]) + 0.5 * (errors[:, :, None] == others[:, None, :])
    value = float(wins.mean())
    if seeds == 1:
        return value, np.nan, np.nan
    shares = np.zeros(resamples)
    for i in range(instances):
        counts = rng.multinomial(seeds, np.full(seeds, 1.0 / seeds), size=resamples).astype(np.float64)
        shares += ((counts @ wins[i]) * counts).sum(axis=1) / (seeds * seeds * instances)
    freedom = instances * (seeds - 1)
    edge = float(stats.norm.cdf(np.sqrt(seeds / (seeds - 1)) * stats.t.ppf(0.5 + level / 2.0, freedom)))
    low, high = np.quantile(shares, [1.0 - edge, edge])
    return value, float(low), float(high)
