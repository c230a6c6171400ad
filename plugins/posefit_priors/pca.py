"""The compact pose space: principal components, a range, clusters. SAPSO section 2."""

import warnings
from functools import lru_cache
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from posefit.arrays import Array, jit, writeable
from posefit.arrays.compiling import state_of
from posefit.arrays.stored import Arrays, stored
from posefit.errors import InputError
from posefit.fitting.check import at_least
from posefit.fitting.prior import Components
from posefit.geometry.skeleton import Skeleton

COMPONENTS = 6  # m, section 2.1
CLUSTERS = 5  # K, section 2.2
QUANTILE = 0.99  # Interpretation S5: chi is this quantile of the training distances
# runs of K-means; the best is used
CLUSTERING_STARTS = 30
CLUSTERING_SEED = 0
# iterations of Lloyd's algorithm
CLUSTERING_ROUNDS = 100
# to which the learned numbers are rounded, in radians and shares
DECIMALS = 7


class PCA(Components):
    """Principal components of joint angles, with the paper's two constraints.

    Constraint 1 is a range of each latent, and constraint 2 a largest distance from the
    nearest cluster.

    Settings:
        components (m): Number of components, or the least share of the variance that
            they must retain, below 1. Section 2.1.
        clusters (K): Number of centres that K-means finds among the training poses, 1
            or more. Section 2.2.
        quantile: The quantile of the training distances that gives chi, above 0 and at
            most 1. Interpretation S5.
    """

    centres: Array  # (K, m) of the clusters
    reach: Array  # () chi, the largest distance of a pose from a cluster
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
                "components must be a whole number or a share of variance below 1, "
                f"got {components}"
            )
        at_least("clusters", clusters, 1)
        if not 0.0 < quantile <= 1.0:
            raise InputError(f"quantile must lie in 0 to 1, got {quantile}")
        self._components = components
        self._clusters = clusters
        self._quantile = quantile

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError if too few."""
        angles = angles_of(angles, max(self._clusters, int(self._components) + 1, 2))
        self.mean = rounded(angles.mean(axis=0))  # SAPSO 2.1.1
        self.components, self.explained = principal(
            angles - self.mean, self._components
        )
        latents = rounded(self.transform(angles))
        unit = 10.0**-DECIMALS  # rounding may have moved a frame inwards by this much
        # SAPSO 2.2 constraint 1
        self.low = latents.min(axis=0) - unit
        self.high = latents.max(axis=0) + unit
        self.centres, self.reach = clusters_of(latents, self._clusters, self._quantile)
        return self

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are closer than chi to a cluster's centre (n,).

        SAPSO 2.2, constraint 2.
        """
        # SAPSO 2.2 constraint 2
        return np.asarray(distances(writeable(latents), self.centres) < self.reach)


def angles_of(angles: Array, least: int) -> Array:
    """Return joint angles (T, 63) as float64.

    Raises ValueError if they are not finite, or if there are fewer than `least` frames.
    """
    angles = np.asarray(angles, dtype=np.float64)
    if angles.ndim != 2 or angles.shape[1] != 63:
        raise InputError(f"angles must have shape (T, 63), got {angles.shape}")
    if len(angles) < least:
        raise InputError(
            f"angles must contain at least {least} frames, got {len(angles)}"
        )
    if not np.isfinite(angles).all():
        raise InputError(
            "angles must be finite, "
            f"got {np.count_nonzero(~np.isfinite(angles))} that are not"
        )
    return angles


@jit
def distances(latents: Array, centres: Array) -> Array:
    """Return the distance D (n,) of latents (n, m or more) from the nearest centre.

    It is the mean absolute difference of the m components. The loop is compiled because
    NumPy would take a quarter of the time that the cost of the poses takes.
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
    """Return the centres (K, m) of clusters of latents (n, m), and their reach chi ().

    K-means finds the centres.
    """
    centres = _centres_of(latents.tobytes(), latents.shape[1], clusters).copy()
    # Interpretation S5
    return centres, np.array(np.quantile(distances(latents, centres), quantile))


@lru_cache(maxsize=8)
def _centres_of(latents_bytes: bytes, m: int, clusters: int) -> Array:
    """Return the centres (K, m) among latents (n, m), given as their bytes.

    They are kept, as pictures that are fitted one by one learn from the same motions,
    and stored for the next process.
    """
    source = f"{state_of(__name__)} scipy {scipy.__version__} {m} {clusters}"

    def made() -> Arrays:
        latents = np.frombuffer(latents_bytes).reshape(-1, m)
        return {"centres": _k_means(latents, clusters)}

    return np.asarray(stored("pca", source.encode() + latents_bytes, made)["centres"])


def _k_means(latents: Array, clusters: int) -> Array:
    """Return the centres (K, m) of the best of several runs of K-means."""
    # SciPy gives the same as scikit-learn, whose import takes two seconds
    from scipy.cluster.vq import kmeans2

    count = min(clusters, len(np.unique(latents, axis=0)))
    rng = np.random.default_rng(CLUSTERING_SEED)
    with warnings.catch_warnings():
        # SciPy warns of runs in which a cluster becomes empty; these are not the best
        warnings.simplefilter("ignore")
        runs = [
            kmeans2(latents, count, CLUSTERING_ROUNDS, minit="++", rng=rng)
            for _ in range(CLUSTERING_STARTS)
        ]
    best, _ = min(runs, key=lambda run: float(((latents - run[0][run[1]]) ** 2).sum()))
    return rounded(best)


def principal(centred: Array, components: float) -> tuple[Array, Array]:
    """Return principal directions (m, 63), and the share of variance of each (m,).

    The joint angles (T, 63) are centred. Signs are chosen such that the number of
    largest magnitude in each direction is positive.
    """
    if components > centred.shape[1]:
        raise InputError(
            f"components must be at most {centred.shape[1]}, got {components}"
        )
    _, spread, directions = np.linalg.svd(centred, full_matrices=False)  # SAPSO 2.1.2
    share = spread**2 / max(float((spread**2).sum()), np.finfo(float).tiny)
    count = int(components)
    if components < 1:
        # the fewest directions with this share of the variance
        count = int(np.searchsorted(share.cumsum(), components)) + 1
    directions = directions[:count]
    longest = np.take_along_axis(
        directions, np.abs(directions).argmax(axis=1)[:, None], axis=1
    )
    directions = np.where(longest < 0.0, -directions, directions)
    return _orthonormal(rounded(directions)), rounded(share[:count])


def rounded(numbers: Array) -> Array:
    """Return numbers with seven decimals.

    The last digits of linear algebra differ from processor to processor, and a search
    turns them into degrees. Rounded, the same frames give the same space everywhere.
    """
    return np.asarray(np.round(numbers, DECIMALS) + 0.0)  # no -0.0


def _orthonormal(directions: Array) -> Array:
    """Return rounded directions (m, 63), orthonormal again to the last digits.

    The Gram-Schmidt process uses no linear algebra library, so its digits are the same
    everywhere.
    """
    basis: list[Array] = []
    for direction in directions:
        for other in basis:
            direction = direction - (direction * other).sum() * other
        basis.append(direction / np.sqrt((direction * direction).sum()))
    return np.array(basis)
