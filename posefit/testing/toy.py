"""Small spaces to try an optimiser in, of any dimension, and costs to minimise in them."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting import box
from posefit.fitting.box import Space, Start

Rule = Callable[[Array], NDArray[np.bool_]]

TARGET = 0.3  # every coordinate of where `sphere` is least: not the centre, which is too easily found


def anywhere(proposals: Array) -> NDArray[np.bool_]:
    """Return that all proposals (n, d) are allowed."""
    return np.ones(len(proposals), dtype=bool)


def ball(proposals: Array) -> NDArray[np.bool_]:
    """Return which proposals (n, d) lie in a ball whose radius lets about a third of the box in, the target too."""
    return np.asarray((proposals**2).mean(axis=1) < 0.3)


def shell(proposals: Array) -> NDArray[np.bool_]:
    """Return which proposals (n, d) lie in a thin shell around the target: a few in a thousand."""
    return np.asarray(np.abs(((proposals - TARGET) ** 2).mean(axis=1) - 0.1) < 2e-3)


def sphere(proposals: Array) -> Array:
    """Return 50 times the mean squared distance (n,) of proposals (n, d) from the target: 0 to 100, as costs are."""
    return np.asarray(50.0 * ((proposals - TARGET) ** 2).mean(axis=1))


@dataclass(frozen=True, eq=False)
class Toy:
    """A box of `dimensions` in which `rule` says what is allowed; the first `wrapping` coordinates are periodic."""

    dimensions: int
    rule: Rule = anywhere
    start: Start | None = None
    wrapping: int = 0
    centre: Array = field(init=False, repr=False)
    half: Array = field(init=False, repr=False)
    periodic: NDArray[np.bool_] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", np.zeros(self.dimensions))
        object.__setattr__(self, "half", np.ones(self.dimensions))
        object.__setattr__(self, "periodic", np.arange(self.dimensions) < self.wrapping)

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box and are allowed (n,)."""
        return np.asarray((np.abs(proposals) <= 1.0).all(axis=1) & self.rule(proposals))

    def wrap(self, proposals: Array) -> Array:
        """Return proposals with their periodic coordinates brought into [-1, 1)."""
        return np.where(self.periodic, (proposals + 1.0) % 2.0 - 1.0, proposals)

    def towards(self, origin: Array, target: Array) -> Array:
        """Return target - origin, the short way round where a coordinate is periodic."""
        return self.wrap(target - origin)

    def draw(self, rng: np.random.Generator, count: int) -> Array:
        """Return a first population (count, d) of allowed proposals."""
        return box.draw(self, rng, count)

    def scatter(self, rng: np.random.Generator, means: Array, spread: Array) -> Array:
        """Return an allowed normal draw (n, d) around each of n allowed means."""
        return box.scatter(self, rng, means, spread)

    def repair(self, proposals: Array, home: Array) -> Array:
        """Return proposals (n, d), those that are not allowed moved towards `home` (d,)."""
        return box.repair(self, proposals, home)

    def moved(self, proposals: Array, origin: Space) -> Array:
        """Return the same proposals (n, d): all toys have one box."""
        assert origin.dimensions == self.dimensions
        return np.array(proposals)
