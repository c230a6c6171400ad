"""Small spaces of any dimension to try an optimiser in, and costs to minimise there."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import Start

Rule = Callable[[Array], NDArray[np.bool_]]

# every coordinate of the minimum of `sphere`: the centre would be too easy
TARGET = 0.3


def anywhere(proposals: Array) -> NDArray[np.bool_]:
    """Return True for all proposals (n, d), which are all allowed."""
    return np.ones(len(proposals), dtype=bool)


def ball(proposals: Array) -> NDArray[np.bool_]:
    """Return which proposals (n, d) lie in a ball.

    It contains about a third of the box, the target included.
    """
    return np.asarray((proposals**2).mean(axis=1) < 0.3)


def shell(proposals: Array) -> NDArray[np.bool_]:
    """Return which proposals (n, d) lie in a thin shell: a few in a thousand.

    The shell surrounds the target.
    """
    return np.asarray(np.abs(((proposals - TARGET) ** 2).mean(axis=1) - 0.1) < 2e-3)


def sphere(proposals: Array) -> Array:
    """Return the costs (n,) of proposals (n, d): 0 at the target, at most 100.

    They are 50 times the mean squared distance from the target.
    """
    return np.asarray(50.0 * ((proposals - TARGET) ** 2).mean(axis=1))


def slope(proposals: Array) -> Array:
    """Return costs (n,) of proposals (n, d) that fall to 0 in a corner of the box."""
    return np.asarray(50.0 * (1.0 + proposals.mean(axis=1)))


@dataclass(frozen=True, eq=False)
class Toy:
    """A box of `dimensions` in which `rule` decides which points are allowed.

    The first `wrapping` coordinates are periodic.
    """

    dimensions: int
    rule: Rule = anywhere
    start: Start | None = None
    wrapping: int = 0
    periodic: NDArray[np.bool_] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "periodic", np.arange(self.dimensions) < self.wrapping)

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box and are allowed (n,)."""
        return np.asarray((np.abs(proposals) <= 1.0).all(axis=1) & self.rule(proposals))
