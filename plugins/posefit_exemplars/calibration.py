"""A frame as it is reported: its pose with a calibrated posterior.

The error of a pose depends on the cost of the silhouette, the spread of the sampled tracks and the number of cameras:
they give a frame's expected error, in metres; standard deviations of joints and angles are multiples of it.
"""

import json
import math
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.fitting.weights import logistic
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.smoothing import Estimate

# per cent, and metres
MIN_COST = 0.1
MIN_SPREAD = 0.002


def evidence(
    skeleton: Skeleton, posterior: Posterior, pose: Array, cost: float, cameras: int
) -> Array:
    """Return the predictors (4,) of the error of a pose (66,): 1, logarithms of cost and spread, several cameras."""
    joints = skeleton.joints(posterior.poses)
    reported = skeleton.joints(pose)
    spread = float(
        posterior.weights @ np.linalg.norm(joints - reported, axis=2).mean(axis=1)
    )
    return np.array(
        [
            1.0,
            math.log(max(cost, MIN_COST)),
            math.log(max(spread, MIN_SPREAD)),
            float(cameras > 1),
        ]
    )


def none_features(log: float) -> Array:
    """Return the predictors (3,) of no mode being right: 1, the logarithm of the expected error, and its square."""
    return np.array([1.0, log, log * log])


@dataclass(frozen=True, eq=False, repr=False)
class Calibration:
    """The corrections with which a frame's intervals and weights of modes hold as often as they claim."""

    slopes: Array  # (4,) of the logarithm of the expected error, over `evidence`
    range: tuple[float, float]  # of that logarithm in the training data
    joint_spreads: Array  # (27,) standard deviations of each axis, in expected errors
    angle_spreads: Array  # (66,) radians, for an expected error of a metre
    joint_factors: Array  # (levels, 27)
    angle_factors: Array  # (levels, 66)
    sharpness: float  # the power of modes' weights
    none: Array  # (3,) of the log-odds that no mode is right, over `none_features`

    def log(self, evidence: Array) -> float:
        """Return the logarithm of the expected error, from `evidence` (4,)."""
        return float(np.clip(self.slopes @ evidence, *self.range))

    def recalibration(self, log: float) -> Recalibration:
        """Return the recalibration of a frame, from the logarithm of its expected error."""
        spreads = math.exp(log) * self.joint_spreads, math.exp(log) * self.angle_spreads
        none = float(logistic(self.none @ none_features(log)))
        return Recalibration(
            *spreads,
            self.joint_factors,
            self.angle_factors,
            sharpness=self.sharpness,
            none=none,
        )


@cache
def stored_calibration() -> Calibration:
    """Return the calibration that was fitted on the library's own people by `docs/studies/posterior.py`."""
    stored = json.loads(
        files("posefit_exemplars").joinpath("calibration.json").read_text("utf-8")
    )
    (low, high), sharpness = stored.pop("range"), stored.pop("sharpness")
    arrays = {
        name: np.array(values)
        for name, values in stored.items()
        if name != "temperature"
    }
    return Calibration(range=(low, high), sharpness=sharpness, **arrays)


def recalibrated(
    posterior: Posterior, pose: Array, cost: float, frame_costs: FrameCosts
) -> Posterior:
    """Return the posterior around a reported pose (66,) and its cost, recalibrated; the cost of nothing is infinite."""
    calibration = stored_calibration()
    cost = cost if frame_costs.usable else math.inf
    values = evidence(
        frame_costs.skeleton, posterior, pose, cost, frame_costs.camera_count
    )
    return replace(
        posterior, recalibration=calibration.recalibration(calibration.log(values))
    )


def reported(estimate: Estimate) -> Frame:
    """Return the frame of an estimate: its cost, its posterior, and what shows whether it is lost or exchanged."""
    assert estimate.paths is not None
    pose = estimate.pose
    place = estimate.place
    frame_costs = estimate.frame_costs
    cost, areas = frame_costs.cost_and_areas(pose, place)
    mirror_costs = (
        frame_costs.mirror_costs(pose, place) if frame_costs.usable else np.empty(0)
    )
    sides = frame_costs.side_odds(pose, place)
    details = {
        "usable": frame_costs.usable,
        "sides": sides,
        "mirror_costs": mirror_costs,
    }
    posterior = recalibrated(estimate.paths.about(pose, place), pose, cost, frame_costs)
    evaluations = int(np.ceil(estimate.evaluations)) + 1 + len(mirror_costs)
    trace = np.array([[evaluations, cost]])
    return Frame(
        pose, place, cost, areas, evaluations, trace, posterior, details=details
    )
