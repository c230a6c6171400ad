"""An Isomap of poses with a local linear inverse.

Q. Wang, G. Xu, H. Ai, Learning object intrinsic structure for robust visual tracking,
CVPR 2003. Isomap gives training poses coordinates that preserve their geodesic
distances. Isomap itself does not map coordinates back to a pose; a linear model of the
nearest training poses does. The SAPSO paper calls the lack of a closed-form inverse the
largest obstacle of manifolds.

Interpretations: the weights of the linear model rebuild the coordinates best from those
of the nearest poses (Roweis and Saul, 2000), damped. A latent is feasible if a training
pose is near enough. Poses have the smallest number of neighbours in the graph that
connects all of them. At most `poses` training poses are used, evenly spaced.
"""

import warnings
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, at_least
from posefit_related.training import evenly, training_angles

# ours: neighbours of a pose in the graph; more if they do not connect all poses
NEIGHBOURS = 8
NEAREST = 6  # ours: training poses that the inverse combines
# ours: damping of its weights, as a share of the neighbours' mean squared distance
DAMPING = 1e-2
# ours: largest distance of a feasible latent from a training pose, as a share of the
# range's half diagonal
REACH = 0.5


def rebuilt(latents: Array, centres: Array, angles: Array) -> Array:
    """Return angles (n, 63) of latents (n, m) by a linear model of nearby poses.

    `centres` (T, m) are the latents of the training poses, `angles` (T, 63) their
    angles.
    """
    squares = ((latents[:, None] - centres) ** 2).sum(axis=2)
    nearest = np.argsort(squares, axis=1, kind="stable")[:, :NEAREST]
    away = centres[nearest] - latents[:, None]
    gram = np.einsum("nkm,nlm->nkl", away, away)
    damping = DAMPING * np.einsum("nkk->n", gram) / gram.shape[1] + 1e-12  # (n,)
    gram += damping[:, None, None] * np.eye(gram.shape[1])
    weights = np.linalg.solve(gram, np.ones((*gram.shape[:2], 1)))[..., 0]
    weights /= weights.sum(axis=1, keepdims=True)
    # WANG2003 (way back)
    return np.asarray(np.einsum("nk,nka->na", weights, angles[nearest]))


class IsomapPrior:
    """Geodesic coordinates of poses, with a local linear inverse.

    Settings:
        components: Dimensions of a latent, 1 or more.
        poses: Largest number of training poses to use, 20 or more.
    """

    low: Array  # (m,)
    high: Array  # (m,)

    def __init__(self, *, components: int = 3, poses: int = 400) -> None:
        at_least("components", components, 1)
        at_least("poses", poses, 20)
        self._components = components
        self._poses = poses

    def fit(self, angles: Array, skeleton: object = None) -> Self:
        """Learn from joint angles (T, 63). Raises ValueError if they are unusable."""
        from sklearn.manifold import Isomap

        angles = training_angles(angles, max(NEIGHBOURS, self._components) + 1)
        self.angles = evenly(angles, self._poses)
        for neighbours in range(NEIGHBOURS, len(self.angles)):
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # the graph has several pieces
                try:
                    model = Isomap(
                        n_neighbors=neighbours, n_components=self._components
                    ).fit(self.angles)
                    break
                except Warning:
                    continue
        else:
            raise ValueError(
                "angles must be of similar poses, "
                f"got {len(angles)} that no graph of neighbours connects"
            )
        self._model: Any = model
        # WANG2003 (Isomap)
        self.centres = np.asarray(model.embedding_, dtype=np.float64)
        latents = np.concatenate([self.centres, self.transform(angles)])
        self.low = latents.min(axis=0)
        self.high = latents.max(axis=0)
        self.reach = REACH * 0.5 * float(np.linalg.norm(self.high - self.low))
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray(self._model.transform(np.asarray(angles)), dtype=np.float64)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return rebuilt(np.asarray(latents, dtype=np.float64), self.centres, self.angles)

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are near a training pose (n,)."""
        squares = ((np.asarray(latents)[:, None] - self.centres) ** 2).sum(axis=2)
        return np.asarray(squares.min(axis=1) <= self.reach**2)
