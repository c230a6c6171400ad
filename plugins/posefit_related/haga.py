"""Hierarchical annealed genetic algorithm: layers of more and more coordinates.

X. Zhao, Y. Liu, Generative tracking of 3D human motion by hierarchical annealed genetic
algorithm, Pattern Recognition 41(8), 2008. According to its abstract, principal
components of motion capture are naturally hierarchical, and the search uses this
hierarchy; an annealed genetic algorithm finds the poses.

Interpretations: each layer opens the next share of the coordinates, the root and the
leading components first. Until then a coordinate keeps its predicted value. The
probability of becoming a parent is proportional to exp(-cost / temperature). In each
layer the temperature falls geometrically, and the mutations shrink with it. Coordinate
by coordinate, children lie between their parents or a little beyond. The best
individual so far survives.
"""

import math

import numpy as np

from posefit.plugin import (
    Array,
    Space,
    at_least,
    between,
    check_tell,
    displacement,
    draw_population,
    positive,
    repair,
    weigh,
)
from posefit_related.stages import EVALUATIONS, middle, opened

# ours: temperatures of a layer's first and last generation, in units of the cost
TEMPERATURES = 5.0, 0.2
# ours: how far beyond its parents a child may lie, in units of their distance
BEYOND = 0.25


class HAGA:
    """A genetic search in layers of more and more coordinates, each annealed.

    Settings:
        population_size: Number of individuals, 2 or more.
        layers: Number of layers of coordinates, 1 or more.
        evaluations: Budget of a frame, shared among the layers, 1 or more. Ours: as
            many as SAPSO's.
        mutation: Probability that a child's coordinate is mutated, 0 to 1.
        spread: Standard deviation of the first mutations without a prediction, in
            half-ranges of the box, above 0.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 40,
        layers: int = 3,
        evaluations: int = EVALUATIONS,
        mutation: float = 0.2,
        spread: float = 0.3,
    ) -> None:
        at_least("population_size", population_size, 2)
        at_least("layers", layers, 1)
        at_least("evaluations", evaluations, 1)
        between("mutation", mutation, 0.0, 1.0)
        positive("spread", spread)
        self._space = space
        self._rng = rng
        self._size = min(population_size, evaluations)
        self._layers = layers
        self._mutation = mutation
        self._generations = max(evaluations // (self._size * layers), 1)
        self._spread = np.full(space.dimensions, spread)
        if space.start is not None:
            self._spread = space.start.spread
        self._layer = self._generation = self._waiting = 0
        self._best = middle(space, rng)
        self._best_cost = np.inf
        self._x = self._grown(np.tile(self._best, (self._size, 1)), 0)

    def ask(self) -> Array:
        """Return this generation's individuals (n, d), none after the last layer."""
        self._waiting = self._size if self._layer < self._layers else 0
        return self._x[: self._waiting].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Breed the next generation from the costs (n,) of this one.

        A new layer also opens coordinates.
        """
        check_tell(self._waiting, proposals, costs)
        costs = np.where(np.isnan(costs), np.inf, costs)
        if costs.min() < self._best_cost:
            self._best = proposals[costs.argmin()].copy()
            self._best_cost = float(costs.min())
        children = self._children(np.array(proposals), costs)
        self._generation = self._generation + 1
        self._waiting = 0
        if self._generation == self._generations:
            before = self._opened_count()
            self._generation = 0
            self._layer = self._layer + 1
            if self._layer < self._layers:
                children = self._grown(children, before)
        children[0] = self._best  # ZHAO2008 (elite)
        self._x = children

    def _opened_count(self) -> int:
        return opened(self._space.dimensions, self._layer, self._layers)

    def _grown(self, x: Array, before: int) -> Array:
        """Return individuals (n, d) with random values in newly opened coordinates."""
        now = self._opened_count()
        drawn = draw_population(self._space, self._rng, self._size)
        grown = x.copy()
        grown[:, before:now] = drawn[:, before:now]
        return repair(self._space, grown, self._best)

    def temperature(self) -> float:
        """Return the temperature of this generation, which falls geometrically."""
        first, last = TEMPERATURES
        share = self._generation / max(self._generations - 1, 1)
        return first * math.exp(share * math.log(last / first))  # ZHAO2008 (annealing)

    def _children(self, x: Array, costs: Array) -> Array:
        n, d = x.shape
        count = self._opened_count()
        fitness = weigh(costs, 1.0 / self.temperature())  # ZHAO2008 (selection)
        mothers = x[self._rng.choice(n, n, p=fitness)]
        fathers = x[self._rng.choice(n, n, p=fitness)]
        share = self._rng.uniform(-BEYOND, 1.0 + BEYOND, (n, d))
        # ZHAO2008 (crossover)
        children = mothers + share * displacement(self._space, mothers, fathers)
        # mutations cool with the selection, so that late generations refine
        width = self._spread * self.temperature() / TEMPERATURES[0]
        mutated = (self._rng.random((n, d)) < self._mutation) & (np.arange(d) < count)
        # ZHAO2008 (mutation)
        children += mutated * width * self._rng.standard_normal((n, d))
        return repair(self._space, children, mothers)
