"""One prior for several motions at once: walk and run and turn.

The paper learns one space a motion. A mixture of local spaces would need a coordinate for the choice, and a search that
moves continuously cannot cross it. Here is one linear space for all, in which every region has equal weight however
long its clip is. Constraint 2 is local: a pose is feasible near one of many clusters, each a tube along its motion.
"""

from collections.abc import Mapping
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.fitting.check import positive
from posefit.geometry.skeleton import Skeleton
from posefit_priors.arrays import Shape, angles_of, check_clustering
from posefit_priors.clusters import clustered
from posefit_priors.kernels import mahalanobis
from posefit_priors.pca import SHAPES, Linear, check_components, frames_for, principal

COMPONENTS = 0.95  # share of the variance, as the paper asks of its own spaces
CLUSTERS = 12
# The share of the whole covariance that is added to each cluster's, so that a tube has a width. Measured on walk and
# run: at 0.2 swarms get stuck in the tubes, at 1 half of the poses between the two motions are feasible.
BREADTH = 0.6
QUANTILE = 0.99  # as Interpretation S5


class Union(Linear):
    """Principal components of several motions with a union of local Gaussians as the constraint.

    A pose is feasible within a Mahalanobis distance of a cluster, its covariance regularised towards the whole's.

    Settings:
        components (m): a whole number of them, or a share of the variance below 1 to keep at least. As `pca`.
        clusters (K): that K-means finds among the training poses, 1 or more. Ours.
        breadth: share of the whole covariance that is added to each cluster's own, above 0. Ours.
        quantile: of the training distances that is still near, above 0 and at most 1. As Interpretation S5.
        seed: of the clustering, 0 or more.
    """

    SHAPES: ClassVar[Mapping[str, Shape]] = {**SHAPES, "whitening": ("k", "m", "m"), "reach": ()}
    whitening: Array  # (K, m, m): |whitening @ (latent - centre)| is the Mahalanobis distance

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
        check_clustering(clusters, quantile, seed)
        positive("breadth", breadth)
        self._components, self._clusters, self._breadth = components, clusters, breadth
        self._quantile, self._seed = quantile, seed

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from the joint angles (T, 63) of all motions together.

        Raises ValueError where there are too few frames.
        """
        angles = angles_of(angles, max(self._clusters, frames_for(self._components)))
        _, labels = clustered(angles, self._clusters, self._seed)
        weights = 1.0 / np.bincount(labels, minlength=self._clusters)[labels] / len(np.unique(labels))
        self.mean = weights @ angles
        self.components, _ = principal(np.sqrt(weights)[:, None] * (angles - self.mean), self._components)
        latents = self.transform(angles)
        self.low, self.high = latents.min(axis=0), latents.max(axis=0)
        whole = (weights[:, None] * latents).T @ latents
        clusters = [latents[labels == k] for k in np.unique(labels)]
        self.centres = np.array([members.mean(axis=0) for members in clusters])
        covariances = np.array([np.cov(members.T, bias=True).reshape(whole.shape) for members in clusters])
        covariances += self._breadth * whole + 1e-12 * np.eye(len(whole))
        self.whitening = np.linalg.inv(np.linalg.cholesky(covariances))
        distances = mahalanobis(self.centres, self.whitening, writeable(latents))
        self.reach = np.array(np.quantile(distances, self._quantile))
        return self

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) lie within reach of a cluster (n,)."""
        return np.asarray(mahalanobis(self.centres, self.whitening, writeable(latents)) <= self.reach)
