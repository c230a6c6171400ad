"""Principal components with extra freedom at arms and legs."""

from itertools import chain
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting.check import at_least, positive
from posefit.fitting.kernels import add_components
from posefit.geometry.skeleton import JOINTS, Skeleton, angle_index, both
from posefit_priors.pca import PCA, distances

COMPONENTS = 12
ARMS_DEGREES = 45.0
LEGS_DEGREES = 15.0
SLACK = 1.5  # largest distance of a pose from the nearest cluster, in units of chi
ROUNDING = 1e-9  # radians by which a joint may exceed its limit
ARMS = ("humerus", "radius")
LEGS = ("femur", "tibia")


class Loose:
    """The space of `pca`, with extra latents for shoulders, elbows, hips and knees.

    Each angle of these joints that moves in training has one extra latent, in radians.
    It is added to the angle that the components give. The sum is kept within the
    skeleton's joint limits if the skeleton states some.

    Settings:
        components (m): Number of components, or the least share of the variance that
            they must retain, below 1. As in `pca`.
        arms_degrees: How far shoulders and elbows may deviate from the components, to
            either side, 0 or more. Ours.
        legs_degrees: How far hips and knees may deviate from the components, to either
            side, 0 or more. Ours.
        slack: Largest distance of a pose from the clusters, in units of chi; above 0.
            Ours.
    """

    loose: NDArray[np.intp]  # (k,) indices of joint angles with an extra latent
    angles_low: Array  # (k,) radians, their limits
    angles_high: Array  # (k,)
    low: Array  # (d,)
    high: Array  # (d,)

    def __init__(
        self,
        *,
        components: float = COMPONENTS,
        arms_degrees: float = ARMS_DEGREES,
        legs_degrees: float = LEGS_DEGREES,
        slack: float = SLACK,
    ) -> None:
        positive("slack", slack)
        at_least("arms_degrees", arms_degrees, 0.0)
        at_least("legs_degrees", legs_degrees, 0.0)
        self._reach = np.radians([arms_degrees, legs_degrees])
        self._slack = slack
        self._pca = PCA(components=components)

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError if too few."""
        self._pca.fit(angles, skeleton)
        self._max_distance = self._slack * float(self._pca.reach)
        angles = np.asarray(angles, dtype=np.float64)
        least = angles.min(axis=0)
        most = angles.max(axis=0)
        chosen = []
        reach = []
        for bones, bones_reach in zip((ARMS, LEGS), self._reach, strict=True):
            for name in chain.from_iterable(map(both, bones)):
                first = angle_index(JOINTS.index(name)) - 3
                moving = [i for i in range(first, first + 3) if most[i] > least[i]]
                chosen += moving
                reach += [bones_reach] * len(moving)
        self.loose = np.array(chosen, dtype=np.intp)
        self.angles_low = np.full(len(chosen), -np.pi)
        self.angles_high = np.full(len(chosen), np.pi)
        if skeleton is not None and skeleton.limits is not None:
            self.angles_low, self.angles_high = skeleton.limits[self.loose].T.copy()
        self.angles_low = np.minimum(self.angles_low, least[self.loose])
        self.angles_high = np.maximum(self.angles_high, most[self.loose])
        # only as far as every training pose has room, so that little of the box is
        # infeasible
        down = np.minimum(reach, least[self.loose] - self.angles_low)
        up = np.minimum(reach, self.angles_high - most[self.loose])
        left = self.transform(angles)[:, len(self._pca.low) :]
        self.low = np.concatenate(
            [self._pca.low, np.minimum(-down, left.min(axis=0, initial=0.0))]
        )
        self.high = np.concatenate(
            [self._pca.high, np.maximum(up, left.max(axis=0, initial=0.0))]
        )
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, d) of joint angles (n, 63).

        The components come first, then the remainders of the loose angles.
        """
        latents = self._pca.transform(angles)
        residual = np.asarray(angles) - self._pca.inverse_transform(latents)  # (n, 63)
        left = residual[:, self.loose]
        return np.hstack([latents, left])

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, d)."""
        latents = np.asarray(latents)
        m = len(self._pca.low)
        angles = self._pca.inverse_transform(latents[:, :m])
        angles[:, self.loose] += latents[:, m:]
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, d) satisfy clusters and joint limits (n,)."""
        m = len(self._pca.low)
        angles = self._pca.mean[self.loose] + latents[:, m:]
        add_components(
            writeable(latents[:, :m]),
            writeable(self._pca.components[:, self.loose]),
            angles,
        )
        within = (angles >= self.angles_low - ROUNDING) & (
            angles <= self.angles_high + ROUNDING
        )
        near = distances(writeable(latents), self._pca.centres) < self._max_distance
        return np.asarray(within.all(axis=1) & near)
