"""Corrections that calibrate probabilities and intervals.

`docs/studies/posterior.py` learns them.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.geometry.skeleton import ANGLES, JOINTS

LEVELS = (0.5, 0.8, 0.95)  # of intervals
MAIN_LEVEL = LEVELS.index(0.8)  # index of the level that is displayed and judged
# ours: left and right are unknown if they are exchanged with at least this probability
SECOND_SIDE = 0.2
DIGITS = 6  # of numbers in a file
BINS = 10  # of probabilities


@dataclass(frozen=True, eq=False)
class Recalibration:
    """Corrections of a posterior's intervals and probabilities.

    They are learned from clips with a known truth.

    Attributes:
        joint_spreads: Standard deviation of each joint (27,) about every pose, along
            each axis, in metres.
        angle_spreads: Standard deviation of each angle (66,) about every pose, in
            radians.
        joint_factors: Factors of the intervals of joints (levels, 27).
        angle_factors: Factors of the intervals of angles (levels, 66).
        second_side: Left and right are unknown if they are exchanged with at least this
            probability.
        sharpness: The power of modes' weights. Below 1, the likeliest mode has less
            than its share of samples.
        none: The probability that no mode is right.
        place_spreads: Like `joint_spreads`, but of the joints' places in the world.
        depth: Standard deviation of the distance from a single camera, as a share of
            the distance.

    Raises:
        InputError: A value has another shape, or is out of its range.
    """

    joint_spreads: Array = field(
        default_factory=lambda: np.zeros(len(JOINTS)), repr=False
    )
    angle_spreads: Array = field(default_factory=lambda: np.zeros(ANGLES), repr=False)
    joint_factors: Array = field(
        default_factory=lambda: np.ones((len(LEVELS), len(JOINTS))), repr=False
    )
    angle_factors: Array = field(
        default_factory=lambda: np.ones((len(LEVELS), ANGLES)), repr=False
    )
    second_side: float = SECOND_SIDE
    sharpness: float = 1.0
    none: float = 0.0
    place_spreads: Array = field(
        default_factory=lambda: np.zeros(len(JOINTS)), repr=False
    )
    depth: float = 0.0

    def __post_init__(self) -> None:
        for name in (
            "joint_spreads",
            "angle_spreads",
            "place_spreads",
            "joint_factors",
            "angle_factors",
        ):
            length = ANGLES if name.startswith("angle") else len(JOINTS)
            shape = (length,) if name.endswith("spreads") else (len(LEVELS), length)
            value = frozen(name, getattr(self, name), shape)
            if value.min() < 0.0:
                raise InputError(f"{name} must be 0 or more, got {value.min():g}")
            object.__setattr__(self, name, value)
        for name, low, high in (
            ("second_side", 0.0, 1.0),
            ("sharpness", 1e-9, 1e9),
            ("none", 0.0, 1.0),
            ("depth", 0.0, 1.0),
        ):
            if not low <= getattr(self, name) <= high:
                raise InputError(
                    f"{name} must lie in {low:g} to {high:g}, got {getattr(self, name)}"
                )

    def as_dict(self) -> dict[str, Any]:
        """Return the constructor's arguments as values for JSON."""
        rounded = {}
        for name, value in vars(self).items():
            rounded[name] = np.round(value, DIGITS).tolist()
        return rounded


def reliability(
    probabilities: Array, right: NDArray[np.bool_]
) -> list[tuple[int, float, float]]:
    """Return how often predictions are right, by bins of their probability.

    Args:
        probabilities: The probability of each prediction (n,).
        right: Whether each prediction is right (n,).

    Returns:
        For each bin that is not empty: the number of predictions, their mean
        probability, and the share of right ones.
    """
    predicted = np.asarray(probabilities, dtype=np.float64)
    observed = np.asarray(right, dtype=np.float64)
    bin_of = np.minimum((predicted * BINS).astype(np.int64), BINS - 1)
    bins = []
    for k in np.unique(bin_of):
        inside = bin_of == k
        mean_predicted = float(predicted[inside].mean())
        mean_observed = float(observed[inside].mean())
        bins.append((int(inside.sum()), mean_predicted, mean_observed))
    return bins
