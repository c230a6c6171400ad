"""The compact pose space: principal components, a range, and clusters that mark where poses are. SAPSO section 2."""

import warnings
from functools import lru_cache
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, jit, writeable
from posefit.errors import InputError
from posefit.fitting.check import at_least
from posefit.fitting.prior import Components
from posefit.geometry.skeleton import Skeleton

COMPONENTS = 6  # m, section 2.1
CLUSTERS = 5  # K, section 2.2
QUANTILE = 0.99  # Interpretation S5: chi is this quantile of the training distances
CLUSTERING_STARTS = 30  # of K-means, of which the best counts
CLUSTERING_SEED = 0
CLUSTERING_ROUNDS = 100  # of Lloyd's algorithm
DECIMALS = 7  # of what is learned, in radians and shares


class PCA(Components):
    """Principal components of joint angles with constraint 1, a range, and constraint 2, nearness to a cluster.

    Settings:
        components (m): a whole number of them, or a share of the variance below 1 to keep at least. Section 2.1.
        clusters (K): centres that K-means finds among the training poses, 1 or more. Section 2.2.
        quantile: chi is this quantile of the training distances, above 0 and at most 1. Interpretation S5.
    """

    centres: Array  # (K, m) of clusters
    reach: Array  # () of a cluster: chi
    explained: Array  # (m,) share of the variance along each component

    def __init__(
        self,
        *,
        components: float = COMPONENTS,
        clusters: int = CLUSTERS,
        quantile: float = QUANTILE,
    ) -> None:
        if not 0.0 < components < np.inf or (
            components >= 1 and components != int(components)
        ):
            raise InputError(
                f"components must be a whole number or a share of variance below 1, got {components}"
            )
        at_least("clusters", clusters, 1)
        if not 0.0 < quantile <= 1.0:
            raise InputError(f"quantile must lie in 0 to 1, got {quantile}")
        self._components = components
        self._clusters = clusters
        self._quantile = quantile

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError where there are too few frames."""
        angles = angles_of(angles, max(self._clusters, int(self._components) + 1, 2))
        self.mean = rounded(angles.mean(axis=0))  # SAPSO 2.1.1
        self.components, self.explained = principal(
            angles - self.mean, self._components
        )
        latents = rounded(self.transform(angles))
        unit = 10.0**-DECIMALS  # by which rounding may have moved a frame inwards
        # SAPSO 2.2 constraint 1
        self.low, self.high = latents.min(axis=0) - unit, latents.max(axis=0) + unit
        self.centres, self.reach = clusters_of(latents, self._clusters, self._quantile)
        return self

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are nearer than chi to a cluster's centre (n,). SAPSO 2.2 constraint 2."""
        # SAPSO 2.2 constraint 2
        return np.asarray(distances(writeable(latents), self.centres) < self.reach)


def angles_of(angles: Array, least: int) -> Array:
    """Return joint angles (T, 63) as float64. Raises ValueError where they are not, or fewer than `least` frames."""
    angles = np.asarray(angles, dtype=np.float64)
    if angles.ndim != 2 or angles.shape[1] != 63:
        raise InputError(f"angles must have shape (T, 63), got {angles.shape}")
    if len(angles) < least:
        raise InputError(f"angles must hold at least {least} frames, got {len(angles)}")
    if not np.isfinite(angles).all():
        raise InputError(
            f"angles must be finite, got {np.count_nonzero(~np.isfinite(angles))} that are not"
        )
    return angles


@jit
def distances(latents: Array, centres: Array) -> Array:
    """Return the distance D (n,) of latents (n, m or more) from the nearest of centres (K, m): the L1 distance over m.

    For a population NumPy takes a quarter of the time that the cost of its poses takes.
    """
    nearest = np.full(len(latents), np.inf)
    for i in range(len(latents)):
        for centre in centres:
            total = 0.0
            for j in range(len(centre)):
                total += abs(centre[j] - latents[i, j])
            nearest[i] = min(nearest[i], total / len(centre))
    return nearest


def clusters_of(latents: Array, clusters: int, quantile: float) -> tuple[Array, Array]:
    """Return the centres (K, m) that K-means finds among training latents (n, m), and chi (), how far one reaches."""
    centres = _centres_of(latents.tobytes(), latents.shape[1], clusters).copy()
    # Interpretation S5
    return centres, np.array(np.quantile(distances(latents, centres), quantile))


@lru_cache(maxsize=8)
def _centres_of(latents_bytes: bytes, m: int, clusters: int) -> Array:
    """Return the centres (K, m) among latents (n, m), as bytes: pictures one by one learn from the same."""
    # the same as scikit-learn's, whose import takes two seconds
    from scipy.cluster.vq import kmeans2

    latents = np.frombuffer(latents_bytes).reshape(-1, m)
    count = min(clusters, len(np.unique(latents, axis=0)))
    rng = np.random.default_rng(CLUSTERING_SEED)
    with warnings.catch_warnings():
        # a run in which a cluster has lost its poses is not the best
        warnings.simplefilter("ignore")
        runs = [
            kmeans2(latents, count, CLUSTERING_ROUNDS, minit="++", rng=rng)
            for _ in range(CLUSTERING_STARTS)
        ]
    best, _ = min(runs, key=lambda run: float(((latents - run[0][run[1]]) ** 2).sum()))
    return rounded(best)


def principal(centred: Array, components: float) -> tuple[Array, Array]:
    """Return the principal directions (m, 63) of centred joint angles (T, 63), and each one's share of variance (m,).

    The largest number of a direction is above 0.
    """
    if components > centred.shape[1]:
        raise InputError(
            f"components must be at most {centred.shape[1]}, got {components}"
        )
    _, spread, directions = np.linalg.svd(centred, full_matrices=False)  # SAPSO 2.1.2
    share = spread**2 / max(float((spread**2).sum()), np.finfo(float).tiny)
    count = (
        int(components)
        if components >= 1
        else int(np.searchsorted(share.cumsum(), components)) + 1
    )
    directions = directions[:count]
    longest = np.take_along_axis(
        directions, np.abs(directions).argmax(axis=1)[:, None], axis=1
    )
    return _orthonormal(
        rounded(np.where(longest < 0.0, -directions, directions))
    ), rounded(share[:count])


def rounded(numbers: Array) -> Array:
    """Return numbers with seven decimals.

    Libraries of linear algebra differ in the last digits from processor to processor, and a search makes degrees of
    them. Rounded, the same frames give the same space everywhere.
    """
    return np.asarray(np.round(numbers, DECIMALS) + 0.0)  # no -0.0


def _orthonormal(directions: Array) -> Array:
    """Return nearly orthonormal directions (m, 63), orthonormal to the last digits, without a library's sums."""
    basis: list[Array] = []
    for direction in directions:
        for other in basis:
            direction = direction - (direction * other).sum() * other
        basis.append(direction / np.sqrt((direction * direction).sum()))
    return np.array(basis)
