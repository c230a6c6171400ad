"""The compact pose space: principal components, a range, and clusters that mark where poses are. SAPSO section 2."""

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.geometry.skeleton import Skeleton
from posefit_priors.arrays import Shape, Stored, angles_of, check_clustering
from posefit_priors.clusters import clustered
from posefit_priors.kernels import near, recover

COMPONENTS = 6  # m, section 2.1
CLUSTERS = 5  # K, section 2.2
DECIMALS = 7  # of what is learned, in radians and shares
QUANTILE = 0.99  # Interpretation S5: chi is this quantile of the training distances


class PCA(Stored):
    """Principal components of joint angles with constraint 1, a range, and constraint 2, nearness to a cluster.

    Settings:
        components (m): a whole number of them, or a share of the variance below 1 to keep at least. Section 2.1.
        clusters (K): centres that K-means finds among the training poses, 1 or more. Section 2.2.
        quantile: chi is this quantile of the training distances, above 0 and at most 1. Interpretation S5.
        seed: of the clustering, 0 or more.
    """

    SHAPES: ClassVar[Mapping[str, Shape]] = {
        "mean": (63,),
        "components": ("m", 63),
        "low": ("m",),
        "high": ("m",),
        "centres": ("k", "m"),
        "reach": (),
        "explained": ("m",),
    }
    mean: Array  # (63,)
    components: Array  # (m, 63)
    low: Array  # (m,)
    high: Array  # (m,)
    centres: Array  # (K, m) of clusters
    reach: Array  # () of a cluster: chi
    explained: Array  # (m,) share of the variance along each component

    def __init__(
        self,
        *,
        components: float = COMPONENTS,
        clusters: int = CLUSTERS,
        quantile: float = QUANTILE,
        seed: int = 0,
    ) -> None:
        check_components(components)
        check_clustering(clusters, quantile, seed)
        self._components, self._clusters, self._quantile, self._seed = components, clusters, quantile, seed

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError where there are too few frames."""
        angles = angles_of(angles, max(self._clusters, frames_for(self._components)))
        self.mean = to_decimals(angles.mean(axis=0))  # SAPSO 2.1.1
        self.components, self.explained = principal(angles - self.mean, self._components)
        latents = to_decimals(self.transform(angles))
        unit = 10.0**-DECIMALS  # by which rounding may have moved a frame inwards
        self.low, self.high = latents.min(axis=0) - unit, latents.max(axis=0) + unit  # SAPSO 2.2 constraint 1
        self.centres = to_decimals(clustered(latents, self._clusters, self._seed)[0])
        self.reach = reach_of(self.centres, latents, self._quantile)
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63): Projection. SAPSO 2.1."""
        return np.asarray((np.asarray(angles) - self.mean) @ self.components.T)  # SAPSO 2.1.3 projection

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m): Recovery. SAPSO 2.1."""
        angles = np.empty((len(latents), len(self.mean)))
        recover(writeable(latents), self.components, self.mean, angles)
        return angles

    @property
    def affine(self) -> tuple[Array, Array]:
        """The weights (m, 63) of the latents and the angles (63,) where all of them are 0. SAPSO 2.1."""
        return self.components, self.mean

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are nearer than chi to a cluster's centre (n,). SAPSO 2.2 constraint 2."""
        allowed = np.empty(len(latents), dtype=bool)
        near(writeable(latents), self.centres, self.reach, allowed)
        return allowed


def check_components(components: float) -> None:
    """Return nothing. Raises ValueError where it is neither a number of components nor a share of variance."""
    if not 0.0 < components < np.inf or (components >= 1 and components != int(components)):
        raise InputError(f"components must be a whole number or a share of variance below 1, got {components}")


def frames_for(components: float) -> int:
    """Return the least number of frames for so many components, or for a share of variance."""
    return int(components) + 1 if components >= 1 else 2


def principal(centred: Array, components: float) -> tuple[Array, Array]:
    """Return the principal directions (m, 63) of centred joint angles (T, 63), and each one's share of variance (m,).

    The largest number of a direction is above 0. Raises ValueError where there are too few frames.
    """
    most = min(len(centred) - 1, centred.shape[1])
    if most < components:
        raise InputError(f"angles must hold at least {int(components) + 1} frames, got {len(centred)}")
    _, spread, directions = np.linalg.svd(centred, full_matrices=False)  # SAPSO 2.1.2
    share = spread**2 / max(float((spread**2).sum()), np.finfo(float).tiny)
    kept = int(components) if components >= 1 else int(np.searchsorted(share.cumsum(), components)) + 1
    directions = directions[:kept]
    longest = np.take_along_axis(directions, np.abs(directions).argmax(axis=1)[:, None], axis=1)
    return _orthonormal(to_decimals(np.where(longest < 0.0, -directions, directions))), to_decimals(share[:kept])


def to_decimals(numbers: Array) -> Array:
    """Return numbers with seven decimals.

    Libraries of linear algebra differ in the last digits from processor to processor, and a search makes degrees of
    them. Rounded, the same frames give the same space everywhere.
    """
    return np.asarray(np.round(numbers, DECIMALS) + 0.0)  # no -0.0


def _orthonormal(directions: Array) -> Array:
    """Return nearly orthonormal directions (m, 63), orthonormal to the last digits, without a library's sums."""
    kept: list[Array] = []
    for direction in directions:
        for other in kept:
            direction = direction - (direction * other).sum() * other
        kept.append(direction / np.sqrt((direction * direction).sum()))
    return np.array(kept)


def reach_of(centres: Array, latents: Array, quantile: float) -> Array:
    """Return chi (): this quantile of the distances D of training latents (n, m) from their nearest centres (K, m)."""
    away = np.zeros((len(latents), len(centres)))
    for own, middle in zip(latents.T, centres.T, strict=True):  # in the order of `near`
        away += np.abs(middle - own[:, None])
    return np.array(np.quantile(away.min(axis=1) / len(centres.T), quantile))  # Interpretation S5
