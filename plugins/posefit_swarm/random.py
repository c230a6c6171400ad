"""Uniform random search."""

import numpy as np

from posefit import SearchSpace
from posefit.geometry.rotation import Array


class Random:
    """Draws every population uniformly from the feasible part of the box, whatever was found before."""

    def __init__(self, space: SearchSpace, rng: np.random.Generator, *, particles: int = 40) -> None:
        if particles < 1:
            raise ValueError(f"particles must be at least 1, got {particles}")
        self._space, self._rng, self._particles = space.around(space.centre), rng, particles

    def ask(self) -> Array:
        """Return the next population (n, d)."""
        return self._space.draw(self._rng, self._particles)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Learn nothing."""
