"""The probabilities that a frame is lost, and that its left and right are exchanged.

Two logistic models give them from the same evidence: the cost of the pose, the cost
ratios of its mirrored and reflected poses, the spread of the sampled tracks, the share
of them with sides exchanged, the angle of view, and the number of cameras. The models
also use the means of each value over a moment and over a second. A lost track stays
lost for a while, and a sudden rise in cost counts more than a steady high cost.
"""

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
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
from posefit.uncertainty.modes import second_side

# Decay time of the sums of the landmarks' evidence of sides.
MOMENT_SECONDS = 0.5
# Landmarks of one camera tell left from right if the mean logarithm of their odds is at
# least this.
MIN_SIDE_ODDS = 0.4
MEAN_SECONDS = {"lately": 0.2, "in general": 1.0}  # decay times of the means

# The evidence of a frame. Each value enters the models on the scale given here.
EVIDENCE: Mapping[str, Callable[[float], float]] = {
    # cost of the reported pose, if the person is visible
    "cost": math.log1p,
    # how much more the cheapest of the poses reflected along a line of sight costs, on
    # the same scale
    "reflected": float,
    "mirrored": float,  # how much more the mirror image costs, on the same scale
    # metres to the farthest sampled track
    "farthest": lambda value: math.log(value + 0.01),
    "second": float,  # weight of the tracks that have left and right exchanged
    # 0 to 1: facing across the only camera's line of sight; 0 with several cameras
    "across": float,
    # number of cameras that show something of the person
    "views": math.log2,
}
# Names of the features: the evidence, then each of its means.
NAMES = (
    *EVIDENCE,
    *(f"{name}, {reach}" for reach in MEAN_SECONDS for name in EVIDENCE),
)


def evidence_of(
    skeleton: Skeleton, frame: Frame, cameras: Sequence[Camera]
) -> dict[str, float]:
    """Return the values of `EVIDENCE` that depend on one frame alone.

    Args:
        skeleton: The person's skeleton.
        frame: The frame, with a posterior.
        cameras: The cameras.
    """
    assert frame.posterior is not None
    distances = joint_distances(
        skeleton.joints(frame.posterior.poses), skeleton.joints(frame.pose)
    )
    views = zip(cameras, frame.areas, strict=True)
    visible = [camera for camera, counts in views if counts.any()] or cameras
    across = 0.0
    if len(visible) == 1:
        turn = frame.pose[0] - facing(visible[0], frame.translation)
        across = abs(math.sin(turn))
    values = {
        "farthest": float(distances.mean(axis=1).max()),
        "second": second_side(skeleton, frame.posterior, frame.pose),
        "across": across,
        "views": float(len(visible)),
    }
    if frame.details["usable"]:
        other_costs = np.log1p(frame.details["mirror_costs"])
        mirrored, *reflected = other_costs - np.log1p(frame.cost)
        values |= {
            "cost": frame.cost,
            "reflected": float(min(reflected)),
            "mirrored": float(mirrored),
        }
    return values


class EvidenceMeans:
    """The evidence of the frames so far, and its exponentially weighted means."""

    def __init__(self, fps: float) -> None:
        self._decays = np.exp(
            [[-1.0 / (seconds * fps)] for seconds in MEAN_SECONDS.values()]
        )
        self._latest: dict[str, float] = {}
        self._sums = np.zeros((len(MEAN_SECONDS), len(EVIDENCE)))
        self._weight = np.zeros((len(MEAN_SECONDS), 1))

    def features(self, values: Mapping[str, float]) -> Array:
        """Return the features (3 E,) of the next frame: its evidence, and the means.

        A missing value is copied from the frame before. In the first frame its feature
        is 0.
        """
        for name, value in values.items():
            self._latest[name] = EVIDENCE[name](value)
        now = np.array([self._latest.get(name, 0.0) for name in EVIDENCE])
        self._sums = self._sums * self._decays + now
        self._weight = self._weight * self._decays + 1.0
        return np.concatenate([now, (self._sums / self._weight).ravel()])


class LogisticModel(NamedTuple):
    """A logistic model of some features of a frame."""

    rows: list[int]  # the features that the model uses
    weights: Array
    bias: float

    def probability(self, features: Array) -> float:
        """Return the probability of a frame with these features (3 E,)."""
        return float(logistic(features[self.rows] @ self.weights + self.bias))

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Return the model stored as JSON."""
        rows = [NAMES.index(name) for name in stored["weights"]]
        return cls(
            rows,
            np.array(list(stored["weights"].values()), dtype=np.float64),
            float(stored["bias"]),
        )


class FailureClassifier(NamedTuple):
    """The models of lost frames and of exchanged sides."""

    lost: LogisticModel
    sides: LogisticModel
    unknown: float  # sides are unknown from this probability of `sides`

    @classmethod
    def from_dict(cls, stored: Mapping[str, Any]) -> Self:
        """Return the models stored as JSON."""
        lost = LogisticModel.from_dict(stored["lost"])
        sides = LogisticModel.from_dict(stored["sides"])
        return cls(lost, sides, float(stored["unknown"]))


@cache
def stored_classifier() -> FailureClassifier:
    """Return the models that `docs/studies/lost.py` fitted.

    It fitted them to people who are not in the library.
    """
    stored = files("posefit_exemplars").joinpath("lost_model.json").read_text("utf-8")
    return FailureClassifier.from_dict(json.loads(stored))


class LandmarkSides:
    """Whether left and right are known by landmarks, over the frames so far.

    Args:
        fps: Frames a second.
        cameras: The number of cameras.
    """

    def __init__(self, fps: float, cameras: int) -> None:
        self._decay = math.exp(-1.0 / (MOMENT_SECONDS * fps))
        self._single = cameras == 1
        # decaying sums of the log-odds of legs and of arms, and of frames
        self._sums = np.zeros(3)

    def known(self, odds: Array, by_model: bool) -> bool:
        """Return whether left and right are known in the next frame.

        Args:
            odds: (2,) the logarithms of the odds that the frame's landmarks have legs
                and arms on the sides of the pose.
            by_model: Whether left and right are known by the model of exchanged sides.
        """
        self._sums = self._decay * self._sums + [*odds, 1.0]
        legs, arms, count = self._sums
        known = by_model
        # landmarks of one camera are better evidence than its silhouettes
        if self._single:
            known = bool(legs + arms >= MIN_SIDE_ODDS * count)
        # arms may be right where legs are exchanged, even if several cameras agree
        return bool(known and legs >= 0.0)


def with_failure_probabilities(
    frames: Iterable[Frame], task: Task, classifier: FailureClassifier
) -> Iterator[Frame]:
    """Yield frames with the probabilities of being lost and of exchanged sides."""
    means = EvidenceMeans(task.fps)
    landmark_sides = LandmarkSides(task.fps, len(task.cameras))
    for frame in frames:
        assert frame.posterior is not None
        evidence = evidence_of(task.body.skeleton, frame, task.cameras)
        features = means.features(evidence)
        exchanged = classifier.sides.probability(features)
        known = exchanged < classifier.unknown
        if (odds := frame.details.get("sides")) is not None:
            known = landmark_sides.known(odds, known)
        recalibration = replace(
            frame.posterior.recalibration or Recalibration(), second_side=float(known)
        )
        posterior = replace(frame.posterior, recalibration=recalibration)
        lost = classifier.lost.probability(features)
        details = {**frame.details, "evidence": evidence, "exchanged": exchanged}
        yield replace(frame, lost=lost, posterior=posterior, details=details)
