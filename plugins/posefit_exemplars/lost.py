"""Is a frame lost? What speaks for it, and how likely that makes it: a logistic model of a frame's evidence.

What the pose costs, how far from it the farthest of the drawn tracks is, and how many cameras there are; each beside
its mean over the frames before: who is lost stays so for a while. `posefit reproduce lost` fits the model.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.skeleton import Skeleton
from posefit.posterior.modes import Posterior

FITTED = Path(__file__).with_name("lost.json")  # made by `posefit reproduce lost --store`
MEMORY = 0.2  # seconds that the mean over the frames before reaches back

# What is known of a frame, and what is added to it before its logarithm is taken; None is taken as it is.
EVIDENCE: Mapping[str, float | None] = {
    "cost": 1.0,  # of what is told, where the person is seen
    "farthest": 0.01,  # metres that the farthest of the drawn tracks is off what is told
    "views": None,
}


def farthest(skeleton: Skeleton, posterior: Posterior, pose: Array) -> float:
    """Return how far the farthest track of a posterior is from a pose (66,): metres, the mean over joints.

    Both have their roots at one point.
    """
    joints, every = skeleton.joints(pose), skeleton.joints(posterior.poses)
    off = np.linalg.norm((every - every[:, :1]) - (joints - joints[:1]), axis=-1).mean(axis=1)
    return float(off.max())


class Memory:
    """What frames had for evidence so far."""

    def __init__(self, fps: float) -> None:
        self._share = 1.0 - math.exp(-1.0 / (MEMORY * fps))
        self._latest: dict[str, float] = {}
        self._mean: Array | None = None

    def features(self, told: Mapping[str, float]) -> Array:
        """Return the evidence of the next frame and its mean over those so far (2 E,), on the scale that is fitted.

        What a frame does not tell is as in the one before, or 0 where none has told it.
        """
        self._latest |= told
        now = np.array([_scaled(self._latest.get(name, 0.0), floor) for name, floor in EVIDENCE.items()])
        self._mean = now if self._mean is None else self._mean + self._share * (now - self._mean)
        return np.concatenate([now, self._mean])


def _scaled(value: float, floor: float | None) -> float:
    return value if floor is None else math.log(max(value, 0.0) + floor)


NAMES = (*EVIDENCE, *(f"{name}, so far" for name in EVIDENCE))  # of features


@dataclass(frozen=True, eq=False)
class Detector:
    """A logistic model of some features: how likely a frame is lost."""

    rows: list[int]  # of the features that it looks at
    weights: Array = field(repr=False)
    bias: float

    def probability(self, features: Array) -> float:
        """Return how likely a frame with these features (2 E,) is lost."""
        return 1.0 / (1.0 + math.exp(-min(max(float(features[self.rows] @ self.weights) + self.bias, -30.0), 30.0)))

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> Self:
        """Return the model that JSON holds. Raises ValueError where it looks at what is not told."""
        unknown = sorted(set(told["weights"]) - set(NAMES))
        if unknown:
            raise ValueError(f"weights must be of evidence that frames have, got {', '.join(unknown)}")
        rows = [NAMES.index(name) for name in told["weights"]]
        return cls(rows, np.array(list(told["weights"].values()), dtype=np.float64), float(told["bias"]))


@cache
def stored_detector() -> Detector:
    """Return the model that was fitted to people whom the library has never seen."""
    return Detector.from_dict(json.loads(FITTED.read_text(encoding="utf-8")))


def doubted(frames: Iterable[Frame], task: Task, detector: Detector) -> Iterator[Frame]:
    """Yield frames with how likely each is lost; their `details` tell by what evidence.

    Where no tracks are drawn, nobody says.
    """
    memory = Memory(task.fps)
    for frame in frames:
        if frame.posterior is None:
            yield frame
            continue
        told = {
            "farthest": farthest(task.body.skeleton, frame.posterior, frame.pose),
            "views": float(len(task.cameras)),
        }
        if frame.details["usable"]:
            told["cost"] = frame.cost
        lost = detector.probability(memory.features(told))
        yield replace(frame, lost=lost, details={**frame.details, "evidence": told})
