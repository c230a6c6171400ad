"""A search around a pose of the path: in the directions in which poses that are like it differ."""

from collections.abc import Callable
from dataclasses import dataclass, field

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
CARRIED = 0.95  # of what the frame before was off the path: most of it is the person's own way, which stays
SPREAD = 0.5  # standard deviations of a component with which the search begins

Make = Callable[[Space, np.random.Generator], Optimiser]


@dataclass(frozen=True, eq=False)
class Surroundings:
    """The box around a pose: a coordinate a component, and one for the yaw. A `Space`."""

    pose: Array  # (66,)
    axes: Array = field(repr=False)  # (d, 66) radians: a component's standard deviation each, and the yaw's
    start: Start
    half: Array = field(init=False, repr=False)
    centre: Array = field(init=False, repr=False)
    periodic: NDArray[np.bool_] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "half", np.full(self.dimensions, REACH))
        object.__setattr__(self, "centre", np.zeros(self.dimensions))
        object.__setattr__(self, "periodic", np.zeros(self.dimensions, dtype=bool))

    @property
    def dimensions(self) -> int:
        """How many coordinates a proposal has."""
        return len(self.axes)

    def poses(self, proposals: Array) -> Array:
        """Return the poses (n, 66) of proposals (n, d)."""
        return np.asarray(self.pose + REACH * proposals @ self.axes)

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box (n,)."""
        return np.asarray((np.abs(proposals) <= 1.0).all(axis=1))

    def moved(self, proposals: Array, origin: "Surroundings") -> Array:
        """Return the proposals (n, d) that mean here what these mean in `origin`."""
        return np.asarray(np.clip((origin.centre + origin.half * proposals) / self.half, -1.0, 1.0))


def surroundings(exemplars: Exemplars, pose: Array, code: Codes, off: Array) -> Surroundings:
    """Return where to search around a pose (66,) with a code (D,), beginning `off` (66,) from it, as far as that fits.

    The axes are the principal components of what the poses of the nearest codes are off their mean, the root's pitch
    and roll among their angles, but not the yaw.
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
    d = len(axes)
    return Surroundings(pose, axes, Start(begin, np.full(d, SPREAD / REACH), np.zeros(d)))


def refined(
    space: Surroundings,
    cost: Callable[[Array], Array],
    make: Make,
    pull: float,
    evaluations: int,
    rng: np.random.Generator,
) -> tuple[Array, int]:
    """Return the pose (66,) that an optimiser finds, and its evaluations.

    Added to the `cost` (n,) of poses (n, 66) is the pull, half of it times the squares of how many standard deviations
    a proposal is from the path, and as much from where the search began.
    """
    begin = space.start.mean

    def evaluate(proposals: Array) -> Array:
        away = (proposals**2).sum(axis=1) + ((proposals - begin) ** 2).sum(axis=1)
        return np.asarray(cost(space.poses(proposals)) + 0.5 * pull * REACH**2 * away)

    found = minimise(evaluate, make(space, rng), evaluations, budget_known=True)
    if float(evaluate(begin[None])[0]) <= found.cost:
        return space.poses(begin[None])[0], found.evaluations + 1
    return space.poses(found.proposal[None])[0], found.evaluations + 1
