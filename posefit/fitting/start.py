"""Starts of a search around the poses that a plugin guesses for a frame.

The plugin is an `Initialiser`: `posterior(observation)` returns weighted poses, or None
for a blind search. Poses near each other form a mode. The modes are projected onto the
prior's latents, and a first population is drawn around all of them. An optimiser sees
this as the `start` of its space.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.space import SearchSpace
from posefit.geometry.skeleton import ANGLES, JOINTS, Skeleton
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior, clusters_of, poses_apart

MAX_MODES = 8
# Metres, mean over joints. Poses farther apart belong to different modes: a library is
# about that coarse.
MODE_RADIUS = 0.2
MODE_SPREAD = 0.08  # standard deviation of a mode, in half-ranges of the box
# Projected poses are compared in a small picture: its least side in pixels, and the
# greatest factor by which it is smaller.
MIN_SMALL_SIDE = 40
MAX_FACTOR = 4
TEMPERATURE = 2.0  # divides the costs in the small picture
INFEASIBLE_COST = 5.0  # added to the cost of a pose that the prior does not allow
# If several poses were searched: the errors that the right one still has.
JOINT_ERROR = 0.06  # metres along an axis
ANGLE_ERROR = 0.25  # radians


def modes_apart(
    skeleton: Skeleton, posterior: Posterior
) -> list[tuple[float, Posterior]]:
    """Return the modes of weighted poses, the likeliest first.

    A mode has a weight and poses, its medoid first.
    """
    distances = poses_apart(skeleton, posterior.poses, posterior.poses)
    clusters = clusters_of(distances, posterior.weights, MODE_RADIUS)[:MAX_MODES]
    modes = []
    for weight, medoid, members in clusters:
        rows = np.append(medoid, members[members != medoid])
        mode = Posterior(
            posterior.poses[rows],
            posterior.translations[rows],
            posterior.weights[rows],
        )
        modes.append((weight, mode))
    return modes


def start_in(
    cost: SilhouetteCost,
    modes: Sequence[tuple[float, Posterior]],
    evaluations: float = math.inf,
) -> Start:
    """Return the start of a search around modes, with the others; see `starts_in`."""
    first, *others = starts_in(cost, modes, evaluations)
    return replace(first, others=others)


def starts_in(
    cost: SilhouetteCost,
    modes: Sequence[tuple[float, Posterior]],
    evaluations: float = math.inf,
) -> list[Start]:
    """Return a start around each mode, the likeliest first.

    The poses of a mode are projected onto the latents, and the start is around the pose
    of least cost in a small picture. These costs give the modes new weights, because a
    space that cannot represent a pose need not be searched there.

    Args:
        cost: The cost of a proposal for the frame.
        modes: The modes, each with its weight.
        evaluations: What the costs may take, at most.
    """
    space = cost.space
    side = min(cost.silhouettes[0].size)
    factor = min(max(side // MIN_SMALL_SIDE, 1), MAX_FACTOR)
    projected = []
    for _, mode in _likeliest(modes, evaluations * factor**2):
        projected.append(
            space.proposals(coordinates_of(space, mode.poses, mode.translations))
        )
    costs = []
    for poses in projected:
        costs.append(
            cost.coarser(factor)(poses) + INFEASIBLE_COST * ~space.feasible(poses)
        )
    least = min(float(each.min()) for each in costs)
    spread = np.full(space.dimensions, MODE_SPREAD)
    velocity = np.zeros(space.dimensions)
    starts = []
    for poses, each in zip(projected, costs, strict=True):
        weight = float(np.exp((least - each) / TEMPERATURE).sum())
        starts.append(Start(poses[each.argmin()], spread, velocity, weight))
    return sorted(starts, key=lambda start: -start.weight)


def _likeliest(
    modes: Sequence[tuple[float, Posterior]], most: float
) -> Sequence[tuple[float, Posterior]]:
    """Return modes with the same share of the poses of each, `most` poses in all.

    Each keeps its medoid and the poses with the highest weights.
    """
    share = most / sum(len(mode.poses) for _, mode in modes)
    if share >= 1.0:
        return modes
    fewer = []
    for weight, mode in modes:
        count = max(int(share * len(mode.poses)), 1)
        others = 1 + np.argsort(-mode.weights[1:], kind="stable")[: count - 1]
        rows = np.append(0, others)
        kept = Posterior(mode.poses[rows], mode.translations[rows], mode.weights[rows])
        fewer.append((weight, kept))
    return fewer


def coordinates_of(space: SearchSpace, poses: Array, translations: Array) -> Array:
    """Return the coordinates (n, d) nearest to poses (n, 66).

    A learned tilt is replaced by the tilt expected for the latents.
    """
    root = poses[:, :3].copy()
    if space.tilt is not None:
        root[:, 1:] = 0.0
    parts = [root, space.prior.transform(poses[:, 3:])]
    if space.translation == "searched":
        parts.insert(1, translations)
    return np.hstack(parts)


def posterior_of(poses: Array, places: Array, costs: Array) -> Posterior:
    """Return the posterior of a frame from the results of its searches.

    Args:
        poses: (n, 66) the pose that each search found.
        places: (n, 3) metres, their roots.
        costs: (n,) their costs. Cheaper poses are likelier.
    """
    errors = Recalibration(
        np.full(len(JOINTS), JOINT_ERROR), np.full(ANGLES, ANGLE_ERROR)
    )
    weights = np.exp((costs.min() - costs) / TEMPERATURE)
    return Posterior(poses, places, weights, coherent=True, recalibration=errors)
