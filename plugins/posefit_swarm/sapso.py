"""Simulated-annealed particle swarm optimisation, Algorithm 1, as ask and tell.

Li, Sun, Chen and Li (2012). Attributes are named by the paper's symbols. Comments
such as SAPSO (1) mark its equations. Where the paper is silent, an Interpretation is
named: see docs/background/interpretations.md. `posefit_reproduce.sapso.letter` follows
the paper's letter.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import (
    Array,
    Space,
    at_least,
    between,
    check_tell,
    displacement,
    draw_population,
    first_that_works,
    positive,
    wrap,
)

# ours: how many more steps are drawn if the prior refuses the first; if it refuses all
# of them, the particle does not move. Interpretation S7
REDRAWS = 10

Rows = NDArray[np.int64]


class SAPSO:
    """Algorithm 1. Positions are in the box [-1, 1]^d, in which every half-range is 1.

    Settings:
        population_size (N): Size of the swarm, 1 or more. Section 5.2.
        iterations (C): Number of moves, 1 or more; they follow one evaluation of
            the first positions (Interpretation S10). Section 5.2.
        temperature (T): Initial temperature of the annealing, above 0, in units of
            the cost. Section 5.2.
        cooling (gamma): Factor on the temperature after each iteration
            (Interpretation S6), 0 to 1. Section 5.2.
        stop_temperature (T0): The search ends when the temperature falls to it, 0 or
            more; at 0 only the iterations end the search. Interpretation S5.
        inertia (A): Initial factor on the old velocity, above 0.1; it falls towards
            0.1. Section 3.1, Interpretation S5.
        acceleration (c1, c2): Factor on the pulls towards the personal best and the
            swarm's best, 0 or more. Section 3.1.
        alpha (alpha): Velocity limit as a share of each coordinate's half-range,
            above 0. Section 2.2.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 40,
        iterations: int = 60,
        temperature: float = 1.0,
        cooling: float = 0.95,
        stop_temperature: float = 0.0,
        inertia: float = 0.9,
        acceleration: float = 2.0,
        alpha: float = 0.15,
    ) -> None:
        at_least("population_size", population_size, 1)
        at_least("iterations", iterations, 1)
        positive("temperature", temperature)
        between("cooling", cooling, 0.0, 1.0)
        at_least("stop_temperature", stop_temperature, 0.0)
        between("inertia", inertia, 0.1, math.inf, ends=False)
        at_least("acceleration", acceleration, 0.0)
        positive("alpha", alpha)
        self.space = space
        self.rng = rng
        # c counts iterations; what the paper calls c is c ln(10 A) / C
        self.c = 0
        self.C = iterations
        self.waiting = 0  # proposals that wait for their costs
        self.T = temperature
        self.gamma = cooling
        self.T0 = stop_temperature
        self.A = inertia
        self.acceleration = acceleration
        self.alpha = alpha
        # the positions to be evaluated next
        self.moved = draw_population(space, rng, population_size)  # SAPSO A1.1
        self.x = self.moved.copy()
        self.cost = np.full(population_size, np.inf)
        self.pbest = self.x.copy()
        self.pbest_cost = self.cost.copy()
        self.v = first_velocities(space, rng, population_size, alpha)

    def ask(self) -> Array:
        """Return the particles (N, d) after their move.

        The array is empty once the iterations or the temperature are used up.
        """
        continues = self.c <= self.C and self.T > self.T0  # SAPSO A1.2
        self.waiting = len(self.moved) if continues else 0
        return self.moved[: self.waiting].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Accept or refuse moves by their costs (N,), update the bests, cool, move."""
        check_tell(self.waiting, proposals, costs)
        self.accept(costs)
        if self.c > 0:  # the first evaluation is not a move
            self.T *= self.gamma  # SAPSO A1.2e
        if self.c < self.C:
            self.v, self.moved = redrawn(
                self.x, self.step, lambda _, x: self.space.feasible(x), REDRAWS
            )
        self.c = self.c + 1
        self.waiting = 0

    def accept(self, costs: Array) -> int:
        """Accept or refuse the moves by their costs (N,), and update the bests.

        Return the number of accepted moves.
        """
        # infinity minus infinity is nan, which is never accepted
        with np.errstate(invalid="ignore", over="ignore"):
            # Metropolis' criterion
            chance = np.exp(np.minimum((self.cost - costs) / self.T, 0.0))
        # SAPSO A1.2d
        accepted = (costs <= self.cost) | (chance > self.rng.random(len(costs)))
        self.x[accepted] = self.moved[accepted]
        self.cost[accepted] = costs[accepted]
        better = self.cost < self.pbest_cost  # SAPSO A1.2b
        self.pbest[better] = self.x[better]
        self.pbest_cost[better] = self.cost[better]
        return int(accepted.sum())

    def inertia(self) -> float:
        """Return the inertia omega of this iteration."""
        return inertia_at(self.c, self.C, self.A)

    def step(self, rows: Rows) -> tuple[Array, Array]:
        """Return velocities and positions (k, d) of particles (k,) after a move."""
        x = self.x[rows]
        gbest = self.pbest[self.pbest_cost.argmin()]
        omega = self.inertia()
        # Interpretation S8
        phi1, phi2 = self.acceleration * self.rng.random((2, *x.shape))
        to_pbest = displacement(self.space, x, self.pbest[rows])
        to_gbest = displacement(self.space, x, gbest)
        v = omega * self.v[rows] + phi1 * to_pbest + phi2 * to_gbest  # SAPSO (1)
        return fly(self.space, x, limited(v, self.alpha))


def inertia_at(c: int, C: int, A: float) -> float:
    """Return the inertia omega of iteration c of C.

    It falls from A towards 0.1. Section 3.1.
    """
    return A / math.exp(c * math.log(10.0 * A) / C)  # SAPSO inertia


def limited(v: Array, alpha: float) -> Array:
    """Return velocities (n, d) clamped to their limit.

    Constraint 1, Interpretation S9.
    """
    return np.minimum(np.maximum(v, -alpha), alpha)  # SAPSO 2.2 velocity


def first_velocities(
    space: Space, rng: np.random.Generator, count: int, alpha: float
) -> Array:
    """Return the initial velocities (count, d) of particles.

    They point towards the prediction if the space has one.
    """
    if space.start is None:
        # ours: the paper does not give velocities without a prediction
        return rng.uniform(-alpha, alpha, (count, space.dimensions))
    v_pred = space.start.velocity
    # Interpretation S12
    low = np.minimum(v_pred, 0.0)
    high = np.maximum(v_pred, 0.0)
    # SAPSO (7)
    return limited(rng.uniform(low, high, (count, space.dimensions)), alpha)


def fly(space: Space, x: Array, v: Array) -> tuple[Array, Array]:
    """Return velocities and positions (n, d) of particles after a step from x (n, d).

    A coordinate that would leave the box stops at its side, with velocity 0.
    Constraint 1.
    """
    there = wrap(space, x + v)  # SAPSO (2)
    inside = np.minimum(np.maximum(there, -1.0), 1.0)
    return np.where(inside == there, v, 0.0), inside


def redrawn(
    x: Array,
    step: Callable[[Rows], tuple[Array, Array]],
    allowed: Callable[[Array, Array], NDArray[np.bool_]],
    redraws: int,
) -> tuple[Array, Array]:
    """Return velocities and positions (n, d) after an allowed step from x (n, d).

    If a particle's step is not allowed, `redraws` further steps are drawn in one call,
    and the first allowed one is taken. If none is allowed, the particle does not move
    and its velocity is 0. Interpretation S7. In the paper's letter, `allowed` checks
    the limits of velocities as well.

    Args:
        x: Positions (n, d).
        step: Returns the velocities and positions (k, d) of some particles (k,).
        allowed: Returns which velocities and positions (k, d) are allowed (k,).
        redraws: Number of further steps of a particle.
    """
    v, moved = step(np.arange(len(x)))
    broken = np.flatnonzero(~allowed(v, moved))  # SAPSO A1.2c
    if len(broken):
        again = step(np.repeat(broken, redraws))
        works = allowed(*again).reshape(len(broken), redraws)
        shape = (len(broken), redraws, -1)
        v[broken] = first_that_works(again[0].reshape(shape), works, 0.0)
        moved[broken] = first_that_works(again[1].reshape(shape), works, x[broken])
    return v, moved
