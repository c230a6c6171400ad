"""A prior that is a filter's own uncertainty: a mean pose, and the directions in which it may be wrong."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit_imm import PLACED
from posefit_vsmm.state import FIRST_BONE, Reliance, decode

STEP = 0.05  # radians to either side, from which a direction's angles are differentiated


@dataclass(eq=False)
class Directions:
    """Joint angles are `middle` + latents @ `ways`; a `posefit.fitting.prior.Prior` that needs no fit."""

    middle: Array = field(repr=False)  # (63,)
    ways: Array = field(repr=False)  # (m, 63)
    low: Array  # (m,)
    high: Array  # (m,)

    @classmethod
    def of(cls, state: Array, covariance: Array, reliance: Reliance, count: int, reach: float) -> "Directions":
        """Return the `count` directions of a state (43,) in which its covariance (33, 33) is largest.

        They are principal axes of the bones' part of the covariance, carried over to joint angles.
        Their range is `reach` standard deviations to either side.
        """
        values, vectors = np.linalg.eigh(covariance[FIRST_BONE:, FIRST_BONE:])
        chosen = np.argsort(values)[::-1][:count]
        errors = np.zeros((2 * len(chosen), len(covariance)))
        errors[:, FIRST_BONE:] = np.concatenate([vectors[:, chosen].T, -vectors[:, chosen].T]) * STEP
        poses, _ = decode(np.array([state, *(PLACED.plus(state, error) for error in errors)]), reliance)
        middle, ahead, back = np.split(poses[:, 3:], [1, 1 + len(chosen)])
        ways = wrapped(ahead - back) / (2.0 * STEP)  # central differences
        far = reach * np.sqrt(values[chosen])
        return cls(middle[0], ways, -far, far)

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Return itself: everything is known already."""
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) that come nearest to joint angles (n, 63)."""
        return np.asarray(wrapped(angles - self.middle) @ np.linalg.pinv(self.ways))

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return np.asarray(self.middle + (latents[:, :, None] * self.ways).sum(axis=1))

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return that all latents (n, m) are poses."""
        return np.ones(len(latents), dtype=bool)

    def save(self, path: str | Path) -> None:
        """Write everything to an .npz file."""
        np.savez(path, middle=self.middle, ways=self.ways, low=self.low, high=self.high)
