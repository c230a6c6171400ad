"""A Gaussian process latent variable model of poses.

R. Urtasun, D. Fleet, A. Hertzmann, P. Fua, Priors for people tracking from small
training sets, ICCV 2005. Poses are functions of a few latents. The functions are drawn
from a Gaussian process that is scaled for each angle. Latents and kernel have the
highest likelihood for a small set of poses. The SAPSO paper objects that such a space
is hardly continuous along a motion, so that poses between the training poses are poor.

Interpretations: angles are scaled by their standard deviations. L-BFGS fits the model,
and starts from principal components. The latents of a pose are a mean over the nearest
training poses, weighted by the inverse squared distance. A latent is feasible if the
process is certain enough; the publication has a cost that grows with the variance.
"""

from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, at_least
from posefit_related.frames import squared_distances
from posefit_related.training import evenly, training_angles

STEPS = 150  # ours: iterations of L-BFGS
NEAREST = 4  # ours: number of training poses that determine a pose's latents
# ours: largest variance of a feasible latent, as a share of the process's variance
MAX_VARIANCE = 0.7


def kernel(first: Array, second: Array, logs: Array) -> Array:
    """Return the covariances (n, k) of latents (n, m) and (k, m).

    exp(logs) are the variance and the inverse square width.
    """
    squares = ((first[:, None] - second) ** 2).sum(axis=2)
    return np.asarray(np.exp(logs[0] - 0.5 * np.exp(logs[1]) * squares))


def loss(parameters: Array, y: Array) -> tuple[float, Array]:
    """Return the negative log posterior of latents and kernel, and its gradient.

    A constant is left out. `parameters` are the latents (n, m), then the logarithms of
    variance, inverse square width and noise. `y` (n, D) are the scaled angles.
    """
    n = len(y)
    logs = parameters[-3:]
    x = parameters[:-3].reshape(n, -1)
    smooth = kernel(x, x, logs)
    inverse = np.linalg.inv(smooth + (np.exp(logs[2]) + 1e-6) * np.eye(n))
    fitted = inverse @ y
    logdet = -np.linalg.slogdet(inverse)[1]
    # URTASUN2005 (likelihood)
    value = 0.5 * y.shape[1] * logdet + 0.5 * np.sum(fitted * y) + 0.5 * np.sum(x**2)
    by_covariances = 0.5 * (y.shape[1] * inverse - fitted @ fitted.T)
    away = x[:, None] - x
    width = np.exp(logs[1])
    by_x = -2.0 * width * np.einsum("ij,ijm->im", by_covariances * smooth, away) + x
    by_width = -0.5 * width * np.sum(by_covariances * smooth * (away**2).sum(axis=2))
    by_logs = [
        np.sum(by_covariances * smooth),
        by_width,
        np.exp(logs[2]) * np.trace(by_covariances),
    ]
    return float(value), np.concatenate([by_x.ravel(), by_logs])


class GPLVM:
    """Latents of a Gaussian process, learned from a subsample of poses.

    Settings:
        components: Dimensions of a latent, 1 or more.
        poses: Largest number of training poses to use, 20 or more.
    """

    low: Array  # (m,)
    high: Array  # (m,)

    def __init__(self, *, components: int = 3, poses: int = 100) -> None:
        at_least("components", components, 1)
        at_least("poses", poses, 20)
        self._components = components
        self._poses = poses

    def fit(self, angles: Array, skeleton: object = None) -> Self:
        """Learn from joint angles (T, 63). Raises ValueError if they are unusable."""
        angles = training_angles(angles, max(NEAREST, self._components) + 1)
        self.angles = evenly(angles, self._poses)
        self.mean = angles.mean(axis=0)
        self.scale = np.maximum(angles.std(axis=0), 1e-3)  # URTASUN2005 (scales)
        y = (self.angles - self.mean) / self.scale
        # imported only when needed: it takes a third of a second
        from scipy.optimize import minimize

        scores, sizes, _ = np.linalg.svd(y, full_matrices=False)
        nonzero = (sizes > 1e-9)[: self._components]
        x = (scores * np.sqrt(len(y)))[:, : self._components] * nonzero
        start = np.concatenate([x.ravel(), [0.0, 0.0, np.log(0.05)]])
        end = np.asarray(
            minimize(
                loss,
                start,
                (y,),
                jac=True,
                method="L-BFGS-B",
                options={"maxiter": STEPS},
            ).x
        )
        self.latents = end[:-3].reshape(len(y), -1)
        self.logs = end[-3:]
        smooth = kernel(self.latents, self.latents, self.logs)  # (n, n)
        noisy = smooth + (np.exp(self.logs[2]) + 1e-6) * np.eye(len(y))
        self.inverse = np.linalg.inv(noisy)
        self.factors = self.inverse @ y
        self.low = self.latents.min(axis=0)
        self.high = self.latents.max(axis=0)
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63), from similar poses."""
        squares = squared_distances(
            np.asarray(angles) / self.scale, self.angles / self.scale
        )
        nearest = np.argsort(squares, axis=1, kind="stable")[:, :NEAREST]
        weights = 1.0 / (np.take_along_axis(squares, nearest, axis=1) + 1e-9)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("nk,nkm->nm", weights, self.latents[nearest]))

    def inverse_transform(self, latents: Array) -> Array:
        """Return joint angles (n, 63), the mean of the process, at latents (n, m)."""
        near = kernel(np.asarray(latents), self.latents, self.logs)
        # URTASUN2005 (mean)
        return np.asarray(
            self.mean + self.scale * np.einsum("nk,ka->na", near, self.factors)
        )

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return whether the process is certain enough (n,) at latents (n, m)."""
        near = kernel(np.asarray(latents), self.latents, self.logs)
        # URTASUN2005 (variance)
        explained = np.einsum("nk,kl,nl->n", near, self.inverse, near)
        return np.asarray(1.0 - explained / np.exp(self.logs[0]) <= MAX_VARIANCE)
