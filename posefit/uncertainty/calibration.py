"""Calibration of probabilities and intervals: their corrections, which `docs/studies/posterior.py` learns."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.geometry.skeleton import ANGLES, JOINTS

LEVELS = (0.5, 0.8, 0.95)  # of intervals
MAIN_LEVEL = LEVELS.index(0.8)  # of the one interval that is drawn and judged by
# ours: left and right are unknown from this probability on that they are exchanged
SECOND_SIDE = 0.2
DIGITS = 6  # of what a file holds
BINS = 10  # of probabilities


@dataclass(frozen=True, eq=False)
class Recalibration:
    """Corrections of a posterior's intervals and probabilities, learned on clips whose truth is known."""

    # standard deviations of joints (metres, each axis) and angles (radians) about every pose
    # (27,)
    joint_spreads: Array = field(
        default_factory=lambda: np.zeros(len(JOINTS)), repr=False
    )
    # (66,)
    angle_spreads: Array = field(default_factory=lambda: np.zeros(ANGLES), repr=False)
    # factors of the intervals of each level
    joint_factors: Array = field(
        default_factory=lambda: np.ones((len(LEVELS), len(JOINTS))), repr=False
    )
    angle_factors: Array = field(
        default_factory=lambda: np.ones((len(LEVELS), ANGLES)), repr=False
    )
    second_side: float = SECOND_SIDE
    # the power of modes' weights: below 1, modes are less sure than their share of
    # samples
    sharpness: float = 1.0
    none: float = 0.0  # the probability that no mode is right
    # (27,) in the world
    place_spreads: Array = field(
        default_factory=lambda: np.zeros(len(JOINTS)), repr=False
    )
    # standard deviation of the distance from a camera that is alone, a share of it
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
            value = frozen(
                name,
                getattr(self, name),
                (length,) if name.endswith("spreads") else (len(LEVELS), length),
            )
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
        """Return it as JSON holds it; its names are those that it is made from."""
        return {
            name: np.round(value, DIGITS).tolist() for name, value in vars(self).items()
        }


def reliability(
    probabilities: Array, right: NDArray[np.bool_]
) -> list[tuple[int, float, float]]:
    """Return the number of probabilities (n,) in each bin that has any, their mean, and the share that is right."""
    predicted = np.asarray(probabilities, dtype=np.float64)
    observed = np.asarray(right, dtype=np.float64)
    bin_of = np.minimum((predicted * BINS).astype(np.int64), BINS - 1)
    return [
        (
            int((bin_of == k).sum()),
            float(predicted[bin_of == k].mean()),
            float(observed[bin_of == k].mean()),
        )
        for k in np.unique(bin_of)
    ]
