"""Scores of detectors and probabilities: how well a number tells right frames from wrong ones; conformal factors.

The libraries crepes and MAPIE treat every error as an independent draw. Here the clip is the exchangeable unit, as the
errors of its frames are correlated.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import roc_auc_score

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.uncertainty.calibration import BINS, reliability


def auroc(scores: Array, positive: NDArray[np.bool_]) -> float | None:
    """Return the probability that a positive has a higher score than a negative, ties a half; None without both."""
    return None if positive.all() or not positive.any() else float(roc_auc_score(positive, scores))


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


def conformal_factor(scores: Sequence[Array], level: float) -> float:
    """Return the factor at which radii hold a share `level` of the errors in a new clip.

    `scores` has an array for each of n clips: distances over radii. Every clip counts the same, however long it is, and
    the new one as infinitely far off: the factor is the least at which the mean over n + 1 clips of the share within it
    is at least the level. Raises ValueError where there are too few clips for that. R. Dunn, L. Wasserman, A. Ramdas,
    Distribution-free prediction sets for two-layer hierarchical models, 2023: the pooled CDF.
    """
    if not scores or any(not len(clip) for clip in scores):
        raise InputError("scores must be of one clip or more, each with one score or more")
    if not 0.0 < level < 1.0:
        raise InputError(f"level must be between 0 and 1, got {level}")
    clips = len(scores)
    if level > clips / (clips + 1):
        raise InputError(
            f"clips must be at least {int(np.ceil(level / (1.0 - level) - 1e-9))} for a level of {level}, got {clips}"
        )
    values = np.concatenate([np.asarray(clip, dtype=np.float64) for clip in scores])
    weights = np.concatenate([np.full(len(clip), 1.0 / (len(clip) * (clips + 1))) for clip in scores])
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])  # the pooled CDF
    return float(values[order][min(int(np.searchsorted(reached, level - 1e-12)), len(values) - 1)])


def calibration_error(probabilities: Array, right: NDArray[np.bool_], bins: int = BINS) -> float:
    """Return the expected calibration error: how far probabilities (n,) are from how often they are right.

    The mean over `bins` of equal width, weighted by how many fall into each. C. Guo, G. Pleiss, Y. Sun, K. Weinberger,
    On calibration of modern neural networks, 2017, (3).
    """
    off = sum(
        count * abs(predicted - observed) for count, predicted, observed in reliability(probabilities, right, bins)
    )
    return float(off / len(right))
