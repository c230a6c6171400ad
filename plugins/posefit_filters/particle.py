"""The particle filter with which the SAPSO paper compares, a bootstrap filter.

N. Gordon, D. Salmond, A. Smith, Novel approach to nonlinear/non-Gaussian Bayesian state
estimation, IEE Proceedings F 140(2), 1993. The SAPSO paper gives no numbers for it;
those here are ours.
"""

import numpy as np

from posefit.plugin import (
    Array,
    Space,
    at_least,
    check_tell,
    converted,
    draw_population,
    positive,
    sample_normal,
    systematic_rows,
    weigh,
)
from posefit_filters.weighting import EVALUATIONS

SHARPNESS = 1.0  # how fast the likelihood falls with the cost
# standard deviation of the motion from frame to frame, in half-ranges of the box
NOISE = 0.15


class Particle:
    """A bootstrap filter: all evaluations of a frame are one population.

    This is sampling importance resampling (SIR) with the motion as the proposal.
    Particles of the last frame are resampled systematically with weights
    exp(-`sharpness` cost). Survivors move, and are weighted by the new silhouette. A
    frame commits its best particle.

    Settings:
        evaluations (N): Number of particles, and budget of a frame, 1 or more. Ours: as
            many as SAPSO's.
        sharpness: How fast the likelihood exp(-sharpness cost) falls, above 0. Ours.
        noise: Standard deviation of the motion from frame to frame, in half-ranges of
            the box, above 0. Ours.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        evaluations: int = EVALUATIONS,
        sharpness: float = SHARPNESS,
        noise: float = NOISE,
    ) -> None:
        at_least("evaluations", evaluations, 1)
        positive("sharpness", sharpness)
        positive("noise", noise)
        self._space = space
        self._rng = rng
        self._sharpness = sharpness
        self._noise = noise
        self._particles = draw_population(space, rng, evaluations)
        self._weights = np.full(evaluations, 1.0 / evaluations)
        self._due = True
        self._waiting = 0

    def ask(self) -> Array:
        """Return the particles (n, d) of this frame once, then none."""
        self._waiting = len(self._particles) if self._due else 0
        return self._particles[: self._waiting].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Weigh the particles."""
        check_tell(self._waiting, proposals, costs)
        self._particles = np.array(proposals)
        self._weights = weigh(np.array(costs, dtype=np.float64), self._sharpness)
        self._due = False
        self._waiting = 0

    def advance(self, space: Space) -> None:
        """Resample the particles by their weights, and move to the next frame."""
        # GORDON1993 (resampling)
        rows = systematic_rows(self._weights, self._rng.random(), len(self._weights))
        moved = converted(space, self._particles[rows], self._space)
        spread = np.full(space.dimensions, self._noise)
        # GORDON1993 (motion)
        self._particles = sample_normal(space, self._rng, moved, spread)
        self._space = space
        self._due = True
