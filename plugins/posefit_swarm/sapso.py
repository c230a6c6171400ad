"""Simulated-annealed particle swarm optimisation: the paper's Algorithm 1."""

from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import REDRAWS, Space
from posefit.fitting.check import at_least, between, one_of, positive
from posefit_swarm.flock import Flock, speed_limits
from posefit_swarm.swarm import ACCELERATION, ALPHA, INERTIA, inertia

PARTICLES = 40  # N, section 5.2
ITERATIONS = 60  # C, section 5.2
TEMPERATURE = 1.0  # T, section 5.2
COOLING = 0.95  # gamma, section 5.2
STOP_TEMPERATURE = 0.0  # T0; Reading S5


class SAPSO:
    """Algorithm 1 as an ask/tell optimiser. Velocities and positions are those of the unit box.

    Settings beyond the paper's constants choose between readings of it:
    `cool` once an "iteration" or once an "acceptance", with one shared temperature (Reading S6);
    `redraws` of rand() before a particle that breaks a constraint is stopped (Reading S7);
    `rand` fresh for every "dimension" or one "scalar" a particle (Reading S8);
    `velocity_limits` "symmetric" about 0 or "literal", alpha times the range's own ends (Reading S9);
    `rejected_velocity` "kept" or "zeroed" (Reading S11).
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        particles: int = PARTICLES,
        iterations: int = ITERATIONS,
        temperature: float = TEMPERATURE,
        cooling: float = COOLING,
        stop_temperature: float = STOP_TEMPERATURE,
        inertia: float = INERTIA,
        acceleration: float = ACCELERATION,
        alpha: float = ALPHA,
        redraws: int = REDRAWS,
        cool: Literal["iteration", "acceptance"] = "iteration",
        rand: Literal["dimension", "scalar"] = "dimension",
        velocity_limits: Literal["symmetric", "literal"] = "symmetric",
        rejected_velocity: Literal["kept", "zeroed"] = "kept",
    ) -> None:
        _check(particles, iterations, temperature, cooling, stop_temperature, inertia, acceleration, alpha, redraws)
        one_of("cool", cool, ("iteration", "acceptance"))
        one_of("rand", rand, ("dimension", "scalar"))
        one_of("velocity_limits", velocity_limits, ("symmetric", "literal"))
        one_of("rejected_velocity", rejected_velocity, ("kept", "zeroed"))
        self._iterations, self._inertia, self._acceleration = iterations, inertia, acceleration
        self._temperature, self._cooling, self._stop = temperature, cooling, stop_temperature
        self._cool_each, self._zero_rejected = cool == "acceptance", rejected_velocity == "zeroed"
        self._iteration, self._dimensions = 0, space.dimensions
        limits = speed_limits(space, alpha, velocity_limits)
        self._flock = Flock(space, rng, particles, limits, redraws, rand)  # SAPSO A1.1

    def ask(self) -> Array:
        """Return the particles (n, d) after their move; none once the iterations or the temperature are used up."""
        # Reading S10: the last generation is evaluated too
        if self._iteration > self._iterations or self._temperature <= self._stop:  # SAPSO A1.2
            return np.empty((0, self._dimensions))
        return self._flock.moved.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Accept or refuse the move, remember the best, and fly on."""
        flock = self._flock
        accepted, leader = flock.settle(proposals, costs, self._temperature)
        if self._zero_rejected:
            flock.velocity[~accepted] = 0.0
        if self._iteration > 0:
            # SAPSO A1.2e, Reading S6
            self._temperature *= self._cooling ** (np.count_nonzero(accepted) if self._cool_each else 1)
        if self._iteration < self._iterations:
            omega = inertia(self._iteration, self._iterations, self._inertia)
            flock.fly(omega, self._acceleration, flock.best[leader].copy())
        self._iteration += 1


def _check(
    particles: int,
    iterations: int,
    temperature: float,
    cooling: float,
    stop_temperature: float,
    first_inertia: float,
    acceleration: float,
    alpha: float,
    redraws: int,
) -> None:
    at_least("particles", particles, 1)
    at_least("iterations", iterations, 1)
    positive("temperature", temperature)
    between("cooling", cooling, 0.0, 1.0)
    at_least("stop_temperature", stop_temperature, 0.0)
    if not first_inertia > 0.1:
        raise ValueError(f"inertia must be above 0.1, got {first_inertia}")
    at_least("acceleration", acceleration, 0.0)
    positive("alpha", alpha)
    at_least("redraws", redraws, 0)
