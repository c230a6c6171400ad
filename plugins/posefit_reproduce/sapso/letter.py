"""SAPSO to the letter of Algorithm 1, where `posefit_swarm.sapso` deviates from it.

| interpretation | here | `posefit_swarm.sapso` |
|---|---|---|
| S6 | cools at each acceptance, with one shared temperature | once an iteration |
| S7 | redraws whole particles, for velocities beyond limits too | for constraint 2 |
| S8 | one rand() for a pull of a particle | one for each coordinate |
| S9 | alpha is a factor on the ranges of latents, the root is free | +- alpha |
| S10 | the last move is not evaluated: N C evaluations | N (C + 1) |
"""

import numpy as np
from numpy.typing import NDArray

from posefit.fitting.space import SearchSpace
from posefit.plugin import Array, Space, check_tell, displacement, wrap
from posefit_swarm.sapso import SAPSO, Rows, redrawn

ALPHA = 0.15  # section 2.2
# ours: after these the particle does not move, and its velocity is 0. Interpretation S7
REDRAWS = 100


class LetterSAPSO(SAPSO):
    """Algorithm 1 to the letter. Positions and velocities are in the unit box.

    Settings:
        population_size (N): Size of the swarm, 1 or more. Section 5.2.
        iterations (C): Number of evaluated populations, 1 or more. Section 5.2,
            Interpretation S10.
        stop_temperature (T0): The search ends when the temperature falls to it, 0 or
            more; at 0 only the iterations end the search. Interpretation S5.
        inertia (A): Initial factor on the old velocity, above 0.1; it falls to 0.1.
            Section 3.1, Interpretation S5.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 40,
        iterations: int = 60,
        stop_temperature: float = 0.0,
        inertia: float = 0.9,
    ) -> None:
        size = population_size
        stop = stop_temperature
        super().__init__(
            space,
            rng,
            population_size=size,
            iterations=iterations,
            stop_temperature=stop,
            inertia=inertia,
        )
        self.low, self.high = velocity_limits(space)
        self.v = np.clip(self.v, self.low, self.high)

    def ask(self) -> Array:
        """Return the particles (N, d) after their move.

        The array is empty once the iterations or the temperature are used up.
        """
        if self.c < self.C:
            return super().ask()
        return self.moved[:0].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Accept or refuse moves by their costs (N,), cool, update the bests, move."""
        check_tell(self.waiting, proposals, costs)
        count = self.accept(costs)
        if self.c > 0:
            self.T *= self.gamma**count
        self.v, self.moved = redrawn(self.x, self.step, self.allowed, REDRAWS)
        self.c = self.c + 1
        self.waiting = 0

    def step(self, rows: Rows) -> tuple[Array, Array]:
        """Return velocities and positions (k, d) of particles (k,) by (1) and (2)."""
        x = self.x[rows]
        gbest = self.pbest[self.pbest_cost.argmin()]
        phi1, phi2 = self.acceleration * self.rng.random((2, len(rows), 1))
        to_pbest = displacement(self.space, x, self.pbest[rows])
        to_gbest = displacement(self.space, x, gbest)
        v = self.inertia() * self.v[rows] + phi1 * to_pbest + phi2 * to_gbest
        return v, wrap(self.space, x + v)

    def allowed(self, v: Array, x: Array) -> NDArray[np.bool_]:
        """Return which velocities and positions (k, d) meet both constraints (k,)."""
        within = ((self.low <= v) & (v <= self.high)).all(axis=1)
        return np.asarray(within & self.space.feasible(x))


def velocity_limits(space: Space) -> tuple[Array, Array]:
    """Return the lowest and highest velocity (d,) of the unit box.

    For latents they are alpha times the latent's limits, for the root they are
    infinite. A space without latents has the limits plus and minus alpha.
    """
    if not isinstance(space, SearchSpace):
        return np.full(space.dimensions, -ALPHA), np.full(space.dimensions, ALPHA)
    low = np.full(space.dimensions, -np.inf)
    high = np.full(space.dimensions, np.inf)
    m = len(space.prior.low)
    half = np.where(space.half[-m:] > 0.0, space.half[-m:], 1.0)
    low[-m:] = ALPHA * space.prior.low / half
    high[-m:] = ALPHA * space.prior.high / half
    return low, high
