"""A Gaussian process latent variable model of poses.

R. Urtasun, D. Fleet, A. Hertzmann, P. Fua, Priors for people tracking from small training sets, ICCV 2005. Poses are
functions of few latents, drawn from a Gaussian process that is scaled for each angle; latents and kernel are those of
the highest likelihood for a small set of poses. The SAPSO paper objects that such a space is hardly continuous along a
motion, so that poses between those of training come out badly.

Interpretations: angles are scaled by their deviations; L-BFGS fits the model, starting from principal components; the
latents of a pose are the mean of those of the nearest training poses, by the inverse of their squared distance; a
latent is feasible where the process is certain enough, instead of a cost that grows with its variance.
"""

from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.plugin import Array, at_least
from posefit_related.frames import squared_distances
from posefit_related.training import evenly, training_angles

STEPS = 150  # ours: of L-BFGS
NEAREST = 4  # ours: training poses whose latents a pose has
# ours: of a feasible latent, as a share of the process's own variance
MAX_VARIANCE = 0.7


def kernel(first: Array, second: Array, logs: Array) -> Array:
    """Return the covariances (n, k) of latents (n, m) and (k, m): exp(logs) are variance and inverse square width."""
    squares = ((first[:, None] - second) ** 2).sum(axis=2)
    return np.asarray(np.exp(logs[0] - 0.5 * np.exp(logs[1]) * squares))


def loss(parameters: Array, y: Array) -> tuple[float, Array]:
    """Return the negative log posterior of latents and kernel, but for a constant, and its gradient.

    `parameters` are the latents (n, m), then the logarithms of variance, inverse square width and noise; `y` (n, D).
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
        components: dimensions of a latent, 1 or more.
        poses: of the training poses, the most that are used, 20 or more.
    """

    low: Array  # (m,)
    high: Array  # (m,)

    def __init__(self, *, components: int = 3, poses: int = 100) -> None:
        at_least("components", components, 1)
        at_least("poses", poses, 20)
        self._components = components
        self._poses = poses

    def fit(self, angles: Array, skeleton: object = None) -> Self:
        """Learn from joint angles (T, 63). Raises ValueError where they are not, or too few."""
        angles = training_angles(angles, max(NEAREST, self._components) + 1)
        self.angles, self.mean = evenly(angles, self._poses), angles.mean(axis=0)
        self.scale = np.maximum(angles.std(axis=0), 1e-3)  # URTASUN2005 (scales)
        y = (self.angles - self.mean) / self.scale
        # not before it is needed: it takes a third of a second
        from scipy.optimize import minimize

        scores, sizes, _ = np.linalg.svd(y, full_matrices=False)
        x = (scores * np.sqrt(len(y)))[:, : self._components] * (sizes > 1e-9)[
            : self._components
        ]
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
        noisy = kernel(self.latents, self.latents, self.logs) + (
            np.exp(self.logs[2]) + 1e-6
        ) * np.eye(len(y))
        self.inverse = np.linalg.inv(noisy)
        self.factors = self.inverse @ y
        self.low, self.high = self.latents.min(axis=0), self.latents.max(axis=0)
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63): those of the nearest training poses."""
        squares = squared_distances(
            np.asarray(angles) / self.scale, self.angles / self.scale
        )
        nearest = np.argsort(squares, axis=1, kind="stable")[:, :NEAREST]
        weights = 1.0 / (np.take_along_axis(squares, nearest, axis=1) + 1e-9)
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("nk,nkm->nm", weights, self.latents[nearest]))

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m): the mean of the process."""
        near = kernel(np.asarray(latents), self.latents, self.logs)
        # URTASUN2005 (mean)
        return np.asarray(
            self.mean + self.scale * np.einsum("nk,ka->na", near, self.factors)
        )

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return where the process is certain enough (n,)."""
        near = kernel(np.asarray(latents), self.latents, self.logs)
        # URTASUN2005 (variance)
        explained = np.einsum("nk,kl,nl->n", near, self.inverse, near)
        return np.asarray(1.0 - explained / np.exp(self.logs[0]) <= MAX_VARIANCE)
