"""Simulated-annealed particle swarm optimisation: the paper's Algorithm 1."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from posefit import SearchSpace
from posefit.geometry.rotation import Array
from posefit_swarm.swarm import ACCELERATION, ALPHA, INERTIA, fly, inertia, mend, redrawable, settle

PARTICLES = 40  # N, section 5.2
ITERATIONS = 60  # C, section 5.2
TEMPERATURE = 1.0  # T, section 5.2
COOLING = 0.95  # gamma, section 5.2
STOP_TEMPERATURE = 0.0  # T0; Reading S5
REDRAWS = 100  # Reading S7
FIRST_REDRAWS = 6  # ours: how many of them are drawn at once; then all that are left
CHOICES = (
    ("iteration", "acceptance"),
    ("dimension", "scalar"),
    ("symmetric", "literal"),
    ("kept", "zeroed"),
)


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
        space: SearchSpace,
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
        _check(particles, iterations, inertia, cool, rand, velocity_limits, rejected_velocity)
        self._space, self._rng = space, rng
        self._iterations, self._inertia, self._acceleration = iterations, inertia, acceleration
        self._temperature, self._cooling, self._stop = temperature, cooling, stop_temperature
        self._redraws, self._cool_each, self._scalar = redraws, cool == "acceptance", rand == "scalar"
        self._zero_rejected = rejected_velocity == "zeroed"
        self._low, self._high = _velocity_limits(space, alpha, velocity_limits)
        self._iteration, self._everyone = 0, np.arange(particles)
        self._moved = space.draw(rng, particles)  # SAPSO A1.1
        self._velocity = self._first_velocities()
        self._position, self._cost = self._moved.copy(), np.full(particles, np.inf)
        self._best, self._best_cost = self._moved.copy(), np.full(particles, np.inf)

    def ask(self) -> Array:
        """Return the particles (n, d) after their move; none once the iterations or the temperature are used up."""
        # Reading S10: the last generation is evaluated too
        if self._iteration > self._iterations or self._temperature <= self._stop:  # SAPSO A1.2
            return np.empty((0, self._space.dimensions))
        return self._moved.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Accept or refuse the move, remember the best, and fly on."""
        accepted = np.empty(len(costs), dtype=bool)
        leader = settle(
            proposals,
            np.asarray(costs, dtype=np.float64),
            self._rng.random(len(costs)),
            self._temperature,
            self._position,
            self._cost,
            self._best,
            self._best_cost,
            accepted,
        )
        if self._zero_rejected:
            self._velocity[~accepted] = 0.0
        if self._iteration > 0:
            # SAPSO A1.2e, Reading S6
            self._temperature *= self._cooling ** (np.count_nonzero(accepted) if self._cool_each else 1)
        if self._iteration < self._iterations:
            self._fly(self._best[leader].copy())
        self._iteration += 1

    def _first_velocities(self) -> Array:
        shape = self._moved.shape
        start = self._space.start
        if start is None:
            return self._rng.uniform(self._low, self._high, shape)
        # Reading S12: the bounds may be reversed
        low, high = np.minimum(0.0, start.velocity), np.maximum(0.0, start.velocity)
        drawn = self._rng.uniform(low, high, shape)  # SAPSO (7)
        return np.clip(drawn, self._low, self._high)

    def _fly(self, swarm_best: Array) -> None:
        """Move every particle by (1) and (2), so that it meets the constraints. Reading S7."""
        pull, feasible = self._pull(swarm_best), self._space.feasible
        self._velocity, self._moved = self._attempt(self._everyone, pull)
        broken = np.flatnonzero(~feasible(self._moved))
        if not len(broken):
            return
        stopped = np.zeros(len(self._moved), dtype=bool)
        stopped[broken] = True
        left, many = self._redraws, FIRST_REDRAWS
        # what no draw could bring back into the box need not be drawn again
        broken = redrawable(broken, *pull)
        while left > 0 and len(broken):
            many = min(left, many)
            flown, moved = self._attempt(np.repeat(broken, many), pull)
            # SAPSO A1.2c
            still = mend(broken, feasible(moved), flown, moved, self._velocity, self._moved)
            stopped[broken], stopped[still] = False, True
            broken, left, many = still, left - many, self._redraws
        rows = np.flatnonzero(stopped)
        if len(rows):
            self._halt(rows)

    def _halt(self, rows: NDArray[np.int64]) -> None:
        """Clip particles into the box and stop them; where that breaks constraint 2, they stay where they were."""
        clipped = np.minimum(np.maximum(self._moved[rows], -1.0), 1.0)
        self._moved[rows] = np.where(self._space.feasible(clipped)[:, None], clipped, self._position[rows])
        self._velocity[rows] = 0.0

    def _pull(self, swarm_best: Array) -> tuple[Any, ...]:
        """Return everything but rand() that (1) depends on."""
        omega = inertia(self._iteration, self._iterations, self._inertia)
        limits = self._low, self._high, self._space.periodic
        return omega, self._acceleration, self._position, self._velocity, self._best, swarm_best, *limits

    def _attempt(self, rows: NDArray[np.int64], pull: tuple[Any, ...]) -> tuple[Array, Array]:
        """Return new velocities and positions (k, d) of some particles, with fresh draws of rand()."""
        shape = (len(rows), self._space.dimensions)
        if self._scalar:  # Reading S8
            rand = np.repeat(self._rng.random((2, len(rows), 1)), shape[1], axis=2)
        else:
            rand = self._rng.random((2, *shape))
        flown, moved = np.empty(shape), np.empty(shape)
        fly(rows, rand, *pull, flown, moved)  # type: ignore[call-arg]
        return flown, moved


def _velocity_limits(space: SearchSpace, alpha: float, kind: str) -> tuple[Array, Array]:
    """Return the lowest and highest velocity (d,) of the unit box. SAPSO 2.2 constraint 1, Reading S9."""
    # SAPSO 2.2 velocity
    if kind == "symmetric":
        return np.full(space.dimensions, -alpha), np.full(space.dimensions, alpha)
    half = np.where(space.half > 0.0, space.half, 1.0)
    return alpha * (space.centre - space.half) / half, alpha * (space.centre + space.half) / half


def _check(particles: int, iterations: int, first_inertia: float, *choices: str) -> None:
    for name, value in (("particles", particles), ("iterations", iterations)):
        if value < 1:
            raise ValueError(f"{name} must be at least 1, got {value}")
    if first_inertia <= 0.1:
        raise ValueError(f"inertia must be above 0.1, got {first_inertia}")
    names = ("cool", "rand", "velocity_limits", "rejected_velocity")
    for name, choice, known in zip(names, choices, CHOICES, strict=True):
        if choice not in known:
            raise ValueError(f"{name} must be one of {', '.join(known)}, got {choice!r}")
