"""Particle swarm optimisation of Kennedy and Eberhart, with constriction.

J. Kennedy, R. Eberhart, Particle swarm optimization, ICNN 1995.

M. Clerc, J. Kennedy, The particle swarm: explosion, stability, and convergence in a
multidimensional complex space, IEEE Trans. Evolutionary Computation 6(1), 2002: the
constriction.
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
)
from posefit_swarm.sapso import REDRAWS, Rows, first_velocities, fly, limited, redrawn


class PSO:
    """A particle swarm in which every particle sees the best of the whole swarm.

    Every move is accepted. Velocities are limited, and a particle that breaks a
    constraint is drawn again, as in the SAPSO paper.

    Settings:
        population_size: Size of the swarm, 1 or more.
        phi (phi): Sum of the two accelerations, above 4. Clerc and Kennedy 2002.
        alpha (alpha): Velocity limit as a share of each coordinate's half-range, above
            0. As in SAPSO.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 40,
        phi: float = 4.1,
        alpha: float = 0.15,
    ) -> None:
        at_least("population_size", population_size, 1)
        between("phi", phi, 4.0, math.inf, ends=False)
        positive("alpha", alpha)
        self.space = space
        self.rng = rng
        self.waiting = 0
        self.phi = phi
        self.chi = constriction(phi)
        self.alpha = alpha
        self.x = draw_population(space, rng, population_size)
        self.v = first_velocities(space, rng, population_size, alpha)
        self.pbest = self.x.copy()
        self.pbest_cost = np.full(population_size, np.inf)

    def ask(self) -> Array:
        """Return the particles (n, d)."""
        self.waiting = len(self.x)
        return self.x.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Update the bests and move."""
        check_tell(self.waiting, proposals, costs)
        self.waiting = 0
        better = costs < self.pbest_cost  # KENNEDY1995 (pbest, gbest)
        self.pbest[better] = self.x[better]
        self.pbest_cost[better] = costs[better]
        self.v, self.x = redrawn(
            self.x, self.step, lambda _, x: self.space.feasible(x), REDRAWS
        )

    def step(self, rows: Rows) -> tuple[Array, Array]:
        """Return velocities and positions (k, d) of particles (k,) after a move."""
        x = self.x[rows]
        gbest = self.pbest[self.pbest_cost.argmin()]
        phi1, phi2 = self.phi / 2.0 * self.rng.random((2, *x.shape))
        to_pbest = displacement(self.space, x, self.pbest[rows])
        to_gbest = displacement(self.space, x, gbest)
        v = self.v[rows] + phi1 * to_pbest + phi2 * to_gbest  # KENNEDY1995 (velocity)
        v = self.chi * v  # CLERC2002 (velocity)
        return fly(self.space, x, limited(v, self.alpha))


def constriction(phi: float) -> float:
    """Return the factor chi for accelerations with the sum phi > 4.

    With it the swarm neither explodes nor stagnates.
    """
    # CLERC2002 (constriction)
    return 2.0 / abs(2.0 - phi - math.sqrt(phi * phi - 4.0 * phi))
