"""The calibration of posteriors, fitted on the people of the library, each followed without their own clips.

The error of a pose depends on its frame: on the cost of the silhouette, on the spread of the sampled tracks and on the
number of cameras. These give the expected error of the frame, in metres, and standard deviations of joints and angles
are multiples of it.
"""

import json
import math
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.frame_costs import FrameCosts

FILE = "calibration.json"
ARRAYS = ("slopes", "joint_spreads", "angle_spreads", "joint_factors", "angle_factors", "none")  # of a `Calibration`
MIN_COST = 0.1  # per cent
MIN_SPREAD = 0.002  # metres
MAX_LOG_ODDS = 30.0  # logarithm


def evidence(skeleton: Skeleton, posterior: Posterior, pose: Array, cost: float, cameras: int) -> Array:
    """Return the predictors (4,) of the error of a pose (66,): 1, logarithms of cost and spread, several cameras."""
    joints, reported = skeleton.joints(posterior.poses), skeleton.joints(pose)
    spread = float(posterior.weights @ np.linalg.norm(joints - reported, axis=2).mean(axis=1))
    return np.array([1.0, math.log(max(cost, MIN_COST)), math.log(max(spread, MIN_SPREAD)), float(cameras > 1)])


def none_features(log: float) -> Array:
    """Return the predictors (3,) of no mode being right: 1, the logarithm of the expected error, and its square."""
    return np.array([1.0, log, log * log])


def probability_of(odds: float) -> float:
    """Return the probability for a logarithm of odds, which is clipped to `MAX_LOG_ODDS`."""
    return 1.0 / (1.0 + math.exp(-min(max(odds, -MAX_LOG_ODDS), MAX_LOG_ODDS)))


@dataclass(frozen=True, eq=False)
class Calibration:
    """The corrections with which a frame's intervals and weights of modes hold as often as they claim."""

    slopes: Array  # (4,) of the logarithm of the expected error, over `evidence`
    range: tuple[float, float]  # of that logarithm in the training data
    joint_spreads: Array = field(repr=False)  # (27,) standard deviations of each axis, in expected errors
    angle_spreads: Array = field(repr=False)  # (66,) radians, for an expected error of a metre
    joint_factors: Array = field(repr=False)  # (levels, 27)
    angle_factors: Array = field(repr=False)  # (levels, 66)
    sharpness: float  # the power of modes' weights
    none: Array = field(repr=False)  # (3,) of the log-odds that no mode is right, over `none_features`

    def log(self, evidence: Array) -> float:
        """Return the logarithm of the expected error, from `evidence` (4,)."""
        return float(np.clip(self.slopes @ evidence, *self.range))

    def recalibration(self, log: float) -> Recalibration:
        """Return the recalibration of a frame, from the logarithm of its expected error."""
        spreads = math.exp(log) * self.joint_spreads, math.exp(log) * self.angle_spreads
        factors = self.joint_factors, self.angle_factors
        none = probability_of(float(self.none @ none_features(log)))
        return Recalibration(*spreads, *factors, sharpness=self.sharpness, none=none)


@cache
def stored_calibration() -> Calibration:
    """Return the calibration that was fitted on the library's own people by `docs/studies/posterior.py`."""
    stored = json.loads(files("posefit_exemplars").joinpath(FILE).read_text("utf-8"))
    low, high = stored["range"]
    arrays = {name: np.array(stored[name]) for name in ARRAYS}
    return Calibration(range=(low, high), sharpness=stored["sharpness"], **arrays)


def recalibrated(posterior: Posterior, pose: Array, cost: float, look: FrameCosts) -> Posterior:
    """Return the posterior around a reported pose (66,) and its cost, recalibrated.

    Where nothing is visible, the cost means nothing, and the expected error is the greatest of the training data.
    """
    calibration = stored_calibration()
    values = evidence(look.skeleton, posterior, pose, cost if look.usable else math.inf, look.cameras)
    return replace(posterior, recalibration=calibration.recalibration(calibration.log(values)))
