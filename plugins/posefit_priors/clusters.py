"""K-means: the centres that mark where poses are. SAPSO 2.2.

Lloyd's algorithm from several beginnings, each seeded by the greedy k-means++ of D. Arthur and S. Vassilvitskii, 2007
(k-means++: the advantages of careful seeding). The draws and the rules are those of scikit-learn's `KMeans`, so that a
seed means the same clusters there. To import that takes two seconds; to cluster some hundred poses, some milliseconds.
"""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array

BEGINNINGS = 10  # of which the best is kept
ROUNDS = 300  # at most, of Lloyd's algorithm
STILL = 1e-4  # share of the mean variance: centres that move less in a round, their squares summed, have arrived


def clustered(latents: Array, clusters: int, seed: int) -> tuple[Array, NDArray[np.int64]]:
    """Return the centres (K, m) that K-means finds among latents (n, m), and each one's cluster (n,)."""
    draws = np.random.RandomState(seed)
    middle = latents.mean(axis=0)
    points = latents - middle
    enough = STILL * float(latents.var(axis=0).mean())
    least, centres, labels = np.inf, points[:0], np.zeros(0, dtype=np.int64)
    for _ in range(BEGINNINGS):
        moved, mine = _converged(points, _seeded(points, clusters, draws), enough)
        spread = float(((points - moved[mine]) ** 2).sum())
        # rounding may call one of two equal partitions the better one
        if spread < least and not _same(mine, labels, clusters):
            least, centres, labels = spread, moved, mine
    return centres + middle, labels


def _seeded(points: Array, clusters: int, draws: np.random.RandomState) -> Array:
    """Return points (K, m) far from each other: of some that are drawn by their squared distances, the best each."""
    n = len(points)
    tries = 2 + int(np.log(clusters))
    picked = [int(draws.choice(n, p=np.full(n, 1.0 / n)))]
    nearest = _squares(points[picked], points)[0]
    while len(picked) < clusters:
        wanted = draws.uniform(size=tries) * nearest.sum()
        candidates = np.minimum(np.searchsorted(nearest.cumsum(), wanted), n - 1)
        left = np.minimum(nearest, _squares(points[candidates], points))
        best = int(left.sum(axis=1).argmin())
        picked.append(int(candidates[best]))
        nearest = left[best]
    return points[picked]


def _converged(points: Array, centres: Array, enough: float) -> tuple[Array, NDArray[np.int64]]:
    """Return where centres (K, m) arrive that move to the mean of their points, and each point's cluster (n,)."""
    labels = np.full(len(points), -1)
    for _ in range(ROUNDS):
        before, labels = labels, _nearest(points, centres)
        moved = _means(points, labels, centres)
        shift, centres = float(((moved - centres) ** 2).sum()), moved
        if np.array_equal(labels, before):
            return centres, labels
        if shift <= enough:
            break
    return centres, _nearest(points, centres)


def _means(points: Array, labels: NDArray[np.int64], centres: Array) -> Array:
    """Return the means (K, m) of clusters; one without points begins again at a point far from its own centre."""
    count = len(centres)
    members = np.bincount(labels, minlength=count)
    if not members.all():
        far = ((points - centres[labels]) ** 2).sum(axis=1)
        labels = labels.copy()
        for cluster, point in zip(np.flatnonzero(members == 0), far.argsort()[::-1], strict=False):
            if far[point] > 0.0:
                labels[point] = cluster
        members = np.bincount(labels, minlength=count)
    sums = (labels == np.arange(count)[:, None]).astype(np.float64) @ points
    means = sums / np.maximum(members, 1)[:, None]
    means[members == 0] = means[members.argmax()]  # there are fewer different points than clusters
    return np.asarray(means)


def _nearest(points: Array, centres: Array) -> NDArray[np.int64]:
    return np.asarray(((centres**2).sum(axis=1) - 2.0 * (points @ centres.T)).argmin(axis=1))


def _squares(some: Array, points: Array) -> Array:
    """Return the squared distances (k, n) of some points (k, m) from all (n, m)."""
    apart = (some**2).sum(axis=1)[:, None] - 2.0 * (some @ points.T) + (points**2).sum(axis=1)
    return np.asarray(np.maximum(apart, 0.0))


def _same(one: NDArray[np.int64], other: NDArray[np.int64], clusters: int) -> bool:
    """Return whether the clusters of `one` are parts of those of `other`, which may have other numbers."""
    if not len(other):
        return False
    return len(np.unique(one * clusters + other)) == len(np.unique(one))
