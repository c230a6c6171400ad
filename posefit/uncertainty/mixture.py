"""Where a sampler starts: normal distributions around known modes, and some share anywhere in the box."""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.uncertainty.kernels import log_parts, log_sums
from posefit.uncertainty.landscape import Box, wrap

REDRAWS = 100  # Interpretation S7
SPARE = 8  # ours: proposals that are drawn beyond those that are expected to be enough
WIDEST = 0.5  # ours: a wrapped normal of this deviation is its three nearest images to nine digits


@dataclass(frozen=True, eq=False)
class NormalMixture:
    """Normal distributions of equal weight around `centres`, cut off at the box, and a share `broad` that is uniform.

    They wrap around where a coordinate is periodic. Without centres everything is uniform.
    """

    centres: Array  # (k, d)
    spreads: Array  # (k, d) standard deviations, at most 0.5
    broad: float  # between 0 and 1, so that no place in the box is left out; 1 without centres

    @classmethod
    def anywhere(cls, dimensions: int) -> Self:
        """Return the uniform distribution over the box."""
        return cls(np.empty((0, dimensions)), np.empty((0, dimensions)), 1.0)

    def __post_init__(self) -> None:
        if self.centres.shape != self.spreads.shape:
            raise InputError(f"spreads must have shape {self.centres.shape}, got {self.spreads.shape}")
        for name in ("centres", "spreads"):
            object.__setattr__(self, name, writeable(getattr(self, name)))
        if not (self.spreads > 0.0).all() or not (self.spreads <= WIDEST).all():
            raise InputError(f"spreads must be above 0 and at most {WIDEST}, got {self.spreads.ravel()[:3]}")
        if not (0.0 < self.broad < 1.0 if len(self.centres) else self.broad == 1.0):
            raise InputError(f"broad must lie between 0 and 1, and be 1 without centres, got {self.broad}")

    def draw(self, box: Box, rng: np.random.Generator, count: int) -> tuple[Array, float]:
        """Return feasible proposals (count, d), and which share of all that were drawn was feasible.

        Where 100 attempts give too few, those are repeated. Raises ValueError where they give none.
        """
        accepted, tried, total, more = [], 0, 0, count
        for _ in range(REDRAWS):
            drawn = self._drawn(box, rng, more)
            accepted.append(drawn[box.feasible(drawn)])
            tried, total = tried + more, total + len(accepted[-1])
            if total >= count:
                break
            more = min(count, (count - total) * tried // max(total, 1) + SPARE)
        if not total:
            raise InputError(f"the box must be feasible somewhere, got nothing in {REDRAWS} x {count} draws")
        drawn = np.concatenate(accepted)
        return (drawn if total >= count else drawn[rng.integers(0, total, count)])[:count], total / tried

    def log_density(self, box: Box, proposals: Array) -> Array:
        """Return the logarithm (n,) of the density of proposals (n, d), over that of the uniform distribution."""
        if not len(self.centres):
            return np.zeros(len(proposals))
        each = math.log((1.0 - self.broad) / len(self.centres))
        return np.asarray(log_sums(self._log_parts(box, proposals), each, math.log(self.broad)))

    def nearest(self, box: Box, proposals: Array) -> NDArray[np.int64]:
        """Return which normal distribution is the densest (n,) at proposals (n, d); 0 where there is none."""
        if not len(self.centres):
            return np.zeros(len(proposals), dtype=np.int64)
        return np.asarray(self._log_parts(box, proposals).argmax(axis=1))

    def _log_parts(self, box: Box, proposals: Array) -> Array:
        """Return the logarithms (n, k) of the densities of the normal distributions, over the uniform one."""
        return np.asarray(log_parts(writeable(proposals), self.centres, self.spreads, box.periodic))

    def _drawn(self, box: Box, rng: np.random.Generator, count: int) -> Array:
        drawn = rng.uniform(-1.0, 1.0, (count, box.dimensions))
        near = np.flatnonzero(rng.random(count) >= self.broad)
        if not len(near):
            return drawn
        which = rng.integers(0, len(self.centres), len(near))
        means, spreads = self.centres[which], self.spreads[which]
        mine = wrap(box, means + spreads * rng.standard_normal(means.shape))
        rows, columns = np.nonzero(np.abs(mine) > 1.0)
        while len(rows):  # of a mean in the box at least a third stays inside
            again = means[rows, columns] + spreads[rows, columns] * rng.standard_normal(len(rows))
            mine[rows, columns] = again
            out = np.abs(again) > 1.0
            rows, columns = rows[out], columns[out]
        drawn[near] = mine
        return drawn
