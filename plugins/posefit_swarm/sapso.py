"""Simulated-annealed particle swarm optimisation: the paper's Algorithm 1."""

from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import REDRAWS, Space
from posefit.fitting.check import at_least, between, choices, positive
from posefit_swarm.swarm import ACCELERATION, ALPHA, INERTIA, SwarmState, check_swarm, inertia, speed_limits

POPULATION_SIZE = 40  # N, section 5.2
ITERATIONS = 60  # C, section 5.2
TEMPERATURE = 1.0  # T, section 5.2
COOLING = 0.95  # gamma, section 5.2
STOP_TEMPERATURE = 0.0  # T0; Interpretation S5


class SAPSO:
    """Algorithm 1 as an ask/tell optimiser. Velocities and positions are those of the unit box.

    Settings:
        population_size (N): size of the swarm, 1 or more. Section 5.2.
        iterations (C): moves of the swarm, 1 or more; it is evaluated once more (Interpretation S10). Section 5.2.
        temperature (T): of the annealing at first, above 0, in units of the cost. Section 5.2.
        cooling (gamma): factor on the temperature after each iteration, 0 to 1. Section 5.2.
        stop_temperature (T0): the search ends at or below it, 0 or more; 0 never ends it. Interpretation S5.
        inertia (A): factor on the old velocity at first, above 0.1; it falls to 0.1. Section 3.1, Interpretation S5.
        acceleration (c1, c2): of the pulls towards the personal and the swarm's best, 0 or more. Section 3.1.
        alpha (alpha): velocities stay within it times the half-range of a coordinate, above 0. Section 2.2.
        redraws: of rand() before a particle that breaks a constraint is stopped, 0 or more. Interpretation S7.
        cool: once an "iteration", or once an "acceptance", with one shared temperature. Interpretation S6.
        rand: fresh for every "dimension", or one "scalar" a particle. Interpretation S8.
        velocity_limits: "symmetric" about 0, or "literal", alpha times the range's own ends. Interpretation S9.
        rejected_velocity: of a particle whose move was refused, "kept" or "zeroed". Interpretation S11.
        velocity_check: velocities beyond their limits are "clamped", or "redrawn" as step 2c says. Interpretation S7.
        last_generation: of moves, "evaluated" or "skipped". Interpretation S10.
        variant: "paper" sets the letter of the settings that Interpretations S6 to S10 name; "default" leaves them.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = POPULATION_SIZE,
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
        velocity_check: Literal["clamped", "redrawn"] = "clamped",
        last_generation: Literal["evaluated", "skipped"] = "evaluated",
        variant: Literal["default", "paper"] = "default",
    ) -> None:
        check_swarm(population_size, iterations, inertia, acceleration, alpha, redraws)
        positive("temperature", temperature)
        between("cooling", cooling, 0.0, 1.0)
        at_least("stop_temperature", stop_temperature, 0.0)
        choices(SAPSO.__init__, locals())
        if variant == "paper":
            cool, rand, velocity_limits = "acceptance", "scalar", "literal"
            velocity_check, last_generation = "redrawn", "skipped"
        self._iterations, self._inertia, self._acceleration = iterations, inertia, acceleration
        self._last = iterations if last_generation == "evaluated" else iterations - 1  # Interpretation S10
        self._temperature, self._cooling, self._stop = temperature, cooling, stop_temperature
        self._cool_each = cool == "acceptance"
        self._kept = 1.0 if rejected_velocity == "kept" else 0.0  # Interpretation S11
        self._iteration, self._dimensions = 0, space.dimensions
        limits = speed_limits(space, alpha, velocity_limits)
        clamped = velocity_check == "clamped"
        self._swarm = SwarmState(space, rng, population_size, limits, redraws, rand, clamped)  # SAPSO A1.1

    def ask(self) -> Array:
        """Return the particles (n, d) after their move; none once the iterations or the temperature are used up."""
        if self._iteration > self._last or self._temperature <= self._stop:  # SAPSO A1.2
            return np.empty((0, self._dimensions))
        return self._swarm.moved.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Accept or refuse the move, remember the best, and move on."""
        swarm, how = self._swarm, (self._temperature, self._kept)
        if self._iteration < self._iterations:
            omega = inertia(self._iteration, self._iterations, self._inertia)
            accepted = swarm.accept_and_move(proposals, costs, *how, omega, self._acceleration)
        else:
            accepted, _ = swarm.accept(proposals, costs, *how)
        if self._iteration > 0:
            # SAPSO A1.2e
            self._temperature *= self._cooling ** (np.count_nonzero(accepted) if self._cool_each else 1)
        self._iteration += 1
