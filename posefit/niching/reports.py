"""What a search has evaluated becomes poses with weights: the plain way, for methods that have none of their own."""

import numpy as np

from posefit.arrays import Array
from posefit.fitting.problem import PoseProblem
from posefit.niching.instance import APART_MM
from posefit.uncertainty.modes import Posterior

REPORTED = 10  # poses of a report that count: whoever names everything has told nothing
TEMPERATURE = 1.0  # ours: units of silhouette cost
LOOKED_AT = 2000  # proposals of the least cost, among which the poses of a report are


def best_apart(
    problem: PoseProblem,
    proposals: Array,
    costs: Array,
    *,
    temperature: float = TEMPERATURE,
    apart: float = APART_MM,
    most: int = REPORTED,
) -> Posterior:
    """Return the best of proposals (n, d) with costs (n,), the best that is `apart` millimetres from it, and so on.

    Weights go with exp(-cost / temperature). Raises ValueError where no cost is a number.
    """
    if not temperature > 0.0:
        raise ValueError(f"temperature must be above 0, got {temperature}")
    proposals, costs = np.asarray(proposals, dtype=np.float64), np.asarray(costs, dtype=np.float64)
    if proposals.ndim != 2 or costs.shape != (len(proposals),):
        raise ValueError(f"costs must be one a proposal ({len(proposals)}), got shape {costs.shape}")
    order = np.argsort(costs, kind="stable")
    order = order[np.isfinite(costs[order])][:LOOKED_AT]
    if not len(order):
        raise ValueError(f"costs must be numbers, got none among {len(costs)}")
    poses, translations = problem.decode(proposals[order])
    joints = problem.body.skeleton.joints(poses, np.zeros((len(poses), 3)))
    left = np.ones(len(order), dtype=bool)
    chosen: list[int] = []
    while left.any() and len(chosen) < most:
        best = int(left.argmax())
        chosen.append(best)
        left &= 1e3 * np.linalg.norm(joints - joints[best], axis=-1).mean(axis=-1) > apart
    return Posterior(poses[chosen], translations[chosen], boltzmann(costs[order][chosen], temperature))


def boltzmann(costs: Array, temperature: float = TEMPERATURE) -> Array:
    """Return weights (n,) that go with exp(-cost / temperature), and sum to 1."""
    weights = np.exp((np.min(costs) - costs) / temperature)
    return np.asarray(weights / weights.sum())
