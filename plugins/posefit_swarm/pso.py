"""Particle swarm optimisation: Kennedy and Eberhart's, with a falling inertia or Clerc and Kennedy's constriction.

J. Kennedy, R. Eberhart, Particle swarm optimization, ICNN 1995; M. Clerc, J. Kennedy, The particle swarm: explosion,
stability, and convergence in a multidimensional complex space, IEEE Trans. Evolutionary Computation 6(1), 2002.
"""

import math
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import REDRAWS, Space
from posefit.fitting.check import choices
from posefit_swarm.swarm import ACCELERATION, ALPHA, INERTIA, SwarmState, check_swarm, inertia, speed_limits

POPULATION_SIZE = 40
ITERATIONS = 60
PHI = 4.1  # Clerc and Kennedy's usual sum of the two accelerations; chi is then 0.7298
ALWAYS = math.inf  # a temperature at which every move is accepted


def constriction(phi: float) -> float:
    """Return chi of two accelerations that sum up to phi > 4: the swarm neither explodes nor stands still."""
    return 2.0 / abs(2.0 - phi - math.sqrt(phi * phi - 4.0 * phi))  # CLERC2002 (constriction)


class PSO:
    """A particle swarm with the whole swarm as everybody's neighbourhood; every move is accepted.

    Velocities are limited, and a particle that breaks a constraint is redrawn, as in the SAPSO paper.

    Settings:
        population_size (N): size of the swarm, 1 or more.
        iterations (C): over which an "inertia" falls, 1 or more.
        velocity: "constricted" by chi; or with an "inertia" that falls as SAPSO's does; or the "original", all kept.
        phi (phi): sum of both accelerations where velocities are constricted, above 4. Clerc and Kennedy 2002.
        inertia (A): factor on the old velocity at first, where that is "inertia", above 0.1. As SAPSO.
        acceleration (c1, c2): of either pull, where velocities are not constricted, 0 or more. Kennedy 1995.
        alpha (alpha): velocities stay within it times the half-range of the box, above 0. As SAPSO.
        redraws: of rand() before a particle that breaks a constraint is stopped, 0 or more. As SAPSO.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = POPULATION_SIZE,
        iterations: int = ITERATIONS,
        velocity: Literal["constricted", "inertia", "original"] = "constricted",
        phi: float = PHI,
        inertia: float = INERTIA,
        acceleration: float = ACCELERATION,
        alpha: float = ALPHA,
        redraws: int = REDRAWS,
    ) -> None:
        check_swarm(population_size, iterations, inertia, acceleration, alpha, redraws)
        choices(PSO.__init__, locals())
        if not phi > 4.0:
            raise InputError(f"phi must be above 4, got {phi}")
        self._kind, self._chi, self._phi = velocity, constriction(phi), phi
        self._inertia, self._acceleration = inertia, acceleration
        self._iteration, self._iterations = 0, iterations
        limits = speed_limits(space, alpha, "symmetric")
        self._swarm = SwarmState(space, rng, population_size, limits, redraws, "dimension")

    def ask(self) -> Array:
        """Return the particles (n, d) after their move."""
        return self._swarm.moved.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Remember the bests and move on."""
        self._swarm.accept_and_move(
            proposals, costs, ALWAYS, 1.0, *self._weights(self._iteration)
        )  # KENNEDY1995 (pbest, gbest)
        self._iteration += 1

    def _weights(self, step: int) -> tuple[float, float]:
        """Return, of an iteration, what multiplies the old velocity, and each of the two random pulls."""
        if self._kind == "constricted":
            return self._chi, self._chi * self._phi / 2.0  # CLERC2002 (velocity)
        if self._kind == "original":
            return 1.0, self._acceleration  # KENNEDY1995 (velocity)
        return inertia(min(step, self._iterations), self._iterations, self._inertia), self._acceleration
