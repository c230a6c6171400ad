"""A particle filter with a swarm, which moves the particles to better fits.

T. Krzeszowski, B. Kwolek, K. Wojciechowski, Articulated body motion tracking by
combined particle swarm optimization and particle filtering, ICCVG 2010, LNCS 6374.
Particles that survive a frame move as the person may have moved. A particle swarm
optimisation then shifts them. The shifted particles are weighted and resampled.

Interpretations: the swarm is Clerc and Kennedy's with its usual constants. The personal
bests are the particles that are weighted. Their weights are exp(-sharpness cost),
without a factor for the shift, so they are not a fair sample of the posterior.
"""

import numpy as np

from posefit.plugin import (
    Array,
    Space,
    at_least,
    check_tell,
    converted,
    displacement,
    draw_population,
    positive,
    repair,
    sample_normal,
    systematic_rows,
    weigh,
)
from posefit_related.stages import EVALUATIONS

# Clerc and Kennedy 2002: the constriction, and the acceleration of each pull
CHI = 0.7298
PHI = 2.05


class PSOPF:
    """Particles that are resampled, moved by noise, then by a swarm, in every frame.

    Settings:
        evaluations: Budget of a frame, shared among the moves, 1 or more. Ours: as many
            as SAPSO's.
        iterations: Moves of the swarm in a frame, 0 or more; 0 gives a plain particle
            filter.
        sharpness: How fast the likelihood exp(-sharpness cost) falls, above 0. Ours.
        noise: Standard deviation of the motion from frame to frame, in half-ranges of
            the box, above 0. Ours.
        alpha: Velocity limit, in half-ranges of the box, above 0. Ours.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        evaluations: int = EVALUATIONS,
        iterations: int = 15,
        sharpness: float = 1.0,
        noise: float = 0.1,
        alpha: float = 0.15,
    ) -> None:
        at_least("evaluations", evaluations, 1)
        at_least("iterations", iterations, 0)
        positive("sharpness", sharpness)
        positive("noise", noise)
        positive("alpha", alpha)
        self._space = space
        self._rng = rng
        self._waiting = 0
        self._iterations = min(iterations, evaluations - 1)
        self._sharpness = sharpness
        self._noise = noise
        self._alpha = alpha
        self._begin(draw_population(space, rng, evaluations // (self._iterations + 1)))

    def _begin(self, x: Array) -> None:
        self._x = x
        self._v = np.zeros_like(x)
        self._moves = 0
        self._pbest = x.copy()
        self._pbest_cost = np.full(len(x), np.inf)

    def ask(self) -> Array:
        """Return the particles (n, d) after their move, none after the last move."""
        self._waiting = len(self._x) if self._moves <= self._iterations else 0
        return self._x[: self._waiting].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Update the bests, and move the swarm unless the frame is finished."""
        check_tell(self._waiting, proposals, costs)
        better = costs < self._pbest_cost
        self._pbest[better] = proposals[better]
        self._pbest_cost[better] = costs[better]
        self._moves = self._moves + 1
        self._waiting = 0
        if self._moves > self._iterations:
            return
        gbest = self._pbest[self._pbest_cost.argmin()]
        pulls = PHI * self._rng.random((2, *self._x.shape))
        to_pbest = displacement(self._space, self._x, self._pbest)
        to_gbest = displacement(self._space, self._x, gbest)
        # KRZESZOWSKI2010 (shift)
        v = CHI * (self._v + pulls[0] * to_pbest + pulls[1] * to_gbest)
        self._v = np.clip(v, -self._alpha, self._alpha)
        self._x = repair(self._space, self._x + self._v, self._pbest)

    def advance(self, space: Space) -> None:
        """Resample the particles by their bests' weights; begin the next frame."""
        weights = weigh(self._pbest_cost, self._sharpness)  # KRZESZOWSKI2010 (weights)
        rows = systematic_rows(weights, self._rng.random(), len(weights))
        # the next frame's box is centred elsewhere
        moved = converted(space, self._pbest[rows], self._space)
        self._space = space
        self._begin(
            sample_normal(
                space, self._rng, moved, np.full(space.dimensions, self._noise)
            )
        )
