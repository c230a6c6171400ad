"""Weights from costs, their effective sample size, resampling, and probabilities."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array

MAX_LOG_ODDS = 30.0  # ours: beyond it a probability would be 0 or 1


def weigh(costs: Array, sharpness: float) -> Array:
    """Return the weights (n,), exp(-sharpness cost), which sum to 1.

    A cost that is nan or infinite gets the weight 0. If all costs are, all weights are
    equal.

    Args:
        costs: The costs (n,).
        sharpness: The factor on the costs, 0 or more.

    Returns:
        The weights (n,).

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import weigh
        >>> weigh(np.array([2.0, 2.0, np.nan]), 1.0).tolist()
        [0.5, 0.5, 0.0]
    """
    known = np.isfinite(costs)
    if not known.any():
        return np.full(costs.size, 1.0 / costs.size)
    rises = np.where(known, costs, np.inf) - costs[known].min()
    # GORDON1993 (likelihood)
    weights: Array = (
        np.exp(-sharpness * rises) if sharpness else known.astype(np.float64)
    )
    return np.asarray(weights / weights.sum())


def effective_sample_size(weights: Array) -> float:
    """Return the effective number of samples of weights (n,), which sum to 1.

    It is 1 over the sum of their squares: n if all weights are equal, and 1 if a single
    weight is 1.

    Args:
        weights: The weights (n,).

    Returns:
        The effective number of samples.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import effective_sample_size
        >>> effective_sample_size(np.full(4, 0.25))
        4.0
    """
    return float(weights.sum() ** 2 / (weights**2).sum())


def systematic_rows(weights: Array, u: float, count: int) -> NDArray[np.int64]:
    """Return `count` rows, drawn by their weights with systematic resampling.

    A row is drawn as often as its weight times `count`, rounded up or down. `u` in
    [0, 1) is the offset of the evenly spaced points.

    Args:
        weights: The weights (n,), which sum to 1.
        u: The offset of the points, 0 to 1.
        count: The number of rows.

    Returns:
        The rows (count,), rising.

    Example:
        >>> import numpy as np
        >>> from posefit.plugin import systematic_rows
        >>> systematic_rows(np.array([0.5, 0.0, 0.5]), 0.5, 4).tolist()
        [0, 0, 2, 2]
    """
    rows = weights.cumsum().searchsorted((np.arange(count) + u) / count, side="right")
    return np.asarray(np.minimum(rows, np.flatnonzero(weights)[-1]))


def logistic(log_odds: Array) -> Array:
    """Return the probabilities of logarithms of odds, of any shape; none is 0 or 1."""
    return np.asarray(
        1.0 / (1.0 + np.exp(-np.clip(log_odds, -MAX_LOG_ODDS, MAX_LOG_ODDS)))
    )
