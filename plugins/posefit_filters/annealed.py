"""The annealed particle filter of Deutscher and Reid.

J. Deutscher, I. Reid, Articulated body motion capture by stochastic search,
International Journal of Computer Vision 61(2), 2005, without its crossover of
particles. Our own choices are marked `ours`.
"""

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import (
    Array,
    Space,
    at_least,
    between,
    check_tell,
    converted,
    displacement,
    draw_population,
    positive,
    sample_normal,
    systematic_rows,
    weigh,
)
from posefit_filters.weighting import EVALUATIONS, sharpness

LAYERS = 10
SURVIVAL = 0.5  # alpha, the share of particles that survive a layer
# ours: the noise of a layer, as a multiple of the particles' own spread
DIFFUSION = 0.35
NOISE = 0.1  # ours: P0, the motion from frame to frame, in half-ranges of the box


class Annealed:
    """Layers of resampling with a sharper and sharper likelihood exp(-beta cost).

    In each layer, beta is chosen so that a given share of the particles survives. The
    share is the effective sample size divided by the number of particles. Each survivor
    moves by normal noise in proportion to the spread of the weighted particles, so that
    the search narrows where they agree. A frame commits its best particle.

    Settings:
        evaluations: Budget of a frame, shared among the layers, 1 or more. Ours: as
            many as SAPSO's.
        layers (M): Number of layers of resampling, 1 or more.
        survival (alpha): Share of the particles that survives a layer, between 0 and 1.
        diffusion: Noise of a layer as a multiple of the particles' standard deviations,
            above 0. Ours.
        noise (P0): Standard deviation of the motion from frame to frame, in half-ranges
            of the box, above 0. Ours.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        evaluations: int = EVALUATIONS,
        layers: int = LAYERS,
        survival: float = SURVIVAL,
        diffusion: float = DIFFUSION,
        noise: float = NOISE,
    ) -> None:
        at_least("evaluations", evaluations, 1)
        at_least("layers", layers, 1)
        between("survival", survival, 0.0, 1.0, ends=False)
        positive("diffusion", diffusion)
        positive("noise", noise)
        self._space = space
        self._rng = rng
        self._layers = min(layers, evaluations)
        self._survival = survival
        self._diffusion = diffusion
        self._noise = noise
        self._particles = draw_population(space, rng, evaluations // self._layers)
        self._costs = np.zeros(len(self._particles))
        self._layer = self._waiting = 0

    def ask(self) -> Array:
        """Return the particles (n, d) of the next layer, none after the last one."""
        self._waiting = len(self._particles) if self._layer < self._layers else 0
        return self._particles[: self._waiting].copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Weigh the particles, and move the survivors after all layers but the last."""
        check_tell(self._waiting, proposals, costs)
        self._particles = np.array(proposals)
        self._costs = np.array(costs, dtype=np.float64)
        self._layer = self._layer + 1
        self._waiting = 0
        if self._layer < self._layers:
            self._descend()

    def advance(self, space: Space) -> None:
        """Carry the survivors of the last layer into the next frame."""
        rows = self._survivors()[0]
        moved = converted(space, self._particles[rows], self._space)
        spread = np.full(space.dimensions, self._noise)
        # DEUTSCHER2005 (next frame)
        self._particles = sample_normal(space, self._rng, moved, spread)
        self._space = space
        self._layer = 0

    def _survivors(self) -> tuple[NDArray[np.int64], Array]:
        """Return which rows (n,) survive, and the weights (n,) of all."""
        weights = weigh(self._costs, sharpness(self._costs, self._survival))
        return systematic_rows(weights, self._rng.random(), len(weights)), weights

    def _descend(self) -> None:
        rows, weights = self._survivors()
        around = displacement(
            self._space, self._particles[weights.argmax()], self._particles
        )
        mean = weights @ around
        spread = np.sqrt(weights @ (around - mean) ** 2)
        noise = self._diffusion * spread  # DEUTSCHER2005 (diffusion)
        self._particles = sample_normal(
            self._space, self._rng, self._particles[rows], noise
        )
