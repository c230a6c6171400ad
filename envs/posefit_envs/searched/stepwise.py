"""A search that takes a proposal at a time, beside others."""

import numpy as np
from gymnasium import error

from posefit import Minimum, Optimiser
from posefit.arrays import Array
from posefit.fitting.optimiser import minimum_of


class Stepwise:
    """An optimiser's search within a budget of whole populations, a proposal at a time.

    Raises gymnasium.error.Error where the budget does not hold one population.
    """

    def __init__(self, optimiser: Optimiser, evaluations: int) -> None:
        self._optimiser, self._left = optimiser, evaluations
        self._told: list[tuple[Array, Array]] = []
        self._ask()
        self._middle = np.zeros(self._asked.shape[1])
        if not self.waiting:
            raise error.Error(f"evaluations must hold one population of {len(self._asked)}, got {evaluations}")

    @property
    def waiting(self) -> bool:
        """Whether a proposal is to be evaluated."""
        return len(self._costs) < len(self._asked) <= self._left

    def following(self) -> Array:
        """Return the next proposal (d,); of a search that has ended, the middle of the box."""
        return self._asked[len(self._costs)] if self.waiting else self._middle

    def told(self, cost: float) -> None:
        """Take what the next proposal costs, and go on to the next population after a last one."""
        if not self.waiting:
            return
        self._costs.append(cost)
        if len(self._costs) == len(self._asked):
            costs = np.array(self._costs)
            self._left -= len(costs)
            self._told.append((self._asked, costs))
            self._optimiser.tell(self._asked, costs)
            self._ask()

    def found(self) -> Minimum:
        """Return what was found. Raises ValueError where every cost is nan."""
        return minimum_of(self._told)

    def _ask(self) -> None:
        self._asked, self._costs = self._optimiser.ask(), list[float]()
