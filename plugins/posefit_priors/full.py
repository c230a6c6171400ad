"""The full space: every free joint angle between its limits, without constraint 2."""

from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import choices
from posefit.geometry.skeleton import Skeleton
from posefit_priors.pca import angles_of


class Full:
    """Every joint angle that has a range is a latent.

    An angle without a range is fixed at its training mean. Limits are widened if
    training poses exceed them.

    Settings:
        limits: "asf", the joint limits that the skeleton's file states, or "training",
            the range of training poses.
    """

    low: Array  # (m,) radians
    high: Array  # (m,)
    angles: NDArray[np.intp]  # (m,) indices of the free angles
    rest: Array  # (63,) radians, the mean; angles without a range are fixed there

    def __init__(self, *, limits: Literal["asf", "training"] = "asf") -> None:
        choices(Full.__init__, locals())
        self._limits = limits

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Take the limits from the skeleton, or the range of joint angles (T, 63).

        Raises ValueError if the skeleton states no limits, or if nothing moves.
        """
        angles = angles_of(angles, 1)
        low = angles.min(axis=0)
        high = angles.max(axis=0)
        if self._limits == "asf":
            if skeleton is None or skeleton.limits is None:
                name = "no skeleton"
                if skeleton is not None:
                    name = f"{skeleton.name}, whose file states none"
                raise InputError(
                    "limits must be training if the skeleton states no joint limits, "
                    f"got asf and {name}"
                )
            low = np.minimum(low, skeleton.limits[:, 0])
            high = np.maximum(high, skeleton.limits[:, 1])
        self.angles = np.flatnonzero(high > low)
        if not len(self.angles):
            raise InputError(
                f"angles must differ between frames, got {len(angles)} equal frames"
            )
        self.rest = angles.mean(axis=0)
        self.low = low[self.angles]
        self.high = high[self.angles]
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63): the free ones."""
        return np.asarray(angles, dtype=np.float64)[:, self.angles]

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        angles = np.tile(self.rest, (len(latents), 1))
        angles[:, self.angles] = latents
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return True for all latents (n, m): the box is the only constraint."""
        return np.ones(len(latents), dtype=bool)
