"""Is a frame lost? What speaks for it, and how likely that makes it: a logistic model of a frame's evidence.

What the path costs against what was expected, how many other poses remain and how far they are, whether the two
directions of time agree, how the path jumps, and how far the pose is from all that was recorded. Evidence of a frame
is looked at beside its mean over the frames before: who is lost stays so for a while. `posefit reproduce lost` fits it.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.posterior.modes import Posterior
from posefit.posterior.sides import second_side
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.window import Seen, way

FITTED = Path(__file__).with_name("lost.json")  # what `posefit reproduce lost --store` writes
FAR = 0.15  # metres, the mean over joints, beyond which a pose would be lost if another one were true
LEVER = 0.25  # metres that joints are from the vertical through the root, about: what a turned body moves them by
MEMORY = 0.2  # seconds that the mean over the frames before reaches back
LIKELY_LEAST = 1e-30  # below it a likelihood counts as that

# What is known of a frame, and what is added to it before its logarithm is taken; None is taken as it is.
EVIDENCE: Mapping[str, float | None] = {
    "least": 1.0,  # cost of the best state, of all that were looked at
    "least_on": 1.0,  # and its mean over the frames that wait
    "path": 1.0,  # cost of the state on the path
    "path_on": 1.0,
    "cost": 1.0,  # of what is told, refined and smoothed
    "missed": 0.01,  # share of the silhouette that it does not cover
    "spilled": 0.01,  # share of it that is outside
    "surprise": 1.0,  # how unlikely the silhouette was, by the frames before, in units of cost
    "surprise_on": 1.0,
    "entropy": None,  # of the states' weights, nats
    "spread": 0.01,  # metres that states are off what is told, root mean square by their weights
    "turned": 0.01,  # and what is due to their yaws, radians
    "far": None,  # weight of the states that are far from it
    "forward_spread": 0.01,  # the same by the weights that a frame has without those after it
    "forward_far": None,
    "agreement": None,  # of the weights with and without the frames after it: 1 is the same
    "step_mean": 0.3,  # of what the steps of the path cost, over the frames that wait
    "step_most": 1.0,
    "off": 0.01,  # metres that refinement went away from the path
    "nearest": 0.01,  # metres to the nearest state
    "unusual": 0.01,  # metres from the mean of all recorded poses
    "speed": 0.3,  # metres a second that joints move, their mean
    "unseen": 1.0,  # frames since the person was seen
    "views": None,
    "samples": 0.01,  # metres that the tracks of the posterior are off what is told, their mean
    "samples_far": None,  # share of them that is far
    "samples_most": 0.01,
    "second_side": None,  # weight of those with left and right exchanged
}


def evidence(
    window: Sequence[Seen], usable: Sequence[bool], likely: Array, exemplars: Exemplars, pose: Array, temperature: float
) -> dict[str, float]:
    """Return what speaks for the first frame of a window, which is told as `pose` (66,), to be lost; by its names.

    `likely` (n,) are the weights of its states. Costs are those of frames that are `usable`; where it is not, a frame
    has none of its own.
    """
    rows, first = way(window), window[0]
    beam, row = first.beam, rows[0]
    codes, code = exemplars.codes[beam.states], exemplars.coding.coded(pose[None])[0]
    apart = ((codes - code) ** 2).sum(axis=1)
    nearest = float(np.sqrt(apart.min()))
    turned = (2.0 * np.sin(0.5 * wrapped(beam.yaws - pose[0]))) ** 2
    apart = apart + LEVER**2 * turned
    told = {
        "entropy": -float(likely @ np.log(np.maximum(likely, LIKELY_LEAST))),
        "turned": float(np.sqrt(likely @ turned)),
        "spread": float(np.sqrt(likely @ apart)),
        "far": float(likely @ (apart > FAR**2)),
        "forward_spread": float(np.sqrt(first.forward @ apart)),
        "forward_far": float(first.forward @ (apart > FAR**2)),
        "agreement": float(np.sqrt(first.forward * likely).sum()),
        "unusual": float(np.linalg.norm(code)),
    }
    onward = zip(window[1:], rows[:-1], rows[1:], strict=True)
    steps = [_cost(float(one.kernel[here, there])) for one, here, there in onward if one.kernel is not None]
    if steps:
        told |= {"step_mean": sum(steps) / len(steps), "step_most": max(steps)}
    ways = list(zip(window, rows, usable, strict=True))
    least = [temperature * one.least for one, _, seen in ways if seen]
    path = [temperature * (one.least + _cost(float(one.likelihoods[at]))) for one, at, seen in ways if seen]
    surprise = [temperature * one.surprise for one, _, seen in ways if seen]
    if least:
        each = {"least": least, "path": path, "surprise": surprise}
        told |= {f"{name}_on": sum(costs) / len(costs) for name, costs in each.items()}
        if usable[0]:
            off = float(np.linalg.norm(code - exemplars.codes[beam.states[row]]))
            told |= {"off": off, "nearest": nearest} | {name: costs[0] for name, costs in each.items()}
    return told


def _cost(likelihood: float) -> float:
    return -math.log(max(likelihood, LIKELY_LEAST))


def drawn_evidence(skeleton: Skeleton, posterior: Posterior, pose: Array) -> dict[str, float]:
    """Return what the tracks of a posterior say about a pose (66,), by its names."""
    joints, every = skeleton.joints(pose), skeleton.joints(posterior.poses)
    off = np.linalg.norm((every - every[:, :1]) - (joints - joints[:1]), axis=-1).mean(axis=1)
    return {
        "samples": float(off.mean()),
        "samples_far": float((off > FAR).mean()),
        "samples_most": float(off.max()),
        "second_side": second_side(skeleton, posterior, pose),
    }


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
    skeleton, memory, before = task.body.skeleton, Memory(task.fps), None
    unseen = 0.0
    for frame in frames:
        told = dict(frame.details["evidence"])
        joints = skeleton.joints(frame.pose)
        unseen = 0.0 if "least" in told else unseen + 1.0
        told |= {"unseen": unseen, "views": float(len(task.cameras))}
        if before is not None:
            told["speed"] = float(np.linalg.norm(joints - before, axis=1).mean()) * task.fps
        if not unseen:
            missed, spilled, both = (float(count) for count in frame.areas.sum(axis=0))
            told |= {"cost": frame.cost, "missed": missed / max(missed + both, 1.0)}
            told["spilled"] = spilled / max(spilled + both, 1.0)
        lost = None
        if frame.posterior is not None:
            told |= drawn_evidence(skeleton, frame.posterior, frame.pose)
            lost = detector.probability(memory.features(told))
        before = joints
        yield replace(frame, lost=lost, details={"evidence": told})
