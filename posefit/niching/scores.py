"""How good a report is: which of the known poses it found, and whether its weights mean what they say.

X. Li, A. Engelbrecht, M. Epitropakis, Benchmark functions for CEC'2013 special session and competition on niching
methods for multimodal function optimization, 2013: the peak ratio, at several levels of accuracy. G. Brier,
Verification of forecasts expressed in terms of probability, Monthly Weather Review 78, 1950.

A pose that is reported speaks for that known pose which is nearest to it, and for none where that is farther than the
level. Only the ten heaviest poses of a report count.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.niching.instance import NicheInstance
from posefit.niching.reports import REPORTED
from posefit.uncertainty.modes import Posterior

LEVELS_MM = (15.0, 30.0, 60.0)  # the mean over joints, both roots at one point
LEAST = 1e-3  # ours: of a probability in the log score, so that a pose that was not found does not cost everything


@dataclass(frozen=True)
class Scores:
    """What a report is worth."""

    peak_ratio: dict[float, float]  # by level in millimetres, the share of the known poses that were found
    brier: float  # 0 to 2; 0 where all the weight is near the true pose
    log_score: float  # minus the logarithm of the weight near the true pose, 0 to 6.9
    weights: tuple[float, ...]  # near each known pose; what is missing to 1 is near none
    reported: int


def scored(instance: NicheInstance, report: Posterior) -> Scores:
    """Return what a report is worth. Its weights are judged at the widest level."""
    heaviest = np.argsort(-report.weights, kind="stable")[:REPORTED]
    distances = instance.distances_mm(report.poses[heaviest])
    weights = report.weights[heaviest]
    near = shares(distances, weights / weights.sum(), LEVELS_MM[-1])
    return Scores(
        {level: peak_ratio(distances, level) for level in LEVELS_MM},
        brier_score(near, instance.true),
        log_score(near, instance.true),
        tuple(near.tolist()),
        len(heaviest),
    )


def peak_ratio(distances: Array, level: float) -> float:
    """Return the share of known poses that a reported one speaks for; distances (n, K) in millimetres."""
    found = _spoken_for(distances, level)
    return len(set(found[found >= 0].tolist())) / int(np.shape(distances)[1])  # CEC2013 (peak ratio)


def shares(distances: Array, weights: Array, level: float) -> Array:
    """Return the weight near each known pose (K,), of poses with weights (n,) at distances (n, K) in millimetres."""
    found = _spoken_for(distances, level)
    count = np.shape(distances)[1]
    return np.bincount(found[found >= 0], np.asarray(weights)[found >= 0], count).astype(np.float64)


def brier_score(weights: Array, true: int) -> float:
    """Return the squared error of the weights (K,) near known poses, and of what is near none of them."""
    told = np.append(weights, max(1.0 - float(np.sum(weights)), 0.0))
    told[true] -= 1.0
    return float(np.sum(told**2))  # BRIER1950 (score)


def log_score(weights: Array, true: int) -> float:
    """Return minus the natural logarithm of the weight near the true pose, at least 0.001 of it."""
    return float(-np.log(np.clip(weights[true], LEAST, 1.0)))


def _spoken_for(distances: Array, level: float) -> NDArray[np.int64]:
    """Return the known pose that each reported one speaks for (n,), -1 where it speaks for none."""
    distances = np.asarray(distances, dtype=np.float64)
    if distances.ndim != 2 or not distances.shape[1]:
        raise ValueError(f"distances must have shape (n, K), at least one known pose, got {distances.shape}")
    if not len(distances):
        return np.empty(0, dtype=np.int64)
    nearest = distances.argmin(axis=1)
    return np.where(distances.min(axis=1) <= level, nearest, -1)
