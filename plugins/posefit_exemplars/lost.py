"""Is a frame lost, and are its left and right exchanged? What speaks for it, and how likely that makes it.

Two logistic models of one evidence: what the pose costs, how many times as much its twins cost, which have left and
right exchanged, how far the drawn tracks are from it, how many of them have the other side, whether the person goes
where he faces, from which side he is seen, and by how many cameras. Much of it stands beside its means over a moment
and over a second: who is lost stays so for a while, and masks that never fit say less than one that fits worse now.
`docs/studies/lost.py` fits the models.
"""

import json
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.alike import facing
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit.uncertainty.sides import second_side
from posefit_exemplars.doubt import likely

FITTED = Path(__file__).with_name("lost.json")  # made by `docs/studies/lost.py --store`
REACHES: Mapping[str, float] = {
    "lately": 0.2,
    "in general": 1.0,
}  # seconds that means over the frames before reach back


def _log(floor: float) -> Callable[[float], float]:
    return lambda value: math.log(max(value, 0.0) + floor)


def _as_it_is(value: float) -> float:
    return value


# What is known of a frame, and on which scale a model looks at it.
EVIDENCE: Mapping[str, Callable[[float], float]] = {
    "cost": _log(1.0),  # of what is told, where the person is seen
    "reflected": math.log,  # how many times as much the cheapest of the twins along lines of sight costs
    "mirrored": math.log,  # and the mirror image
    "farthest": _log(0.01),  # metres that the farthest of the drawn tracks is off what is told
    "second": _as_it_is,  # weight of the tracks that have left and right exchanged
    "ahead": _as_it_is,  # metres a second by which the root goes where it faces
    "speed": _as_it_is,  # metres a second by which it goes anywhere
    "across": _as_it_is,  # how far he faces across the only camera's line of sight, from 0 to 1; 0 where there are more
    "views": _as_it_is,  # how many cameras see something of him, `MOST` at most
}
UNTOLD = {"reflected": 1.0, "mirrored": 1.0}  # what a frame is taken to have where none has told it yet; 0 of all else
MOST = 2  # cameras: what more of them tell, nobody has learned
OF_TWINS = 1.0  # per cent that are added to costs of which one is divided by another
GOING = 0.5  # seconds over which a root goes somewhere
FASTEST = 2.0  # metres a second: who seems to go faster goes no less surely
NAMES = (*EVIDENCE, *(f"{name}, {reach}" for reach in REACHES for name in EVIDENCE))  # of features


def evidence_of(skeleton: Skeleton, frame: Frame, cameras: Sequence[Camera]) -> dict[str, float]:
    """Return what is known of a frame by itself that has a posterior: values of `EVIDENCE`, as far as it has them.

    Its `details` tell whether it is `usable` and what its `twins` cost, see `Look.twins`.
    """
    assert frame.posterior is not None
    seeing = [camera for camera, counts in zip(cameras, frame.areas, strict=True) if counts.any()] or cameras
    told = {
        "farthest": farthest(skeleton, frame.posterior, frame.pose),
        "second": second_side(skeleton, frame.posterior, frame.pose),
        "across": across(seeing, float(frame.pose[0]), frame.translation),
        "views": float(min(len(seeing), MOST)),
    }
    if frame.details["usable"]:
        mirrored, *reflected = (frame.details["twins"] + OF_TWINS) / (frame.cost + OF_TWINS)
        told |= {"cost": frame.cost, "reflected": float(min(reflected)), "mirrored": float(mirrored)}
    return told


def going(places: Sequence[Array], yaw: float, fps: float, *, backwards: bool = False) -> dict[str, float]:
    """Return how fast the root goes `ahead`, where it faces, and anywhere, from places (3,) of the latest frames.

    Metres a second, `FASTEST` at most. Nothing where there is one place alone. With `backwards` they come in reverse.
    """
    if len(places) < 2:
        return {}
    way = (places[-1] - places[0])[[0, 2]] * fps / (len(places) - 1) * (-1.0 if backwards else 1.0)
    ahead = float(way @ [math.sin(yaw), math.cos(yaw)])
    return {"ahead": min(max(ahead, -FASTEST), FASTEST), "speed": min(float(np.linalg.norm(way)), FASTEST)}


def across(cameras: Sequence[Camera], yaw: float, place: Array) -> float:
    """Return how far somebody at a place (3,) faces across the only camera's line of sight: 1 where it sees his side.

    0 where there are several cameras, as one of them sees what another does not.
    """
    return abs(math.sin(yaw - facing(cameras[0], place))) if len(cameras) == 1 else 0.0


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
        self._keep = np.exp([[-1.0 / (seconds * fps)] for seconds in REACHES.values()])
        self._latest: dict[str, float] = {}
        self._sums, self._weight = np.zeros((len(REACHES), len(EVIDENCE))), np.zeros((len(REACHES), 1))

    def features(self, told: Mapping[str, float]) -> Array:
        """Return the evidence of the next frame and its means over those so far (3 E,), on the scale that is fitted.

        What a frame does not tell is as in the one before, or as `UNTOLD` where none has told it. In a mean, what is
        older counts less, by a factor e for each reach.
        """
        self._latest |= told
        now = np.array([scale(self._latest.get(name, UNTOLD.get(name, 0.0))) for name, scale in EVIDENCE.items()])
        self._sums, self._weight = self._sums * self._keep + now, self._weight * self._keep + 1.0
        return np.concatenate([now, (self._sums / self._weight).ravel()])


@dataclass(frozen=True, eq=False)
class Detector:
    """A logistic model of some features: how likely something is of a frame."""

    rows: list[int]  # of the features that it looks at
    weights: Array = field(repr=False)
    bias: float

    def probability(self, features: Array) -> float:
        """Return how likely it is of a frame with these features (3 E,)."""
        return likely(float(features[self.rows] @ self.weights) + self.bias)

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> Self:
        """Return the model that JSON holds. Raises ValueError where it looks at what is not told."""
        unknown = sorted(set(told["weights"]) - set(NAMES))
        if unknown:
            raise ValueError(f"weights must be of evidence that frames have, got {', '.join(unknown)}")
        rows = [NAMES.index(name) for name in told["weights"]]
        return cls(rows, np.array(list(told["weights"].values()), dtype=np.float64), float(told["bias"]))


@dataclass(frozen=True, eq=False)
class Judge:
    """How likely a frame is lost, how likely its sides are exchanged, and from where on they are called unknown."""

    lost: Detector
    sides: Detector
    unknown: float  # the probability of exchanged sides from which they are

    @classmethod
    def from_dict(cls, told: Mapping[str, Any]) -> Self:
        """Return the models that JSON holds. Raises ValueError where one looks at what is not told."""
        return cls(Detector.from_dict(told["lost"]), Detector.from_dict(told["sides"]), float(told["unknown"]))


@cache
def stored_judge() -> Judge:
    """Return the models that were fitted to people whom the library has never seen."""
    return Judge.from_dict(json.loads(FITTED.read_text(encoding="utf-8")))


def doubted(frames: Iterable[Frame], task: Task, judge: Judge) -> Iterator[Frame]:
    """Yield frames with how likely each is lost, and whether its left and right are unknown.

    Their `details` tell by what evidence, and how likely sides are exchanged. Where no tracks are drawn, nobody says.
    """
    memory = Memory(task.fps)
    places: deque[Array] = deque(maxlen=max(round(GOING * task.fps), 1) + 1)
    for frame in frames:
        if frame.posterior is None:
            yield frame
            continue
        places.append(frame.translation)
        told = evidence_of(task.body.skeleton, frame, task.cameras)
        told |= going(places, float(frame.pose[0]), task.fps, backwards=task.backwards)
        features = memory.features(told)
        exchanged = judge.sides.probability(features)
        yield replace(
            frame,
            lost=judge.lost.probability(features),
            posterior=_sided(frame.posterior, exchanged >= judge.unknown),
            details={**frame.details, "evidence": told, "exchanged": exchanged},
        )


def _sided(posterior: Posterior, unknown: bool) -> Posterior:
    """Return a posterior whose left and right are unknown, or known unless no sample has them as they are told."""
    model = posterior.recalibration or Recalibration()
    return replace(posterior, recalibration=replace(model, second_side=float(not unknown)))
