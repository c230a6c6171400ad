"""The compact pose space: principal components, a range, and clusters that mark where poses are. SAPSO section 2."""

from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.geometry.arrays import writeable
from posefit.geometry.kinematics import jit
from posefit.geometry.rotation import Array

COMPONENTS = 6  # m, section 2.1
CLUSTERS = 5  # K, section 2.2
QUANTILE = 0.99  # Reading S5: chi is this quantile of the training distances
_ARRAYS = ("mean", "components", "low", "high", "centres", "reach", "explained")


class PCA:
    """Principal components of joint angles with constraint 1, a range, and constraint 2, nearness to a cluster.

    Settings: how many `components`, a whole number, or a share of the variance below 1 to keep at least;
    how many `clusters`; the `quantile` of training distances that chi is; the `seed` of the clustering.
    """

    mean: Array  # (63,) c
    components: Array  # (m, 63) rows are U_m transposed
    explained: Array  # (m,) share of the variance along each component
    low: Array  # (m,)
    high: Array  # (m,)
    centres: Array  # (K, m) cluster centres
    reach: Array  # () chi

    def __init__(
        self,
        *,
        components: float = COMPONENTS,
        clusters: int = CLUSTERS,
        quantile: float = QUANTILE,
        seed: int = 0,
    ) -> None:
        if components <= 0 or (components >= 1 and components != int(components)):
            raise ValueError(f"components must be a whole number or a share of variance below 1, got {components}")
        if clusters < 1:
            raise ValueError(f"clusters must be at least 1, got {clusters}")
        if not 0.0 < quantile <= 1.0:
            raise ValueError(f"quantile must lie in 0 to 1, got {quantile}")
        self._components, self._clusters, self._quantile, self._seed = components, clusters, quantile, seed

    def fit(self, angles: Array) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError where there are too few frames."""
        angles = np.asarray(angles, dtype=np.float64)
        most = min(len(angles) - 1, angles.shape[1])
        if len(angles) < self._clusters or most < max(1.0, self._components):
            needed = int(max(self._clusters, self._components + 1, 2))
            raise ValueError(f"angles must hold at least {needed} frames, got {len(angles)}")
        self.mean = angles.mean(axis=0)  # SAPSO 2.1.1
        _, spread, directions = np.linalg.svd(angles - self.mean, full_matrices=False)  # SAPSO 2.1.2
        share = spread**2 / max(float((spread**2).sum()), np.finfo(float).tiny)
        kept = (
            int(self._components)
            if self._components >= 1
            else int(np.searchsorted(share.cumsum(), self._components)) + 1
        )
        self.explained, self.components = share[:kept].copy(), directions[:kept].copy()
        latents = self.transform(angles)
        self.low, self.high = latents.min(axis=0), latents.max(axis=0)  # SAPSO 2.2 constraint 1
        self.centres = self._cluster(latents)
        self.reach = np.array(np.quantile(_nearest(self.centres, latents), self._quantile))  # Reading S5
        return self

    def _cluster(self, latents: Array) -> Array:
        from sklearn.cluster import KMeans

        found = KMeans(self._clusters, n_init=10, random_state=self._seed).fit(latents)
        return np.array(found.cluster_centers_, dtype=np.float64)

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63): Projection. SAPSO 2.1."""
        return (np.asarray(angles) - self.mean) @ self.components.T  # SAPSO 2.1.3 projection

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m): Recovery. SAPSO 2.1."""
        angles = np.empty((len(latents), len(self.mean)))
        _recover(writeable(latents), self.components, self.mean, angles)
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are nearer than chi to a cluster's centre (n,). SAPSO 2.2 constraint 2."""
        return np.asarray(_near(self.centres, writeable(latents), self.reach))

    def save(self, path: str | Path) -> None:
        """Write the learned space to an .npz file."""
        np.savez(path, **{name: getattr(self, name) for name in _ARRAYS})

    @classmethod
    def load(cls, path: str | Path) -> "PCA":
        """Return the space that `save` wrote. Raises ValueError where the file is not one."""
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: np.array(stored[name], dtype=np.float64) for name in _ARRAYS}
        except (KeyError, ValueError, OSError) as error:
            if isinstance(error, FileNotFoundError):
                raise
            raise ValueError(f"{path}: expected an .npz file with {', '.join(_ARRAYS)}, got {error}") from None
        m = len(arrays["components"])
        shapes = ((63,), (m, 63), (m,), (m,), (len(arrays["centres"]), m), (), (m,))
        for name, shape in zip(_ARRAYS, shapes, strict=True):
            if arrays[name].shape != shape or not np.isfinite(arrays[name]).all():
                raise ValueError(f"{path}: {name} must be finite and of shape {shape}, got {arrays[name].shape}")
        prior = cls(components=m, clusters=len(arrays["centres"]))
        for name, value in arrays.items():
            setattr(prior, name, value)
        return prior


@jit
def _recover(latents, components, mean, angles):
    for i in range(latents.shape[0]):
        for j in range(mean.size):
            angles[i, j] = mean[j]
        for k in range(components.shape[0]):
            for j in range(mean.size):
                angles[i, j] += latents[i, k] * components[k, j]  # SAPSO 2.1.3 recovery


@jit
def _distance(centres, latent):
    """Return D: the mean absolute difference of a latent pose (m,) from the nearest centre."""
    nearest = np.inf
    for c in range(centres.shape[0]):
        total = 0.0
        for j in range(centres.shape[1]):
            total += abs(centres[c, j] - latent[j])
        nearest = min(nearest, total / centres.shape[1])
    return nearest


@jit
def _near(centres, latents, reach):
    near = np.empty(latents.shape[0], np.bool_)
    for i in range(latents.shape[0]):
        near[i] = _distance(centres, latents[i]) < reach[()]  # SAPSO 2.2 constraint 2
    return near


def _nearest(centres: Array, latents: Array) -> Array:
    """Return D (n,) of latents (n, m)."""
    return np.array([_distance(centres, latent) for latent in latents])
