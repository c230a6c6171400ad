"""The reported frame: its pose, with a calibrated posterior.

The expected error of a frame, in metres, follows from the cost of the silhouette, the
spread of the sampled tracks and the number of cameras. The standard deviations of
joints and angles are multiples of it.
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
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.frame_costs import FrameCosts

MIN_SPREAD = 0.002  # metres: the logarithm of a spread falls no further


def evidence(
    skeleton: Skeleton, posterior: Posterior, pose: Array, cost: float, cameras: int
) -> Array:
    """Return the predictors (4,) of the error of a pose.

    These are 1, the logarithm of the cost, the logarithm of the spread of the posterior
    around the pose, and 1 if there are several cameras, else 0.

    Args:
        skeleton: The person's skeleton.
        posterior: The sampled poses and their weights.
        pose: (66,) the reported pose.
        cost: The cost of the reported pose, per cent.
        cameras: How many cameras show the person.
    """
    joints = skeleton.joints(posterior.poses)
    reported = skeleton.joints(pose)
    spread = float(
        posterior.weights @ np.linalg.norm(joints - reported, axis=2).mean(axis=1)
    )
    return np.array(
        [
            1.0,
            math.log(max(cost, np.finfo(np.float64).tiny)),
            math.log(max(spread, MIN_SPREAD)),
            float(cameras > 1),
        ]
    )


def none_features(log_error: float) -> Array:
    """Return the predictors (3,) of no mode being right.

    These are 1, the logarithm of the expected error, and the square of that logarithm.
    """
    return np.array([1.0, log_error, log_error * log_error])


@dataclass(frozen=True, eq=False, repr=False)
class PosteriorCalibration:
    """The fitted corrections that calibrate the intervals and modes of a frame."""

    temperature: float  # divides silhouette costs in the posterior
    slopes: Array  # (4,) of the logarithm of the expected error, over `evidence`
    range: tuple[float, float]  # the values of that logarithm in the training data
    joint_spreads: Array  # (27,) standard deviation per axis, in expected errors
    angle_spreads: Array  # (66,) radians, for an expected error of a metre
    joint_factors: Array  # (levels, 27)
    angle_factors: Array  # (levels, 66)
    sharpness: float  # the power of modes' weights
    none: Array  # (3,) of the log-odds that no mode is right, over `none_features`

    def log_error(self, evidence: Array) -> float:
        """Return the logarithm of the expected error, from `evidence` (4,)."""
        return float(np.clip(self.slopes @ evidence, *self.range))

    def recalibration(self, log_error: float) -> Recalibration:
        """Return the recalibration of a frame with this logarithm of expected error."""
        error = math.exp(log_error)  # metres
        none = float(logistic(self.none @ none_features(log_error)))
        return Recalibration(
            error * self.joint_spreads,
            error * self.angle_spreads,
            self.joint_factors,
            self.angle_factors,
            sharpness=self.sharpness,
            none=none,
        )


@cache
def stored_calibration() -> PosteriorCalibration:
    """Return the calibration that `docs/studies/posterior.py` fitted to library people.

    These are the people of the clips in the motion library.
    """
    stored = json.loads(
        files("posefit_exemplars").joinpath("calibration.json").read_text("utf-8")
    )
    low, high = stored.pop("range")
    sharpness = stored.pop("sharpness")
    temperature = stored.pop("temperature")
    arrays = {name: np.array(values) for name, values in stored.items()}
    return PosteriorCalibration(
        temperature=temperature, range=(low, high), sharpness=sharpness, **arrays
    )


def recalibrated(
    posterior: Posterior, pose: Array, cost: float, frame_costs: FrameCosts
) -> Posterior:
    """Return the posterior of a frame with its recalibration.

    Args:
        posterior: The posterior around the reported pose.
        pose: (66,) the reported pose.
        cost: Its cost, per cent. In a frame without usable silhouettes it counts as
            infinite.
        frame_costs: The costs of the frame.
    """
    calibration = stored_calibration()
    cost = cost if frame_costs.usable else math.inf
    values = evidence(
        frame_costs.skeleton, posterior, pose, cost, frame_costs.camera_count
    )
    recalibration = calibration.recalibration(calibration.log_error(values))
    return replace(posterior, recalibration=recalibration)


def reported(estimate: Estimate) -> Frame:
    """Return the frame of an estimate, with its cost and posterior.

    The details are evidence of whether the frame is lost or has sides exchanged.
    """
    assert estimate.paths is not None
    pose = estimate.pose
    place = estimate.place
    frame_costs = estimate.frame_costs
    cost, areas = frame_costs.cost_and_areas(pose, place)
    mirror_costs = np.empty(0)
    if frame_costs.usable:
        mirror_costs = frame_costs.mirror_costs(pose, place)
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
