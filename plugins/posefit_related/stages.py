"""The order in which searches treat coordinates, and the poses with which they begin.

An optimiser does not know which coordinate turns which bone, only their order. The
root's three angles come first. In the prior `full`, joints follow with parents before
children; in `pca`, components follow, the strongest first.
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, Space, draw_population

EVALUATIONS = 2440  # as many as SAPSO's N (C + 1)
ROOT = 3  # coordinates of the first run: yaw, pitch and roll
# ours: share of the evaluations for random poses if there is no prediction
FIRST_SHARE = 0.25


def runs(dimensions: int, length: int) -> list[NDArray[np.int64]]:
    """Return the coordinates of each part: the root's, then runs of some length."""
    starts = [0, dimensions]
    if dimensions > ROOT:
        starts = [0, *range(ROOT, dimensions, length), dimensions]
    # JOHN2010 (hierarchy)
    return [np.arange(first, last) for first, last in pairwise(starts)]


def opened(dimensions: int, layer: int, layers: int) -> int:
    """Return the number of leading coordinates that a layer searches.

    Layers are counted from 0. Each adds an equal share to the root's coordinates.
    """
    rest = max(dimensions - ROOT, 0)
    return dimensions - rest + -(-rest * (layer + 1) // layers)  # ZHAO2008 (hierarchy)


def middle(space: Space, rng: np.random.Generator) -> Array:
    """Return the prediction (d,), or else the middle of the box.

    If that is infeasible, return a random proposal.
    """
    centre = np.zeros(space.dimensions)
    if space.start is not None:
        centre = space.start.mean
    start: Array = centre.copy()
    if not space.feasible(start[None])[0]:
        start = draw_population(space, rng, 1)[0]
    return start


def first_population(space: Space, rng: np.random.Generator, evaluations: int) -> Array:
    """Return the prediction (1, d), or else random proposals (n, d).

    Random proposals use a share of the evaluations.
    """
    if space.start is not None:
        return middle(space, rng)[None]
    count = max(int(FIRST_SHARE * evaluations), 1)
    return draw_population(space, rng, count)
