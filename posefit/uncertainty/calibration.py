"""Calibration of probabilities and intervals: coverage, conformal factors, ECE, AUROC.

The conformal factors are written out here, not taken from crepes or MAPIE: those treat every
error as an independent draw, but frames of a clip err together. The clip is the exchangeable unit, clips are few, and a
joint's factor comes from all joints of its group.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.skeleton import ANGLES, JOINTS

LEVELS = (0.5, 0.8, 0.95)  # of intervals
SECOND_SIDE = 0.2  # ours: how likely it has to be that left and right are exchanged, for them to be called unknown
DIGITS = 6  # of what a file holds
BINS = 10  # of probabilities


@dataclass(frozen=True, eq=False)
class Recalibration:
    """Corrections of a posterior's intervals and probabilities, learned on clips whose truth is known."""

    # standard deviations, each axis: how far off joints (metres) and angles (radians) are from every pose it has
    joint_spreads: Array = field(default_factory=lambda: np.zeros(len(JOINTS)), repr=False)  # (27,)
    angle_spreads: Array = field(default_factory=lambda: np.zeros(ANGLES), repr=False)  # (66,)
    # what intervals of each level are multiplied by
    joint_factors: Array = field(default_factory=lambda: np.ones((len(LEVELS), len(JOINTS))), repr=False)
    angle_factors: Array = field(default_factory=lambda: np.ones((len(LEVELS), ANGLES)), repr=False)
    second_side: float = SECOND_SIDE
    sharpness: float = 1.0  # the power of modes' weights: below 1, modes are less sure than their share of samples
    none: float = 0.0  # how likely it is that no mode is right: that the truth is unlike all of them

    def __post_init__(self) -> None:
        for name in ("joint_spreads", "angle_spreads", "joint_factors", "angle_factors"):
            expected = {"spreads": (), "factors": (len(LEVELS),)}[name.partition("_")[2]]
            expected += (len(JOINTS) if name.startswith("joint") else ANGLES,)
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.shape != expected:
                raise InputError(f"{name} must have shape {expected}, got {value.shape}")
            if not (np.isfinite(value).all() and value.min() >= 0.0):
                raise InputError(f"{name} must be finite and 0 or more, got {value.min():g} to {value.max():g}")
            object.__setattr__(self, name, value)
        if not 0.0 <= self.second_side <= 1.0:
            raise InputError(f"second_side must lie in 0 to 1, got {self.second_side}")
        if not 0.0 < self.sharpness < np.inf:
            raise InputError(f"sharpness must be above 0 and finite, got {self.sharpness}")
        if not 0.0 <= self.none <= 1.0:
            raise InputError(f"none must lie in 0 to 1, got {self.none}")

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it; its names are those that it is made from."""
        return {name: np.round(value, DIGITS).tolist() for name, value in vars(self).items()}


def coverage(distances: Array, radii: Array) -> float:
    """Return the share of distances (...) that are within radii (...)."""
    return float((np.asarray(distances) <= np.asarray(radii)).mean())


def conformal_factor(scores: Sequence[Array], level: float) -> float:
    """Return what radii have to be multiplied by, so that they hold a `level` of what a new clip brings. DUNN2023.

    `scores` has an array for each of n clips: distances over radii. Every clip counts the same, however long it is, and
    the one that is to come as infinitely far off: the factor is the least at which the mean over n + 1 clips of the
    share within it is at least the level. Raises ValueError where there are too few clips for that.
    """
    if not scores or any(not len(one) for one in scores):
        raise InputError("scores must be of one clip or more, each with one score or more")
    if not 0.0 < level < 1.0:
        raise InputError(f"level must be between 0 and 1, got {level}")
    clips = len(scores)
    if level > clips / (clips + 1):
        raise InputError(
            f"clips must be at least {int(np.ceil(level / (1.0 - level) - 1e-9))} for a level of {level}, got {clips}"
        )
    values = np.concatenate([np.asarray(one, dtype=np.float64) for one in scores])
    weights = np.concatenate([np.full(len(one), 1.0 / (len(one) * (clips + 1))) for one in scores])
    order = np.argsort(values, kind="stable")
    reached = np.cumsum(weights[order])  # DUNN2023 (pooled CDF)
    return float(values[order][min(int(np.searchsorted(reached, level - 1e-12)), len(values) - 1)])


def calibration_error(probabilities: Array, right: NDArray[np.bool_], bins: int = BINS) -> float:
    """Return the expected calibration error: how far probabilities (n,) are from how often they are right. GUO2017.

    The mean over `bins` of equal width, weighted by how many fall into each.
    """
    off = sum(
        count * abs(predicted - observed) for count, predicted, observed in reliability(probabilities, right, bins)
    )
    return float(off / len(right))  # GUO2017 (3)


def reliability(probabilities: Array, right: NDArray[np.bool_], bins: int = BINS) -> list[tuple[int, float, float]]:
    """Return how many probabilities (n,) are in each bin that has any, their mean, and how often they are right."""
    predicted, observed = _paired("right", probabilities, right)
    bin_of = np.minimum((predicted * bins).astype(np.int64), bins - 1)
    return [
        (int((bin_of == k).sum()), float(predicted[bin_of == k].mean()), float(observed[bin_of == k].mean()))
        for k in np.unique(bin_of)
    ]


def auroc(scores: Array, positive: NDArray[np.bool_]) -> float | None:
    """Return how probably a positive has a higher score than a negative, ties a half; None where one is missing."""
    values, held = _paired("positive", scores, positive)
    wanted, others = values[held > 0.0], np.sort(values[held == 0.0])
    if not len(wanted) or not len(others):
        return None
    below = np.searchsorted(others, wanted, "left") + np.searchsorted(others, wanted, "right")
    return float(0.5 * below.mean() / len(others))


def false_alarms(scores: Array, positive: NDArray[np.bool_], recall: float) -> float | None:
    """Return the share of negatives that have at least the score which so many positives have; None without both."""
    values, held = _paired("positive", scores, positive)
    wanted, others = np.sort(values[held > 0.0])[::-1], values[held == 0.0]
    if not len(wanted) or not len(others):
        return None
    least = wanted[max(int(np.ceil(recall * len(wanted) - 1e-9)), 1) - 1]
    return float((others >= least).mean())


def kept_errors(errors: Array, doubts: Array, shares: Sequence[float]) -> Array:
    """Return the mean error of the shares of frames that are least doubted: the risk-coverage curve. GEIFMAN2017."""
    errors, doubts = _paired("doubts", errors, doubts)
    means = np.cumsum(errors[np.argsort(doubts, kind="stable")]) / np.arange(1, len(errors) + 1)
    return np.array([means[max(round(share * len(errors)), 1) - 1] for share in shares])


def _paired(name: str, values: Array, others: Array | NDArray[np.bool_]) -> tuple[Array, Array]:
    values, others = np.asarray(values, dtype=np.float64), np.asarray(others, dtype=np.float64)
    if values.ndim != 1 or not len(values) or others.shape != values.shape:
        raise InputError(
            f"{name} must have as many entries as there are values, 1 or more, got {others.shape} for {values.shape}"
        )
    return values, others
