"""One prior for several motions at once: walk and run and turn.

The paper's own first stated limit is one learnt space a motion. A mixture of local spaces would need a coordinate that
says which one, and a search that moves continuously cannot cross it. So there is one linear space for all, in which
every region has equal weight however long its clip was; and constraint 2 becomes the local part: a pose is feasible
where it is near one of many clusters, each with a shape of its own, a tube along its motion and not a ball.
"""

from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.fitting.check import at_least, positive
from posefit.geometry.skeleton import Skeleton
from posefit_priors.arrays import angles_of, load_arrays
from posefit_priors.clusters import clustered
from posefit_priors.kernels import mahalanobis, recover
from posefit_priors.pca import check_components, principal

COMPONENTS = 0.95  # share of the variance, as the paper asks of its own spaces
CLUSTERS = 12
# How much of the whole's covariance each cluster's gets added, so that a tube has a width. Measured on walk and run: at
# 0.2 swarms get stuck in the tubes, at 1 half of what lies between the two motions is let in again.
BREADTH = 0.6
QUANTILE = 0.99  # as Interpretation S5
_SHAPES = {
    "mean": (63,),
    "components": ("m", 63),
    "low": ("m",),
    "high": ("m",),
    "centres": ("k", "m"),
    "whitening": ("k", "m", "m"),
    "reach": (),
}


class Union:
    """Principal components of several motions with a union of local Gaussians as the constraint.

    A pose is feasible within a Mahalanobis distance of a cluster, its covariance regularised towards the whole's.

    Settings:
        components (m): a whole number of them, or a share of the variance below 1 to keep at least. As `pca`.
        clusters (K): that K-means finds among the training poses, 1 or more. Ours.
        breadth: share of the whole covariance that is added to each cluster's own, above 0. Ours.
        quantile: of the training distances that is still near, above 0 and at most 1. As Interpretation S5.
        seed: of the clustering, 0 or more.
    """

    mean: Array  # (63,)
    components: Array  # (m, 63)
    low: Array  # (m,)
    high: Array  # (m,)
    centres: Array  # (K, m)
    whitening: Array  # (K, m, m): |whitening @ (latent - centre)| is the Mahalanobis distance
    reach: Array  # ()

    def __init__(
        self,
        *,
        components: float = COMPONENTS,
        clusters: int = CLUSTERS,
        breadth: float = BREADTH,
        quantile: float = QUANTILE,
        seed: int = 0,
    ) -> None:
        check_components(components)
        at_least("clusters", clusters, 1)
        positive("breadth", breadth)
        if not 0.0 < quantile <= 1.0:
            raise InputError(f"quantile must lie in 0 to 1, got {quantile}")
        at_least("seed", seed, 0)
        self._components, self._clusters, self._breadth = components, clusters, breadth
        self._quantile, self._seed = quantile, seed

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from the joint angles (T, 63) of all motions together.

        Raises ValueError where there are too few frames.
        """
        least = int(self._components) + 1 if self._components >= 1 else 2
        angles = angles_of(angles, max(self._clusters, least))
        _, labels = clustered(angles, self._clusters, self._seed)
        weights = 1.0 / np.bincount(labels, minlength=self._clusters)[labels] / len(np.unique(labels))
        self.mean = weights @ angles
        self.components, _ = principal(np.sqrt(weights)[:, None] * (angles - self.mean), self._components)
        latents = self.transform(angles)
        self.low, self.high = latents.min(axis=0), latents.max(axis=0)
        whole = (weights[:, None] * latents).T @ latents
        shapes = [latents[labels == k] for k in np.unique(labels)]
        self.centres = np.array([one.mean(axis=0) for one in shapes])
        covariances = np.array([np.cov(one.T, bias=True).reshape(whole.shape) for one in shapes])
        covariances += self._breadth * whole + 1e-12 * np.eye(len(whole))
        self.whitening = np.linalg.inv(np.linalg.cholesky(covariances))
        distances = mahalanobis(self.centres, self.whitening, writeable(latents))
        self.reach = np.array(np.quantile(distances, self._quantile))
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray((np.asarray(angles, dtype=np.float64) - self.mean) @ self.components.T)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        angles = np.empty((len(latents), len(self.mean)))
        recover(writeable(latents), self.components, self.mean, angles)
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) lie within reach of a cluster (n,)."""
        return np.asarray(mahalanobis(self.centres, self.whitening, writeable(latents)) <= self.reach)

    def save(self, path: str | Path) -> None:
        """Write the learned space to an .npz file."""
        np.savez(path, **{name: getattr(self, name) for name in _SHAPES})

    @classmethod
    def load(cls, path: str | Path) -> "Union":
        """Return the space that `save` wrote. Raises ValueError where the file is not one."""
        arrays = load_arrays(path, _SHAPES)
        prior = cls(clusters=len(arrays["centres"]))
        for name, value in arrays.items():
            setattr(prior, name, value)
        return prior
