"""The base of optimisers that are made from another library's own ask and tell."""

from abc import ABC, abstractmethod

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space, repair
from posefit.fitting.optimiser import finite_costs


class Adapter(ABC):
    """Asks a library for proposals and tells it costs: infeasible proposals are repaired, and costs are finite.

    `home` (d,) is a feasible proposal, towards which the others are moved until they are feasible.
    """

    def __init__(self, space: Space, home: Array) -> None:
        self._space, self._home = space, home
        self._asked: Array | None = None  # as the library proposed them

    @abstractmethod
    def propose(self) -> Array:
        """Return the library's next proposals (n, d), whatever is feasible; (0, d) once it has ended."""

    @abstractmethod
    def learn(self, proposals: Array, costs: Array) -> None:
        """Tell the library the finite costs (n,) of what it proposed; `proposals` (n, d) are the repaired ones."""

    def ask(self) -> Array:
        """Return the next population (n, d), the same one until its costs are told."""
        if self._asked is None:
            self._asked = self.propose()
        return repair(self._space, self._asked, self._home)

    def tell(self, proposals: Array, costs: Array) -> None:
        """Let the library learn the costs (n,). Raises ValueError where they are not those of what was asked for."""
        if self._asked is None:
            raise InputError("tell must follow ask, got costs before proposals")
        if len(costs) != len(self._asked):
            raise InputError(f"tell must get {len(self._asked)} costs, got {len(costs)}")
        self.learn(np.asarray(proposals), finite_costs(costs))
        self._asked = None
