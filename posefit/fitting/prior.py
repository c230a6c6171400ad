"""Priors: joint angles as a few coordinates, with an interface like scikit-learn's.

The root is not part of a prior, but its pitch and roll, the tilt, depend on the pose.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting.kernels import add_components
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.motion.motion import Motion

RIDGE = 0.05  # ours: ridge of the regression, for latents scaled to a range of 2
# Ours: radians to either side. A wider range allows any tilt.
TURNS_OVER = 0.75 * np.pi


class Latents(Protocol):
    """Maps joint angles (n, 63) to latents (n, m) and back.

    A fitted `Prior` is one, and so is a map that needs no fit. `inverse_transform` and
    `feasible` must return the same bits for a row next to any other rows.
    """

    low: Array  # (m,) the range of the latents, constraint 1
    high: Array  # (m,)

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        ...

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        ...

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are poses (n,), constraint 2.

        The box checks constraint 1.
        """
        ...


class Prior(Latents, Protocol):
    """Learned latents. The root is not part of a prior: SAPSO section 2.

    It is built as `factory(**settings)`, with keyword-only settings. `low`, `high` and
    all methods but `fit` may be used only after `fit`.

    Example:
        >>> import posefit
        >>> angles = posefit.load_motion("walk").poses[:, 3:]
        >>> prior = posefit.prior("pca")().fit(angles)
        >>> prior.inverse_transform(prior.transform(angles)).shape == angles.shape
        True
    """

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn from joint angles, and return the prior itself.

        Args:
            angles: The joint angles (T, 63) in radians.
            skeleton: The person's skeleton.

        Returns:
            The prior, now fitted.
        """
        ...


@dataclass(eq=False, repr=False)
class Components:
    """Latents along directions: joint angles are a mean plus a sum of components."""

    mean: Array  # (63,)
    components: Array  # (m, 63), orthonormal
    low: Array  # (m,)
    high: Array  # (m,)

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        # SAPSO 2.1.3 projection
        return np.asarray((np.asarray(angles) - self.mean) @ self.components.T)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        angles = np.empty((len(latents), len(self.mean)))
        angles[:] = self.mean
        # not a matrix product: its last bits depend on the other rows and the machine
        # SAPSO 2.1.3 recovery
        add_components(writeable(latents), writeable(self.components), angles)
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return that all latents (n, m) are feasible (n,)."""
        return np.ones(len(latents), dtype=bool)


# Builds an unfitted prior, as `factory(**settings)`.
PriorFactory = Callable[..., Prior]


@dataclass(frozen=True, eq=False)
class Tilt:
    """The pitch and roll of latents: their mean by ridge regression, and its residuals.

    The mean is affine in the latents, and limited to its range over the training poses.
    """

    # (3 + m, 2) radians: the least and the greatest mean, its value at latents of 0,
    # and the slope of each latent
    mean: Array
    # (2,) radians: the range of the residuals; pi to either side is the whole circle
    low: Array
    high: Array  # (2,)

    @classmethod
    def of(
        cls, prior: Latents, motions: Sequence[Motion], share: float, margin: float
    ) -> Self:
        """Learn from the poses of one motion or more.

        Args:
            prior: The fitted prior.
            motions: The motions.
            share: The range contains this share of the residuals of each angle.
            margin: Radians added to the range on either side.
        """
        tilts = np.concatenate([motion.poses[:, 1:3] for motion in motions])
        angles = np.concatenate([motion.poses[:, 3:] for motion in motions])
        latents = np.asarray(prior.transform(angles))
        scales = 0.5 * (np.asarray(prior.high) - np.asarray(prior.low))
        scaled = latents / np.where(scales > 0.0, scales, 1.0)
        # about their circular mean, because angles near pi and -pi are neighbours
        middle = np.arctan2(np.sin(tilts).mean(axis=0), np.cos(tilts).mean(axis=0))
        around = wrapped(tilts - middle)
        centre = scaled.mean(axis=0)
        offset = around.mean(axis=0)
        scaled -= centre
        gram = scaled.T @ scaled + RIDGE * len(scaled) * np.eye(len(scales))
        slopes = np.linalg.solve(gram, scaled.T @ (around - offset))
        mean = offset + scaled @ slopes
        base = middle + offset - centre @ slopes
        residuals = wrapped(around - mean)
        low, high = np.quantile(
            residuals, [0.5 - 0.5 * share, 0.5 + 0.5 * share], axis=0
        )
        low = low - margin
        high = high + margin
        # people who turn over may have any tilt, also one that no training pose has
        whole = high - low > 2.0 * TURNS_OVER
        slopes /= np.where(scales > 0.0, scales, 1.0)[:, None]
        rows = middle + mean.min(axis=0), middle + mean.max(axis=0), base, slopes
        return cls(
            np.vstack(rows), np.where(whole, -np.pi, low), np.where(whole, np.pi, high)
        )

    def around(self, added: Array, reach: Array) -> tuple[Array, Array]:
        """Return the middle and the half sides (2,) of a box of residuals.

        The box is within the range, so near an end of the range its middle is not the
        last residual.

        Args:
            added: (2,) the last residual.
            reach: (2,) radians, the half sides at most.
        """
        half = np.minimum(reach, 0.5 * (self.high - self.low))
        whole = self.high - self.low >= 2.0 * np.pi - 1e-12
        inside = np.clip(added, self.low + half, self.high - half)
        return np.where(whole, added, inside), half
