"""Scores of detectors: how well a number tells right frames from wrong ones."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array


def auroc(scores: Array, positive: NDArray[np.bool_]) -> float | None:
    """Return the probability that a positive has a higher score than a negative, ties a half; None without both."""
    wanted, others = scores[positive], np.sort(scores[~positive])
    if not len(wanted) or not len(others):
        return None
    below = np.searchsorted(others, wanted, "left") + np.searchsorted(others, wanted, "right")
    return float(0.5 * below.mean() / len(others))


def false_alarms(scores: Array, positive: NDArray[np.bool_], recall: float) -> float | None:
    """Return the share of negatives at least as high as a share `recall` of positives; None without both."""
    wanted, others = np.sort(scores[positive])[::-1], scores[~positive]
    if not len(wanted) or not len(others):
        return None
    least = wanted[max(int(np.ceil(recall * len(wanted) - 1e-9)), 1) - 1]
    return float((others >= least).mean())


def kept_errors(errors: Array, scores: Array, shares: Sequence[float]) -> Array:
    """Return the mean errors of the shares of frames with the least scores: the risk-coverage curve. GEIFMAN2017."""
    means = np.cumsum(errors[np.argsort(scores, kind="stable")]) / np.arange(1, len(errors) + 1)
    return np.array([means[max(round(share * len(errors)), 1) - 1] for share in shares])
