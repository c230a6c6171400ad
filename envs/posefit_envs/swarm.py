"""What particle swarms share: inertia, speed limits, and a state that moves so that every constraint is met."""

import math
from copy import copy
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.fitting.box import Space, draw_population, extent
from posefit.fitting.check import at_least, positive
from posefit_envs.swarm_kernels import FIRST_REDRAWS, accept, move, repair

INERTIA = 0.9  # A; Interpretation S5: the paper gives none, and it must be above 0.1
ACCELERATION = 2.0  # c1 = c2, section 3.1
ALPHA = 0.15  # section 2.2
TEMPERATURE, COOLING = 1.0, 0.95  # T and gamma, section 5.2


def inertia(step: int, steps: int, first: float = INERTIA) -> float:
    """Return omega = A / e^c at c = step ln(10 A) / steps: from A down to 0.1. SAPSO inertia."""
    return first / math.exp(step * math.log(10.0 * first) / steps)  # SAPSO inertia


SPARE = 2048  # ours: how many numbers are drawn at once for redraws, beside those that one particle may need

_EACH = ("moved", "velocity", "position", "cost", "best", "best_cost")  # what every particle has

Pull = tuple[float, float, Array]  # omega, the acceleration c1 = c2, and the swarm's best (d,)


class SwarmState:
    """The state of a swarm: `moved` (n, d) are the particles after their move, which is not accepted yet.

    `rand` is fresh for every "dimension" or one "scalar" a particle (Interpretation S8). What breaks a constraint has
    it drawn again, at most `redraws` times, before the particle is stopped (Interpretation S7). Velocities are
    `clamped` to their limits, or redrawn beyond them.

    Constraint 1: only the coordinate that left the box is drawn again, which has the distribution of drawing the whole
    particle again. Given positions, velocities and bests, a particle's next coordinates X_1 ... X_d are independent,
    each with draws of its own, and the box is the product of intervals B_1 ... B_d. So P(X | X in the box) is the
    product of all P(X_j | X_j in B_j), and each of these is what drawing X_j until it lies in B_j gives. The limit is
    each coordinate's own: a particle is stopped for a coordinate that fails in all its redraws, and not because no
    redraw brings all coordinates back together. A coordinate that no rand() brings back stops its particle at once.

    Constraint 2 is no product, so a particle that breaks it is drawn again as a whole, every coordinate until it is in
    the box: P(X | X in the box and feasible). A "scalar" makes a particle's coordinates depend on each other, and so
    the whole particle is drawn again for either constraint.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        population_size: int,
        limits: tuple[Array, Array],
        redraws: int,
        rand: Literal["dimension", "scalar"],
        clamped: bool = True,
    ) -> None:
        self._space, self._rng, self._limits, self._clamped = space, rng, limits, clamped
        self._redraws, self._scalar = redraws, rand == "scalar"
        self._coordinate_redraws = 0 if self._scalar else redraws  # of a coordinate by itself
        self._spare, self.used = np.empty(0), 0  # random numbers for those redraws
        self._all_rows = np.arange(population_size)
        self.moved = draw_population(space, rng, population_size)
        self.velocity = self._first_velocities()
        self.position, self.cost = self.moved.copy(), np.full(population_size, np.inf)
        self.best, self.best_cost = self.moved.copy(), np.full(population_size, np.inf)
        # room for the next velocities, and for particles stopped at the border
        self._next_velocity, self._stopped = np.empty_like(self.moved), np.zeros(population_size, dtype=bool)

    def accept(
        self, proposals: Array, costs: Array, temperature: float, kept: float = 1.0
    ) -> tuple[NDArray[np.bool_], int]:
        """Accept or refuse each move, remember the bests; return which were accepted (n,) and the swarm's best row.

        `proposals` are what `moved` was. A particle whose move is refused keeps `kept` times its velocity.
        """
        costs, accepted = self._checked(proposals, costs), np.empty(len(self.moved), dtype=bool)
        chances = self._rng.random(len(costs))
        return accepted, accept(self.moved, costs, chances, temperature, kept, self.arrays(), accepted)

    def move(self, omega: float, acceleration: float, swarm_best: Array) -> None:
        """Move every particle by SAPSO (1) and (2), so that it meets the constraints. Interpretation S7."""
        self._finish(self._draws(len(self.moved)), (omega, acceleration, swarm_best))

    def accept_and_move(
        self, proposals: Array, costs: Array, temperature: float, kept: float, omega: float, acceleration: float
    ) -> NDArray[np.bool_]:
        """Accept or refuse, then move towards the best, with one block of draws; return which were accepted (n,)."""
        costs, accepted = self._checked(proposals, costs), np.empty(len(self.moved), dtype=bool)
        rand = self._draws(len(costs), len(costs))
        leader = accept(self.moved, costs, rand, temperature, kept, self.arrays(), accepted)
        self._finish(rand, (omega, acceleration, self.best[leader]))
        return accepted

    def subset(self, rows: NDArray[np.int64]) -> "SwarmState":
        """Return some particles (k,) as a state of their own, which draws from the same generator."""
        part = copy(self)
        for name in _EACH:
            setattr(part, name, getattr(self, name)[rows])
        part._all_rows = np.arange(len(rows))
        part._next_velocity, part._stopped = np.empty_like(part.moved), np.zeros(len(rows), dtype=bool)
        return part

    def update(self, rows: NDArray[np.int64], part: "SwarmState") -> None:
        """Take back what `subset` returned for these rows, as it is now."""
        for name in _EACH:
            getattr(self, name)[rows] = getattr(part, name)
        self._spare, self.used = part._spare, part.used

    def arrays(self) -> tuple[Any, ...]:
        """Return the arrays that the compiled loops take."""
        known = self.position, self.cost, self.best, self.best_cost, self.velocity
        return *known, *self._limits, self._space.periodic, self._clamped

    def _checked(self, proposals: Array, costs: Array) -> Array:
        """Return costs (n,). Raises ValueError where they, or the proposals, are not those of the population."""
        if proposals.shape != self.moved.shape or len(costs) != len(self.moved):
            raise InputError(f"tell must get the population of shape {self.moved.shape}, got {proposals.shape}")
        return writeable(costs)

    def _draws(self, particles: int, before: int = 0) -> Array:
        """Return draws of rand() for a move of so many particles, and so many for something else before them."""
        dimensions = self.moved.shape[1]
        each = 1 if self._scalar else dimensions  # Interpretation S8
        drawn: Array = self._rng.random(before + 2 * particles * each)
        return np.concatenate([drawn[:before], np.repeat(drawn[before:], dimensions)]) if self._scalar else drawn

    def _restock(self) -> None:
        """Draw more numbers for redraws, where another particle might need more than there are."""
        most = 2 * self._coordinate_redraws * self.moved.shape[1]
        if self.used + most > len(self._spare):
            self._spare, self.used = self._rng.random(most + SPARE), 0

    def _finish(self, rand: Array, pull: Pull) -> None:
        """Move all particles, and then see to constraint 2."""
        self._move(self._all_rows, rand, pull, (self._next_velocity, self.moved, self._stopped))
        works = self._allowed(self._next_velocity, self.moved)
        if np.count_nonzero(works) < len(works):
            self._redraw(np.flatnonzero(~works), pull)
        self.velocity, self._next_velocity = self._next_velocity, self.velocity

    def _move(self, rows: NDArray[np.int64], rand: Array, pull: Pull, moves: tuple[Any, ...]) -> None:
        """Write the moves of particles (k,): velocities, positions and which are stopped."""
        swarm, reached = self.arrays(), 0
        while reached < len(rows):
            self._restock()
            reached, self.used = move(
                rows, reached, rand, self._spare, self.used, self._coordinate_redraws, *pull, swarm, *moves
            )

    def _redraw(self, broken: NDArray[np.int64], pull: Pull) -> None:
        """Draw rand() again for whole particles that break a constraint, or stop them."""
        stopped, broken = broken[self._stopped[broken]], broken[~self._stopped[broken]]
        left, many = self._redraws, FIRST_REDRAWS
        while left > 0 and len(broken):
            many = min(left, many)
            rows = np.repeat(broken, many)
            moves = np.empty((len(rows), self.moved.shape[1])), np.empty((len(rows), self.moved.shape[1]))
            self._move(rows, self._draws(len(rows)), pull, (*moves, np.empty(len(rows), dtype=bool)))
            # SAPSO A1.2c
            broken = repair(broken, self._allowed(*moves), *moves, self._next_velocity, self.moved)
            left, many = left - many, self._redraws
        self._stop(np.concatenate([stopped, broken]))

    def _allowed(self, velocities: Array, moved: Array) -> NDArray[np.bool_]:
        """Return which particles (n,) meet both constraints."""
        allowed = self._space.feasible(moved)
        if not self._clamped:
            low, high = self._limits
            allowed &= ((low <= velocities) & (velocities <= high)).all(axis=1)
        return allowed

    def _first_velocities(self) -> Array:
        shape, start = self.moved.shape, self._space.start
        if start is None:
            return self._rng.uniform(*self._limits, shape)
        # Interpretation S12: the bounds may be reversed
        low, high = np.minimum(0.0, start.velocity), np.maximum(0.0, start.velocity)
        drawn = self._rng.uniform(low, high, shape)  # SAPSO (7)
        return np.clip(drawn, *self._limits)

    def _stop(self, rows: NDArray[np.int64]) -> None:
        """Clip particles into the box and stop them; where that breaks constraint 2, they stay where they were."""
        if len(rows):
            clipped = np.minimum(np.maximum(self.moved[rows], -1.0), 1.0)
            self.moved[rows] = np.where(self._space.feasible(clipped)[:, None], clipped, self.position[rows])
            self._next_velocity[rows] = 0.0


def check_swarm(
    population_size: int, iterations: int, first_inertia: float, acceleration: float, alpha: float, redraws: int
) -> None:
    """Raise ValueError where a setting that swarms share makes no sense."""
    at_least("population_size", population_size, 1)
    at_least("iterations", iterations, 1)
    if not first_inertia > 0.1:
        raise InputError(f"inertia must be above 0.1, got {first_inertia}")
    at_least("acceleration", acceleration, 0.0)
    positive("alpha", alpha)
    at_least("redraws", redraws, 0)


def speed_limits(space: Space, alpha: float, kind: Literal["symmetric", "literal"]) -> tuple[Array, Array]:
    """Return the lowest and highest velocity (d,) of the unit box. SAPSO 2.2 constraint 1, Interpretation S9."""
    # SAPSO 2.2 velocity
    if kind == "symmetric":
        return np.full(space.dimensions, -alpha), np.full(space.dimensions, alpha)
    centre, reach = extent(space)
    half = np.where(reach > 0.0, reach, 1.0)
    return alpha * (centre - reach) / half, alpha * (centre + reach) / half
