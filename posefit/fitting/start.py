"""Where a search starts when a plugin guesses which poses a frame may show: their modes, and draws around them.

The plugin is an `Initialiser`: `posterior(observation)` returns weighted poses, or None where it knows of none; the
search is then blind. Poses near each other are a mode. The modes are projected onto the prior's latents, and
a first population is drawn from all of them. An optimiser sees this as `start` of its space.
"""

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
# metres, the mean over joints, beyond which poses are of different modes: a library is
# that rough
MODE_RADIUS = 0.2
MODE_SPREAD = 0.08  # standard deviation of a mode, in half-ranges of the box
# pixels of the picture in which projected poses are compared, and by how much it is
# smaller at most
MIN_SMALL_SIDE = 40
MAX_FACTOR = 4
TEMPERATURE = 2.0  # divides their costs
INFEASIBLE_COST = 5.0  # added to the cost of a pose that the prior does not allow
# metres along an axis, and radians, that the right one of searched poses is off
JOINT_ERROR = 0.06
ANGLE_ERROR = 0.25


def modes_apart(
    skeleton: Skeleton, posterior: Posterior
) -> list[tuple[float, Posterior]]:
    """Return the modes of weighted poses, the likeliest first: each with its weight and its poses, its medoid first."""
    distances = poses_apart(skeleton, posterior.poses, posterior.poses)
    clusters = clusters_of(distances, posterior.weights, MODE_RADIUS)[:MAX_MODES]
    modes = []
    for weight, medoid, members in clusters:
        rows = np.append(medoid, members[members != medoid])
        modes.append(
            (
                weight,
                Posterior(
                    posterior.poses[rows],
                    posterior.translations[rows],
                    posterior.weights[rows],
                ),
            )
        )
    return modes


def start_in(cost: SilhouetteCost, modes: Sequence[tuple[float, Posterior]]) -> Start:
    """Return the start of a search around modes of what it may show, the likeliest first: see `starts_in`."""
    first, *others = starts_in(cost, modes)
    return replace(first, others=others)


def starts_in(
    cost: SilhouetteCost, modes: Sequence[tuple[float, Posterior]]
) -> list[Start]:
    """Return a start around each mode of what a search may show, the likeliest first.

    Each mode is around that of its poses which, projected onto the latents, costs least in a small picture; these costs
    weigh the modes again, as a space that cannot show a pose need not be searched there.
    """
    space = cost.space
    side = min(cost.silhouettes[0].size)
    factor = min(max(side // MIN_SMALL_SIDE, 1), MAX_FACTOR)
    projected = [
        space.proposals(coordinates_of(space, mode.poses, mode.translations))
        for _, mode in modes
    ]
    costs = [
        cost.coarser(factor)(poses) + INFEASIBLE_COST * ~space.feasible(poses)
        for poses in projected
    ]
    least = min(float(each.min()) for each in costs)
    weights = [float(np.exp((least - each) / TEMPERATURE).sum()) for each in costs]
    spread = np.full(space.dimensions, MODE_SPREAD)
    velocity = np.zeros(space.dimensions)
    starts = [
        Start(poses[each.argmin()], spread, velocity, weight)
        for poses, each, weight in zip(projected, costs, weights, strict=True)
    ]
    return sorted(starts, key=lambda start: -start.weight)


def coordinates_of(space: SearchSpace, poses: Array, translations: Array) -> Array:
    """Return the coordinates (n, d) nearest to poses (n, 66); a learned tilt is the one expected of their latents."""
    root = poses[:, :3].copy()
    if space.tilt is not None:
        root[:, 1:] = 0.0
    parts = [root, space.prior.transform(poses[:, 3:])]
    if space.translation == "searched":
        parts.insert(1, translations)
    return np.hstack(parts)


def posterior_of(poses: Array, places: Array, costs: Array) -> Posterior:
    """Return what one frame may show, by the poses (n, 66) at which its searches ended: cheaper ones are likelier."""
    errors = Recalibration(
        np.full(len(JOINTS), JOINT_ERROR), np.full(ANGLES, ANGLE_ERROR)
    )
    weights = np.exp((costs.min() - costs) / TEMPERATURE)
    return Posterior(poses, places, weights, coherent=True, recalibration=errors)
