"""A search around a pose of the path: in the directions in which poses that are like it differ."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import Space, Start
from posefit.fitting.optimiser import Optimiser, minimise
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES
from posefit_exemplars.exemplars import Codes, Exemplars

LIKE = 600  # poses of the exemplars whose differences are searched
COMPONENTS = 28  # of them
REACH = 3.0  # standard deviations of a component to either side
YAW = np.radians(3.0)  # standard deviation; the yaws of exemplars are free
CARRIED = 0.95  # share of the last frame's offset from the path: most of it is the person's own style, which stays
SPREAD = 0.5  # standard deviations of a component with which the search begins

Make = Callable[[Space, np.random.Generator], Optimiser]


class Surroundings:
    """The `Space` around a pose (66,): a coordinate for each of `axes` (d, 66), standard deviations in radians."""

    def __init__(self, pose: Array, axes: Array, start: Start) -> None:
        self.pose, self.axes, self.start, self.dimensions = pose, axes, start, len(axes)
        self.centre, self.half = np.zeros(len(axes)), np.full(len(axes), REACH)
        self.periodic = np.zeros(len(axes), dtype=bool)

    def poses(self, proposals: Array) -> Array:
        """Return the poses (n, 66) of proposals (n, d)."""
        return np.asarray(self.pose + REACH * proposals @ self.axes)

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box (n,)."""
        return np.asarray((np.abs(proposals) <= 1.0).all(axis=1))


def surroundings(exemplars: Exemplars, pose: Array, code: Codes, off: Array) -> Surroundings:
    """Return where to search around a pose (66,) with a code (D,), from an offset `off` (66,), as far as that fits.

    The axes are the principal components of the poses of the nearest codes, the root's pitch and roll among their
    angles, but not the yaw.
    """
    apart = exemplars.squares - 2.0 * (exemplars.codes @ code)
    like = min(LIKE, len(apart))
    near = np.argpartition(apart, like - 1)[:like]
    angles = wrapped(exemplars.poses[near] - pose)
    angles[:, 0] = 0.0
    angles -= angles.mean(axis=0)
    squares, directions = np.linalg.eigh(angles.T @ angles / like)
    kept = np.arange(ANGLES - 1, max(ANGLES - 1 - COMPONENTS, 0), -1)
    kept = kept[squares[kept] > 1e-12]
    lengths = np.sqrt(squares[kept])
    axes = np.vstack([directions[:, kept].T * lengths[:, None], np.eye(1, ANGLES) * YAW])
    begin = np.append((off @ directions[:, kept]) / lengths, off[0] / YAW)
    begin = np.clip(CARRIED * begin / REACH, -2.0 / REACH, 2.0 / REACH)
    return Surroundings(pose, axes, Start(begin, np.full(len(axes), SPREAD / REACH), np.zeros(len(axes))))


def refined(
    space: Surroundings,
    cost: Callable[[Array], Array],
    make: Make,
    pull: float,
    evaluations: int,
    rng: np.random.Generator,
) -> tuple[Array, int]:
    """Return the best pose (66,) of an optimiser, and its evaluations.

    Added to the `cost` (n,) of poses (n, 66) is half the `pull` times the squared distances, in standard deviations, of
    a proposal from the path and from where the search began.
    """
    begin = space.start.mean

    def evaluate(proposals: Array) -> Array:
        away = (proposals**2).sum(axis=1) + ((proposals - begin) ** 2).sum(axis=1)
        return np.asarray(cost(space.poses(proposals)) + 0.5 * pull * REACH**2 * away)

    best = minimise(evaluate, make(space, rng), evaluations, budget_known=True)
    proposal = begin if float(evaluate(begin[None])[0]) <= best.cost else best.proposal
    return space.poses(proposal[None])[0], best.evaluations + 1
