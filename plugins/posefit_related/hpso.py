"""Hierarchical particle swarm optimisation: searches the kinematic chain by parts.

V. John, E. Trucco, S. Ivekovic, Markerless human articulated tracking using
hierarchical particle swarm optimisation, Image and Vision Computing 28(11), 2010. The
pose is searched in a fixed order along the chain. The place and orientation of the
whole body come first. Each stage is a swarm over a few coordinates, while all others
are fixed.

Interpretations: a stage is a run of neighbouring coordinates, see `stages`, and may cut
a limb. Over the components of a prior, stages go from coarse to fine. Without a
prediction, the search starts from the best of some random poses. The inertia follows
the SAPSO paper. A particle that leaves the box or becomes infeasible moves towards the
best of the previous stage.
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
)
from posefit_related.stages import EVALUATIONS, first_population, runs


class HPSO:
    """A swarm for each run of coordinates, one after another.

    The coordinates found by a stage are fixed in the stages that follow.

    Settings:
        population_size: Size of each swarm, 1 or more.
        run_length: Number of coordinates of a stage after the root's, 1 or more.
        evaluations: Budget of a frame, shared among the stages, 1 or more. Ours: as
            many as SAPSO's.
        inertia (A): First factor on the old velocity, above 0.1; it falls towards 0.1
            in each stage.
        acceleration: Factor on the pulls towards the personal best and the swarm's
            best, 0 or more.
        alpha: Velocity limit, in half-ranges of the box, above 0. Ours.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 10,
        run_length: int = 6,
        evaluations: int = EVALUATIONS,
        inertia: float = 2.0,
        acceleration: float = 2.0,
        alpha: float = 0.5,
    ) -> None:
        at_least("population_size", population_size, 1)
        at_least("run_length", run_length, 1)
        at_least("evaluations", evaluations, 1)
        between("inertia", inertia, 0.1, math.inf, ends=False)
        at_least("acceleration", acceleration, 0.0)
        positive("alpha", alpha)
        self._space = space
        self._rng = rng
        self._size = min(population_size, evaluations)
        # stage -1 evaluates the first poses
        self._runs = runs(space.dimensions, run_length)
        self._stage = -1
        self._waiting = 0
        self._x = first_population(space, rng, evaluations)
        # the first poses use a part of the budget; each stage gets an equal share of
        # the rest
        self._generations = max(
            (evaluations - len(self._x)) // (self._size * len(self._runs)), 1
        )
        self._inertia = inertia
        self._acceleration = acceleration
        self._alpha = alpha
        self._v = np.zeros_like(self._x)
        self._generation = 0
        self._estimate = self._x[0]
        self._pbest = self._x
        self._pbest_cost = np.full(len(self._x), np.inf)

    def ask(self) -> Array:
        """Return the particles (n, d) of this stage, none after the last stage."""
        self._waiting = len(self._x) if self._stage < len(self._runs) else 0
        return self._x[: self._waiting].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Update the bests and move; after a stage's last move begin the next stage."""
        check_tell(self._waiting, proposals, costs)
        self._waiting = 0
        if self._stage < 0:
            self._pbest = np.array(proposals)
            self._pbest_cost = np.where(np.isnan(costs), np.inf, costs)
        else:
            better = costs < self._pbest_cost
            self._pbest[better] = proposals[better]
            self._pbest_cost[better] = costs[better]
            self._generation += 1
            if self._generation < self._generations:
                self._move()
                return
        # JOHN2010 (handed down)
        self._estimate = self._pbest[self._pbest_cost.argmin()].copy()
        self._stage += 1
        if self._stage < len(self._runs):
            self._begin()

    def _begin(self) -> None:
        """Spread the swarm over the stage's coordinates, around the estimate so far."""
        run = self._runs[self._stage]
        x = np.tile(self._estimate, (self._size, 1))
        # JOHN2010 (stage)
        x[1:, run] = draw_population(self._space, self._rng, self._size)[1:, run]
        self._x = repair(self._space, x, self._estimate)
        self._v = np.zeros_like(x)
        self._generation = 0
        self._pbest = self._x.copy()
        self._pbest_cost = np.full(self._size, np.inf)

    def _move(self) -> None:
        run = self._runs[self._stage]
        gbest = self._pbest[self._pbest_cost.argmin()]
        # JOHN2010 (inertia)
        omega = self._inertia * (10.0 * self._inertia) ** (
            -self._generation / self._generations
        )
        phi1, phi2 = self._acceleration * self._rng.random((2, self._size, len(run)))
        to_pbest = displacement(self._space, self._x, self._pbest)[:, run]
        to_gbest = displacement(self._space, self._x, gbest)[:, run]
        v = omega * self._v[:, run] + phi1 * to_pbest + phi2 * to_gbest
        self._v[:, run] = np.clip(v, -self._alpha, self._alpha)
        self._x = repair(self._space, self._x + self._v, self._estimate)
