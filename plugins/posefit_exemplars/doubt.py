"""What ways do not know of their own error, as it was found on the people of the library, each followed without him.

How far off a pose is hangs on what is to be seen in its frame: what the silhouette costs, how far the ways are from
each other, and by how many cameras. So a frame has a *doubt*, the error in metres that these let expect; the model's
error of joints and angles is so many times that.
`docs/studies/posterior.py --store` makes the numbers.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from importlib.resources import files
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.look import Look

FILE = "doubt.json"
LEAST_COST = 0.1  # per cent
LEAST_SPREAD = 0.002  # metres
MOST_ODDS = 30.0  # logarithm


def evidence(skeleton: Skeleton, posterior: Posterior, pose: Array, cost: float, cameras: int) -> Array:
    """Return what the doubt about a pose (66,) follows from (4,): 1, logarithms of cost and spread, two cameras."""
    joints, told = skeleton.joints(posterior.poses), skeleton.joints(pose)
    spread = float(posterior.weights @ np.linalg.norm(joints - told, axis=2).mean(axis=1))
    return np.array([1.0, math.log(max(cost, LEAST_COST)), math.log(max(spread, LEAST_SPREAD)), float(cameras > 1)])


def none_signs(log: float) -> Array:
    """Return what it follows from that no mode is right (3,): 1, the logarithm of the doubt, and its square."""
    return np.array([1.0, log, log * log])


def likely(odds: float) -> float:
    """Return how likely something is whose odds have this logarithm; beyond `MOST_ODDS` they count as that."""
    return 1.0 / (1.0 + math.exp(-min(max(odds, -MOST_ODDS), MOST_ODDS)))


@dataclass(frozen=True, eq=False)
class Doubt:
    """What makes intervals and weights of modes of a frame mean what they say."""

    slopes: Array  # (4,) of the logarithm of the doubt, over what is seen
    range: tuple[float, float]  # of that logarithm; there was nothing to learn beyond
    joint_spreads: Array = field(repr=False)  # (27,) standard deviations of each axis, in doubts
    angle_spreads: Array = field(repr=False)  # (66,) radians, for a doubt of a metre
    joint_factors: Array = field(repr=False)  # (levels, 27)
    angle_factors: Array = field(repr=False)  # (levels, 66)
    sharpness: float  # the power of modes' weights
    none: Array = field(repr=False)  # (3,) of the log-odds that no mode is right, over powers of the doubt's logarithm

    def log(self, seen: Array) -> float:
        """Return the logarithm of the doubt, by `evidence` (4,)."""
        return float(np.clip(self.slopes @ seen, *self.range))

    def none_right(self, log: float) -> float:
        """Return how likely no mode is right, at the logarithm of a doubt."""
        return likely(float(self.none @ none_signs(log)))

    def recalibration(self, log: float) -> Recalibration:
        """Return what a frame does not know of its error, by the logarithm of its doubt."""
        doubt = math.exp(log)
        spreads = doubt * self.joint_spreads, doubt * self.angle_spreads
        factors = self.joint_factors, self.angle_factors
        return Recalibration(*spreads, *factors, sharpness=self.sharpness, none=self.none_right(log))

    def as_dict(self) -> dict[str, Any]:
        """Return it as JSON holds it, to four digits."""
        return {name: _rounded(np.asarray(getattr(self, name))) for name in NAMES}

    @classmethod
    def from_dict(cls, held: Mapping[str, Any]) -> Self:
        """Return what `as_dict` gave."""
        low, high = held["range"]
        arrays = {name: np.array(held[name]) for name in ARRAYS}
        return cls(range=(low, high), sharpness=held["sharpness"], **arrays)


NAMES = tuple(one.name for one in fields(Doubt))
ARRAYS = tuple(name for name in NAMES if name not in ("range", "sharpness"))


def _rounded(values: Array) -> Any:
    if values.ndim:
        return [_rounded(one) for one in values]
    return float(f"{float(values):.4g}")


@cache
def learned() -> Doubt:
    """Return what was found on the library's own people."""
    return Doubt.from_dict(json.loads(files("posefit_exemplars").joinpath(FILE).read_text("utf-8")))


def recalibrated(posterior: Posterior, pose: Array, cost: float, look: Look) -> Posterior:
    """Return a posterior with what it does not know of its error, where a pose (66,) was told at a cost.

    Where nothing is seen, no cost says anything, and the doubt is as great as any that was learned.
    """
    doubt = learned()
    seen = evidence(look.skeleton, posterior, pose, cost if look.usable else math.inf, look.cameras)
    return replace(posterior, recalibration=doubt.recalibration(doubt.log(seen)))
