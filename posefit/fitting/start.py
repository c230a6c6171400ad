"""Where a search starts that knows which poses a frame may show: the modes of such poses, and a distribution of them.

A plugin names them, as an `Initialiser`: `posterior(observation)` returns weighted poses, or None where it knows of
none; the search is then blind. Poses near each other are a mode. The modes are projected onto the prior's latents, and
a first population is drawn from all of them. An optimiser sees this as `start` of its space.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Start, displacement
from posefit.fitting.space import SearchSpace
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.modes import Posterior, clusters_of, poses_apart

MODES = 8  # at most
APART = 0.2  # metres, the mean over joints, beyond which poses are of different modes: what a library's poses are off


def modes_apart(skeleton: Skeleton, posterior: Posterior) -> list[tuple[float, Posterior]]:
    """Return the modes of weighted poses, the likeliest first: each with its weight and its poses, its medoid first."""
    distances = poses_apart(skeleton, posterior.poses, posterior.poses)
    clusters = clusters_of(distances, posterior.weights, APART)[:MODES]
    modes = []
    for weight, medoid, members in clusters:
        rows = np.append(medoid, members[members != medoid])
        modes.append((weight, Posterior(posterior.poses[rows], posterior.translations[rows], posterior.weights[rows])))
    return modes


def start_in(space: SearchSpace, modes: Sequence[tuple[float, Posterior]], floor: float) -> Start:
    """Return the start around modes in a space: standard deviations are those of their poses, at least a `floor`."""
    starts = [_start_of(space, weight, mode, floor) for weight, mode in modes]
    return replace(starts[0], others=starts[1:])


def _start_of(space: SearchSpace, weight: float, mode: Posterior, floor: float) -> Start:
    proposals = space.proposals(coordinates_of(space, mode.poses, mode.translations))
    away = displacement(space, proposals[0], proposals)
    shift = mode.weights @ away
    spread = np.sqrt(mode.weights @ (away - shift) ** 2)
    mean = np.clip(proposals[0] + shift, -1.0, 1.0)
    return Start(mean, np.maximum(spread, floor), np.zeros(space.dimensions), weight)


def coordinates_of(space: SearchSpace, poses: Array, translations: Array) -> Array:
    """Return the coordinates (n, d) nearest to poses (n, 66); with a tilt that was learned, it is what it expects."""
    root = poses[:, :3].copy()
    if space.tilt is not None:
        root[:, 1:] = 0.0
    parts = [root, space.prior.transform(poses[:, 3:])]
    if space.translation == "searched":
        parts.insert(1, translations)
    return np.hstack(parts)
