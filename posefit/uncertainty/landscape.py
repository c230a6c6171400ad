"""A box and the costs in it; an infeasible proposal costs infinitely much."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array


class Box(Protocol):
    """The box [-1, 1]^d, part of which is feasible."""

    @property
    def dimensions(self) -> int:
        """d."""
        ...

    @property
    def periodic(self) -> NDArray[np.bool_]:
        """Which coordinates wrap around (d,)."""
        ...

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box and are allowed (n,)."""
        ...


def wrap(box: Box, proposals: Array) -> Array:
    """Return proposals (..., d) with their periodic coordinates brought into [-1, 1)."""
    if not box.periodic.any():
        return proposals
    return np.where(box.periodic, (proposals + 1.0) % 2.0 - 1.0, proposals)


def displacement(box: Box, origin: Array, target: Array) -> Array:
    """Return target - origin (..., d), the short way round where a coordinate is periodic."""
    return wrap(box, target - origin)


@dataclass(eq=False)
class Landscape:
    """The costs of a box's proposals, with the number of evaluations."""

    box: Box
    evaluate: Callable[[Array], Array]  # costs (n,) of feasible proposals (n, d)
    evaluations: int = 0

    def costs(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d): infinite where one is infeasible, or its cost is nan."""
        feasible = self.box.feasible(proposals)
        costs = np.full(len(proposals), np.inf)
        if feasible.any():
            self.evaluations += int(feasible.sum())
            costs[feasible] = self.evaluate(proposals if feasible.all() else proposals[feasible])
        costs[np.isnan(costs)] = np.inf
        return costs
