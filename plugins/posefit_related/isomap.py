"""An Isomap of poses with a local linear way back.

Q. Wang, G. Xu, H. Ai, Learning object intrinsic structure for robust visual tracking, CVPR 2003. Isomap gives poses of
training coordinates that keep their geodesic distances; the way back from such coordinates to a pose, which Isomap does
not have, is a linear model of the nearest training poses. The SAPSO paper calls the lack of a closed-form inverse the
largest obstacle of manifolds.

Interpretations: the linear model has the weights that rebuild the coordinates best from those of the nearest poses
(Roweis and Saul, 2000), damped; a latent is feasible if a training pose is near enough; poses have as few neighbours in
the graph as connect all of them; at most `poses` training poses are used, evenly spaced.
"""

import warnings
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, at_least
from posefit_related.training import evenly, training_angles

NEIGHBOURS = 8  # ours: of a pose in the graph; more where they do not connect all poses
NEAREST = 6  # ours: training poses of the way back
# ours: of its weights, as a share of the neighbours' mean squared distance
DAMPING = 1e-2
# ours: of a feasible latent from a training pose, as a share of the range's half
# diagonal
REACH = 0.5


def rebuilt(latents: Array, centres: Array, angles: Array) -> Array:
    """Return angles (n, 63) of latents (n, m), by a linear model of the nearest centres (T, m) with angles (T, 63)."""
    squares = ((latents[:, None] - centres) ** 2).sum(axis=2)
    nearest = np.argsort(squares, axis=1, kind="stable")[:, :NEAREST]
    away = centres[nearest] - latents[:, None]
    gram = np.einsum("nkm,nlm->nkl", away, away)
    gram += (DAMPING * np.einsum("nkk->n", gram) / gram.shape[1] + 1e-12)[
        :, None, None
    ] * np.eye(gram.shape[1])
    weights = np.linalg.solve(gram, np.ones((*gram.shape[:2], 1)))[..., 0]
    weights /= weights.sum(axis=1, keepdims=True)
    # WANG2003 (way back)
    return np.asarray(np.einsum("nk,nka->na", weights, angles[nearest]))


class IsomapPrior:
    """Geodesic coordinates of poses, and a local linear way back.

    Settings:
        components: dimensions of a latent, 1 or more.
        poses: of the training poses, the most that are used, 20 or more.
    """

    low: Array  # (m,)
    high: Array  # (m,)

    def __init__(self, *, components: int = 3, poses: int = 400) -> None:
        at_least("components", components, 1)
        at_least("poses", poses, 20)
        self._components = components
        self._poses = poses

    def fit(self, angles: Array, skeleton: object = None) -> Self:
        """Learn from joint angles (T, 63). Raises ValueError where they are not, or too few."""
        from sklearn.manifold import Isomap

        angles = training_angles(angles, max(NEIGHBOURS, self._components) + 1)
        self.angles = evenly(angles, self._poses)
        for neighbours in range(NEIGHBOURS, len(self.angles)):
            with warnings.catch_warnings():
                warnings.simplefilter("error")  # a graph in several pieces
                try:
                    model = Isomap(
                        n_neighbors=neighbours, n_components=self._components
                    ).fit(self.angles)
                    break
                except Warning:
                    continue
        else:
            raise ValueError(
                f"angles must be of poses near each other, got {len(angles)} that no graph connects"
            )
        self._model: Any = model
        # WANG2003 (Isomap)
        self.centres = np.asarray(model.embedding_, dtype=np.float64)
        latents = np.concatenate([self.centres, self.transform(angles)])
        self.low, self.high = latents.min(axis=0), latents.max(axis=0)
        self.reach = REACH * 0.5 * float(np.linalg.norm(self.high - self.low))
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray(self._model.transform(np.asarray(angles)), dtype=np.float64)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return rebuilt(np.asarray(latents, dtype=np.float64), self.centres, self.angles)

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) have a training pose near them (n,)."""
        squares = ((np.asarray(latents)[:, None] - self.centres) ** 2).sum(axis=2)
        return np.asarray(squares.min(axis=1) <= self.reach**2)
