"""Calibration of probabilities and intervals: corrections, conformal factors and the expected calibration error.

The libraries crepes and MAPIE treat every error as an independent draw. Here the clip is the exchangeable unit, as the
errors of its frames are correlated.
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
SECOND_SIDE = 0.2  # ours: left and right are unknown from this probability on that they are exchanged
DIGITS = 6  # of what a file holds
BINS = 10  # of probabilities


@dataclass(frozen=True, eq=False)
class Recalibration:
    """Corrections of a posterior's intervals and probabilities, learned on clips whose truth is known."""

    # standard deviations of joints (metres, each axis) and angles (radians) about every pose
    joint_spreads: Array = field(default_factory=lambda: np.zeros(len(JOINTS)), repr=False)  # (27,)
    angle_spreads: Array = field(default_factory=lambda: np.zeros(ANGLES), repr=False)  # (66,)
    # factors of the intervals of each level
    joint_factors: Array = field(default_factory=lambda: np.ones((len(LEVELS), len(JOINTS))), repr=False)
    angle_factors: Array = field(default_factory=lambda: np.ones((len(LEVELS), ANGLES)), repr=False)
    second_side: float = SECOND_SIDE
    sharpness: float = 1.0  # the power of modes' weights: below 1, modes are less sure than their share of samples
    none: float = 0.0  # the probability that no mode is right

    def __post_init__(self) -> None:
        for name, length in (("joint", len(JOINTS)), ("angle", ANGLES)):
            for part, shape in (("spreads", (length,)), ("factors", (len(LEVELS), length))):
                value = np.asarray(getattr(self, f"{name}_{part}"), dtype=np.float64)
                if value.shape != shape or not (np.isfinite(value).all() and value.min() >= 0.0):
                    came = f"{value.min():g} to {value.max():g}" if value.shape == shape else f"shape {value.shape}"
                    raise InputError(f"{name}_{part} must be 0 or more and of shape {shape}, got {came}")
                object.__setattr__(self, f"{name}_{part}", value)
        for name, low, high in (("second_side", 0.0, 1.0), ("sharpness", 1e-9, 1e9), ("none", 0.0, 1.0)):
            if not low <= getattr(self, name) <= high:
                raise InputError(f"{name} must lie in {low:g} to {high:g}, got {getattr(self, name)}")

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it; its names are those that it is made from."""
        return {name: np.round(value, DIGITS).tolist() for name, value in vars(self).items()}


def conformal_factor(scores: Sequence[Array], level: float) -> float:
    """Return the factor at which radii hold a share `level` of the errors in a new clip. DUNN2023.

    `scores` has an array for each of n clips: distances over radii. Every clip counts the same, however long it is, and
    the new one as infinitely far off: the factor is the least at which the mean over n + 1 clips of the share within it
    is at least the level. Raises ValueError where there are too few clips for that.
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
    """Return the number of probabilities (n,) in each bin that has any, their mean, and the share that is right."""
    predicted, observed = np.asarray(probabilities, dtype=np.float64), np.asarray(right, dtype=np.float64)
    bin_of = np.minimum((predicted * bins).astype(np.int64), bins - 1)
    return [
        (int((bin_of == k).sum()), float(predicted[bin_of == k].mean()), float(observed[bin_of == k].mean()))
        for k in np.unique(bin_of)
    ]
