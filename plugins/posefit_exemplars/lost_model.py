"""How far a frame can be trusted: its calibrated posterior, and the probabilities that it is lost or exchanged.

The error of a pose depends on the cost of the silhouette, the spread of the sampled tracks and the number of cameras:
they give a frame's expected error, in metres; standard deviations of joints and angles are multiples of it.

The probabilities are those of two logistic models of the same evidence: what the pose costs, the cost ratios of its
mirrored and reflected poses, the spread of the sampled tracks, how many of them have the other side, whether the person
moves where they face, the angle of view and the number of cameras. Each value is used with its means over a moment and
over a second: a lost track stays lost for a while, and masks that never fit mean less than one that fits worse now.
"""

import json
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Task
from posefit.fitting.weights import logistic
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import Skeleton, joint_distances
from posefit.geometry.symmetry import facing
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior, second_side
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.smoothing import Estimate

MIN_COST, MIN_SPREAD = 0.1, 0.002  # per cent, and metres
LANDMARK_SECONDS = 0.5  # that the mean of the landmarks' evidence of sides reaches back
MIN_SIDE_ODDS = 0.4  # the least mean logarithm of the odds at which one camera's landmarks tell left from right


def evidence(skeleton: Skeleton, posterior: Posterior, pose: Array, cost: float, cameras: int) -> Array:
    """Return the predictors (4,) of the error of a pose (66,): 1, logarithms of cost and spread, several cameras."""
    joints, reported = skeleton.joints(posterior.poses), skeleton.joints(pose)
    spread = float(posterior.weights @ np.linalg.norm(joints - reported, axis=2).mean(axis=1))
    return np.array([1.0, math.log(max(cost, MIN_COST)), math.log(max(spread, MIN_SPREAD)), float(cameras > 1)])


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
        return Recalibration(*spreads, self.joint_factors, self.angle_factors, sharpness=self.sharpness, none=none)


@cache
def stored_calibration() -> Calibration:
    """Return the calibration that was fitted on the library's own people by `docs/studies/posterior.py`."""
    stored = json.loads(files("posefit_exemplars").joinpath("calibration.json").read_text("utf-8"))
    (low, high), sharpness = stored.pop("range"), stored.pop("sharpness")
    arrays = {name: np.array(values) for name, values in stored.items() if name != "temperature"}
    return Calibration(range=(low, high), sharpness=sharpness, **arrays)


def recalibrated(posterior: Posterior, pose: Array, cost: float, frame_costs: FrameCosts) -> Posterior:
    """Return the posterior around a reported pose (66,) and its cost, recalibrated; the cost of nothing is infinite."""
    calibration = stored_calibration()
    cost = cost if frame_costs.usable else math.inf
    values = evidence(frame_costs.skeleton, posterior, pose, cost, frame_costs.camera_count)
    return replace(posterior, recalibration=calibration.recalibration(calibration.log(values)))


def reported(estimate: Estimate) -> Frame:
    """Return the frame of an estimate: its cost, its posterior, and what shows whether it is lost or exchanged."""
    pose, place, frame_costs = estimate.pose, estimate.place, estimate.frame_costs
    cost, areas = frame_costs.cost_and_areas(pose, place)
    posterior, evaluations = None, int(np.ceil(estimate.evaluations)) + 1
    details: dict[str, Any] = {"usable": frame_costs.usable}
    if estimate.paths is not None:
        details["sides"] = frame_costs.side_odds(pose, place)
        details["mirror_costs"] = frame_costs.mirror_costs(pose, place) if frame_costs.usable else np.empty(0)
        evaluations += len(details["mirror_costs"])
        posterior = recalibrated(estimate.paths.about(pose, place), pose, cost, frame_costs)
    trace = np.array([[evaluations, cost]])
    return Frame(pose, place, cost, areas, evaluations, trace, posterior, details=details)


MEAN_SECONDS = {"lately": 0.2, "in general": 1.0}  # that the means reach back


# The evidence of a frame, each with the scale on which it enters the models.
EVIDENCE: Mapping[str, Callable[[float], float]] = {
    "cost": lambda value: math.log(max(value, 0.0) + 1.0),  # of the reported pose, where the person is visible
    "reflected": math.log,  # the least cost of poses reflected along a line of sight, over the cost
    "mirrored": math.log,  # the cost of the mirror image, over the cost
    "farthest": lambda value: math.log(max(value, 0.0) + 0.01),  # metres to the farthest sampled track
    "second": float,  # weight of the tracks that have left and right exchanged
    "ahead": float,  # metres a second that the root moves in the direction it faces
    "speed": float,  # metres a second that it moves in any direction
    "across": float,  # 0 to 1: facing across the only camera's line of sight; 0 with several cameras
    "views": math.log2,  # cameras that show something of the person, at most `MAX_VIEWS`
}
DEFAULTS = {"reflected": 1.0, "mirrored": 1.0, "views": 1.0}  # before the first value; of other evidence 0
MAX_VIEWS = 4  # nothing was fitted with more cameras
MIRROR_COST_OFFSET = 1.0  # per cent, added to both costs of a ratio
MOTION_SECONDS = 0.5  # over which the root's motion is measured
MAX_SPEED = 2.0  # metres a second; a higher speed is no better evidence
NAMES = (*EVIDENCE, *(f"{name}, {reach}" for reach in MEAN_SECONDS for name in EVIDENCE))  # of features


def evidence_of(skeleton: Skeleton, frame: Frame, cameras: Sequence[Camera]) -> dict[str, float]:
    """Return the values of `EVIDENCE` that a frame with a posterior has by itself."""
    assert frame.posterior is not None
    distances = joint_distances(skeleton.joints(frame.posterior.poses), skeleton.joints(frame.pose))
    visible = [camera for camera, counts in zip(cameras, frame.areas, strict=True) if counts.any()] or cameras
    values = {
        "farthest": float(distances.mean(axis=1).max()),
        "second": second_side(skeleton, frame.posterior, frame.pose),
        "across": across(visible, float(frame.pose[0]), frame.translation),
        "views": float(min(len(visible), MAX_VIEWS)),
    }
    if frame.details["usable"]:
        mirrored, *reflected = (frame.details["mirror_costs"] + MIRROR_COST_OFFSET) / (frame.cost + MIRROR_COST_OFFSET)
        values |= {"cost": frame.cost, "reflected": float(min(reflected)), "mirrored": float(mirrored)}
    return values


def root_motion(places: Sequence[Array], yaw: float, fps: float, *, backwards: bool = False) -> dict[str, float]:
    """Return the speeds of the root `ahead`, where the person faces, and in any direction, from its latest places."""
    if len(places) < 2:
        return {}
    velocity = (places[-1] - places[0])[[0, 2]] * fps / (len(places) - 1) * (-1.0 if backwards else 1.0)
    ahead, speed = float(velocity @ [math.sin(yaw), math.cos(yaw)]), float(np.linalg.norm(velocity))
    return {"ahead": min(max(ahead, -MAX_SPEED), MAX_SPEED), "speed": min(speed, MAX_SPEED)}


def across(cameras: Sequence[Camera], yaw: float, place: Array) -> float:
    """Return how far a person at a place (3,) faces across the only camera's line of sight: 1 in a side view."""
    return abs(math.sin(yaw - facing(cameras[0], place))) if len(cameras) == 1 else 0.0


class EvidenceMeans:
    """The evidence of the frames so far, and its exponentially weighted means."""

    def __init__(self, fps: float) -> None:
        self._decays = np.exp([[-1.0 / (seconds * fps)] for seconds in MEAN_SECONDS.values()])
        self._latest: dict[str, float] = {}
        self._sums, self._weight = np.zeros((len(MEAN_SECONDS), len(EVIDENCE))), np.zeros((len(MEAN_SECONDS), 1))

    def features(self, values: Mapping[str, float]) -> Array:
        """Return the evidence of the next frame and its means so far (3 E,), on the scale that was fitted.

        A missing value is that of the frame before, at first that of `DEFAULTS`.
        """
        self._latest |= values
        now = np.array([scale(self._latest.get(name, DEFAULTS.get(name, 0.0))) for name, scale in EVIDENCE.items()])
        self._sums, self._weight = self._sums * self._decays + now, self._weight * self._decays + 1.0
        return np.concatenate([now, (self._sums / self._weight).ravel()])


class LogisticModel(NamedTuple):
    """A logistic model of some features of a frame."""

    rows: list[int]  # of the features that it uses
    weights: Array
    bias: float

    def probability(self, features: Array) -> float:
        """Return the probability for a frame with these features (3 E,)."""
        return float(logistic(features[self.rows] @ self.weights + self.bias))

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Return the model that JSON holds."""
        rows = [NAMES.index(name) for name in stored["weights"]]
        return cls(rows, np.array(list(stored["weights"].values()), dtype=np.float64), float(stored["bias"]))


class FailureClassifier(NamedTuple):
    """The models of lost frames and of exchanged sides, and the probability from which sides are unknown."""

    lost: LogisticModel
    sides: LogisticModel
    unknown: float

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Return the models that JSON holds."""
        lost, sides = (LogisticModel.from_dict(stored[name]) for name in ("lost", "sides"))
        return cls(lost, sides, float(stored["unknown"]))


@cache
def stored_classifier() -> FailureClassifier:
    """Return the models that `docs/studies/lost.py` fitted to people who are not in the library."""
    stored = files("posefit_exemplars").joinpath("lost_model.json").read_text("utf-8")
    return FailureClassifier.from_dict(json.loads(stored))


def with_failure_probabilities(frames: Iterable[Frame], task: Task, classifier: FailureClassifier) -> Iterator[Frame]:
    """Yield frames that have sampled tracks with the probabilities that they are lost, or have sides exchanged."""
    means, side_sums, decay = EvidenceMeans(task.fps), np.zeros(3), math.exp(-1.0 / (LANDMARK_SECONDS * task.fps))
    places: deque[Array] = deque(maxlen=max(round(MOTION_SECONDS * task.fps), 1) + 1)
    for frame in frames:
        if frame.posterior is None:
            yield frame
            continue
        places.append(frame.translation)
        evidence = evidence_of(task.body.skeleton, frame, task.cameras)
        evidence |= root_motion(places, float(frame.pose[0]), task.fps, backwards=task.backwards)
        features = means.features(evidence)
        exchanged = classifier.sides.probability(features)
        # left and right are unknown, or else known unless no sample has them as reported
        known = exchanged < classifier.unknown
        if (odds := frame.details.get("sides")) is not None:
            side_sums = decay * side_sums + [*odds, 1.0]
            legs, arms, count = side_sums
            if len(task.cameras) == 1:  # its landmarks are better evidence than its silhouettes
                known = legs + arms >= MIN_SIDE_ODDS * count
            known = bool(known and legs >= 0.0)  # however many cameras agree: arms may have sides that legs have not
        recalibration = replace(frame.posterior.recalibration or Recalibration(), second_side=float(known))
        posterior, lost = replace(frame.posterior, recalibration=recalibration), classifier.lost.probability(features)
        details = {**frame.details, "evidence": evidence, "exchanged": exchanged}
        yield replace(frame, lost=lost, posterior=posterior, details=details)
