"""Where a search starts that knows which poses a frame may show: the modes of such poses, and a distribution of them.

A plugin names them, as an `Initialiser`: `posterior(observation)` returns weighted poses, or None where it knows of
none; the search is then blind. Poses near each other are a mode. The modes are projected onto the prior's latents, and
a first population is drawn from all of them. An optimiser sees this as `start` of its space.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.modes import Posterior, clusters_of, poses_apart

MODES = 8  # at most
APART = 0.2  # metres, the mean over joints, beyond which poses are of different modes: what a library's poses are off
SPREAD = 0.08  # of a mode in half-ranges of the box: standard deviation
SMALL_SIDE = 60  # pixels of the picture in which projected poses are compared, at least
TEMPERATURE = 2.0  # divides their costs
INFEASIBLE = 5.0  # added to the cost of a pose that is none to the prior


def modes_apart(skeleton: Skeleton, posterior: Posterior) -> list[tuple[float, Posterior]]:
    """Return the modes of weighted poses, the likeliest first: each with its weight and its poses, its medoid first."""
    distances = poses_apart(skeleton, posterior.poses, posterior.poses)
    clusters = clusters_of(distances, posterior.weights, APART)[:MODES]
    modes = []
    for weight, medoid, members in clusters:
        rows = np.append(medoid, members[members != medoid])
        modes.append((weight, Posterior(posterior.poses[rows], posterior.translations[rows], posterior.weights[rows])))
    return modes


def start_in(problem: PoseProblem, modes: Sequence[tuple[float, Posterior]]) -> Start:
    """Return the start of a problem around modes of what it may show, the likeliest first.

    Each mode is around that of its poses which, projected onto the latents, costs least in a small picture; these costs
    weigh the modes again, as a space that cannot show a pose need not be searched there.
    """
    space, factor = problem.space, max(min(problem.silhouettes[0].size) // SMALL_SIDE, 1)
    projected = [space.proposals(coordinates_of(space, mode.poses, mode.translations)) for _, mode in modes]
    costs = [problem.coarser(factor).evaluate(poses) + INFEASIBLE * ~space.feasible(poses) for poses in projected]
    least = min(float(each.min()) for each in costs)
    weights = [float(np.exp((least - each) / TEMPERATURE).sum()) for each in costs]
    spread, still = np.full(space.dimensions, SPREAD), np.zeros(space.dimensions)
    starts = [
        Start(poses[each.argmin()], spread, still, weight)
        for poses, each, weight in zip(projected, costs, weights, strict=True)
    ]
    starts.sort(key=lambda start: -start.weight)
    return replace(starts[0], others=starts[1:])


def coordinates_of(space: SearchSpace, poses: Array, translations: Array) -> Array:
    """Return the coordinates (n, d) nearest to poses (n, 66); with a tilt that was learned, it is what it expects."""
    root = poses[:, :3].copy()
    if space.tilt is not None:
        root[:, 1:] = 0.0
    parts = [root, space.prior.transform(poses[:, 3:])]
    if space.translation == "searched":
        parts.insert(1, translations)
    return np.hstack(parts)
