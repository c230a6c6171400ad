"""Uniform random search."""

import numpy as np

from posefit.plugin import Array, Space, at_least, check_tell, draw_population


class Random:
    """Draws every population uniformly from the feasible part of the box.

    Settings:
        population_size: Size of a population, 1 or more.
    """

    # other optimisers are compared with it
    baseline = True

    def __init__(
        self, space: Space, rng: np.random.Generator, *, population_size: int = 40
    ) -> None:
        at_least("population_size", population_size, 1)
        self._space = space
        self._rng = rng
        self._population_size = population_size
        self._waiting = 0

    def ask(self) -> Array:
        """Return the next population (n, d)."""
        self._waiting = self._population_size
        return draw_population(self._space, self._rng, self._population_size)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Check the call, and learn nothing."""
        check_tell(self._waiting, proposals, costs)
        self._waiting = 0
