"""A swarm in flight: positions, velocities and personal bests, moved so that every constraint is met."""

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit_swarm.kernels import fly, mend, redrawable, settle

FIRST_REDRAWS = 6  # ours: how many redraws are made at once at first; then all that are left


class Flock:
    """What swarms share. `moved` (n, d) are the particles after their move, which is not accepted yet.

    `rand` is fresh for every "dimension" or one "scalar" a particle (Reading S8); `redraws` of it are made before a
    particle that breaks a constraint is stopped (Reading S7).
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        particles: int,
        limits: tuple[Array, Array],
        redraws: int,
        rand: Literal["dimension", "scalar"],
    ) -> None:
        self._space, self._rng, self._limits = space, rng, limits
        self._redraws, self._scalar = redraws, rand == "scalar"
        self._everyone = np.arange(particles)
        self.moved = space.draw(rng, particles)
        self.velocity = self._first_velocities()
        self.position, self.cost = self.moved.copy(), np.full(particles, np.inf)
        self.best, self.best_cost = self.moved.copy(), np.full(particles, np.inf)

    def settle(self, proposals: Array, costs: Array, temperature: float) -> tuple[NDArray[np.bool_], int]:
        """Accept or refuse each move, remember the bests; return who was accepted (n,) and the swarm's best row."""
        if proposals.shape != self.moved.shape or len(costs) != len(self.moved):
            raise ValueError(f"tell must get the population of shape {self.moved.shape}, got {proposals.shape}")
        accepted = np.empty(len(costs), dtype=bool)
        leader = settle(
            proposals,
            np.asarray(costs, dtype=np.float64),
            self._rng.random(len(costs)),
            temperature,
            self.position,
            self.cost,
            self.best,
            self.best_cost,
            accepted,
        )
        return accepted, int(leader)

    def fly(self, omega: float, acceleration: float, swarm_best: Array) -> None:
        """Move every particle by SAPSO (1) and (2), so that it meets the constraints. Reading S7."""
        pull: tuple[Any, ...] = omega, acceleration, self.position, self.velocity, self.best, swarm_best
        pull += (*self._limits, self._space.periodic)
        feasible = self._space.feasible
        self.velocity, self.moved = self._attempt(self._everyone, pull)
        broken = np.flatnonzero(~feasible(self.moved))
        if not len(broken):
            return
        stopped = np.zeros(len(self.moved), dtype=bool)
        stopped[broken] = True
        left, many = self._redraws, FIRST_REDRAWS
        # what no draw could bring back into the box need not be drawn again
        broken = redrawable(broken, *pull)
        while left > 0 and len(broken):
            many = min(left, many)
            flown, moved = self._attempt(np.repeat(broken, many), pull)
            # SAPSO A1.2c
            still = mend(broken, feasible(moved), flown, moved, self.velocity, self.moved)
            stopped[broken], stopped[still] = False, True
            broken, left, many = still, left - many, self._redraws
        rows = np.flatnonzero(stopped)
        if len(rows):
            self._halt(rows)

    def _first_velocities(self) -> Array:
        shape, start = self.moved.shape, self._space.start
        if start is None:
            return self._rng.uniform(*self._limits, shape)
        # Reading S12: the bounds may be reversed
        low, high = np.minimum(0.0, start.velocity), np.maximum(0.0, start.velocity)
        drawn = self._rng.uniform(low, high, shape)  # SAPSO (7)
        return np.clip(drawn, *self._limits)

    def _halt(self, rows: NDArray[np.int64]) -> None:
        """Clip particles into the box and stop them; where that breaks constraint 2, they stay where they were."""
        clipped = np.minimum(np.maximum(self.moved[rows], -1.0), 1.0)
        self.moved[rows] = np.where(self._space.feasible(clipped)[:, None], clipped, self.position[rows])
        self.velocity[rows] = 0.0

    def _attempt(self, rows: NDArray[np.int64], pull: tuple[Any, ...]) -> tuple[Array, Array]:
        """Return new velocities and positions (k, d) of some particles, with fresh draws of rand()."""
        shape = (len(rows), self._space.dimensions)
        if self._scalar:  # Reading S8
            rand = np.repeat(self._rng.random((2, len(rows), 1)), shape[1], axis=2)
        else:
            rand = self._rng.random((2, *shape))
        flown, moved = np.empty(shape), np.empty(shape)
        fly(rows, rand, *pull, flown, moved)
        return flown, moved


def speed_limits(space: Space, alpha: float, kind: Literal["symmetric", "literal"]) -> tuple[Array, Array]:
    """Return the lowest and highest velocity (d,) of the unit box. SAPSO 2.2 constraint 1, Reading S9."""
    # SAPSO 2.2 velocity
    if kind == "symmetric":
        return np.full(space.dimensions, -alpha), np.full(space.dimensions, alpha)
    half = np.where(space.half > 0.0, space.half, 1.0)
    return alpha * (space.centre - space.half) / half, alpha * (space.centre + space.half) / half
