"""What the searches share: the order in which coordinates are searched, and the poses that a frame begins with.

An optimiser does not know which coordinate turns which bone, only their order: the root's three angles first, then in
the prior `full` joints with parents before children, and in `pca` components, the strongest first.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, Space, draw_population

EVALUATIONS = 2440  # as many as SAPSO's N (C + 1)
ROOT = 3  # coordinates of the first run: yaw, pitch and roll
# ours: of the evaluations, for random poses where nothing is predicted
FIRST_SHARE = 0.25


def runs(dimensions: int, length: int) -> list[NDArray[np.int64]]:
    """Return the coordinates of each part of a pose: the root's, then runs of some length along the chain."""
    starts = (
        [0, *range(ROOT, dimensions, length), dimensions]
        if dimensions > ROOT
        else [0, dimensions]
    )
    # JOHN2010 (hierarchy)
    return [np.arange(first, last) for first, last in pairwise(starts)]


def opened(dimensions: int, layer: int, layers: int) -> int:
    """Return how many leading coordinates a layer, counted from 0, searches: the root's, then an equal share each."""
    rest = max(dimensions - ROOT, 0)
    return dimensions - rest + -(-rest * (layer + 1) // layers)  # ZHAO2008 (hierarchy)


def middle(space: Space, rng: np.random.Generator) -> Array:
    """Return the prediction (d,), or where there is none the middle of the box; a draw where that is infeasible."""
    centre = np.zeros(space.dimensions) if space.start is None else space.start.mean
    return (
        centre.copy()
        if space.feasible(centre[None])[0]
        else draw_population(space, rng, 1)[0]
    )


def first_population(space: Space, rng: np.random.Generator, evaluations: int) -> Array:
    """Return the prediction (1, d), or where there is none poses from anywhere (n, d), a share of the evaluations."""
    count = max(int(FIRST_SHARE * evaluations), 1)
    return (
        draw_population(space, rng, count)
        if space.start is None
        else middle(space, rng)[None]
    )
