"""Decompositions of scikit-learn that have an inverse, as priors: `sklearn:KernelPCA`, `sklearn:FactorAnalysis`."""

import importlib
import json
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.fitting.check import at_least, one_of
from posefit.fitting.kernels import add_components
from posefit.geometry.skeleton import Skeleton
from posefit.reading import quoted
from posefit_priors.pca import (
    CLUSTERS,
    COMPONENTS,
    QUANTILE,
    angles_of,
    clusters_of,
    distances,
)

# of `sklearn.decomposition`, those that have an inverse or are linear
VARIANTS = (
    "DictionaryLearning", "FactorAnalysis", "FastICA", "IncrementalPCA", "KernelPCA", "MiniBatchDictionaryLearning",
    "MiniBatchSparsePCA", "PCA", "SparsePCA", "TruncatedSVD",
)  # fmt: skip
KERNEL_POSES = 5_000  # of a KernelPCA, whose memory is their square
DEFAULTS: dict[str, dict[str, Any]] = {
    "KernelPCA": {"kernel": "rbf", "gamma": 0.2, "fit_inverse_transform": True}
}


class Transformed:
    """The space of a scikit-learn transformer, with the paper's constraints 1 and 2 on its latents.

    A linear transformer is inverted by our own loop; any other row by row, about 100 us each, since the same row must
    always give the same bits.

    Settings:
        variant: the class, such as KernelPCA; `sklearn:NAME` sets it.
        components (m): its `n_components`, 1 or more.
        options: its other parameters, a JSON object.
    """

    low: Array  # (m,)
    high: Array  # (m,)
    centres: Array  # (K, m)
    reach: Array  # ()

    def __init__(
        self,
        *,
        variant: str = "KernelPCA",
        components: int = COMPONENTS,
        options: str = "{}",
    ) -> None:
        at_least("components", components, 1)
        self._settings = variant, components, options
        _built(variant, components, options)

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError where the class cannot, or has no inverse."""
        angles = angles_of(angles, max(CLUSTERS, self._settings[1] + 1))
        if self._settings[0] == "KernelPCA" and len(angles) > KERNEL_POSES:
            raise InputError(
                f"KernelPCA must learn from at most {KERNEL_POSES} poses, got {len(angles)}"
            )
        self._model = _built(*self._settings)
        self._model.fit(angles)
        latents = self.transform(angles)
        if latents.ndim != 2 or latents.shape[1] < 1 or not np.isfinite(latents).all():
            name = type(self._model).__name__
            raise InputError(
                f"variant must give finite latents (n, m), got {latents.shape} from {name}"
            )
        self._linear = _linear(self._model, latents.shape[1])
        self.low, self.high = latents.min(axis=0), latents.max(axis=0)
        self.centres, self.reach = clusters_of(latents, CLUSTERS, QUANTILE)
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray(self._model.transform(np.asarray(angles)), dtype=np.float64)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        from sklearn import config_context

        if self._linear is not None:
            components, mean = self._linear
            angles = np.repeat(mean[None], len(latents), axis=0)
            add_components(writeable(latents), components, angles)
            return angles
        angles = np.empty((len(latents), 63))
        with config_context(assume_finite=True, skip_parameter_validation=True):
            for row, latent in enumerate(np.asarray(latents)):
                angles[row] = self._model.inverse_transform(latent[None])[0]
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are nearer than chi to a cluster's centre (n,). As SAPSO 2.2."""
        return np.asarray(distances(writeable(latents), self.centres) < self.reach)


def _built(variant: str, components: int, options: str) -> Any:
    """Return the transformer. Raises ValueError where there is none of that name, or its parameters are others."""
    one_of("variant", variant, VARIANTS)
    kind = getattr(importlib.import_module("sklearn.decomposition"), variant)
    try:
        parameters = json.loads(options)
        if not isinstance(parameters, dict):
            raise TypeError(type(parameters).__name__)
    except (ValueError, TypeError) as error:
        raise InputError(
            f"options must be a JSON object, got {quoted(options)} ({error})"
        ) from None
    known = kind().get_params()
    defaults = {
        "n_components": components,
        "random_state": 0,
        **DEFAULTS.get(variant, {}),
    }
    if unknown := sorted(set(parameters) - set(known)):
        raise InputError(
            f"options of {variant} must be of {', '.join(sorted(known))}, got {', '.join(unknown)}"
        )
    return kind(
        **{name: value for name, value in defaults.items() if name in known}
        | parameters
    )


def _linear(model: Any, components: int) -> tuple[Array, Array] | None:
    """Return the matrix (m, 63) and the mean (63,) of a transformer whose inverse is linear; None of another."""
    if type(model).__name__ == "FactorAnalysis":
        return writeable(model.components_), writeable(model.mean_)
    probe = np.vstack(
        [np.zeros(components), np.eye(components), np.full(components, 0.5)]
    )
    try:
        images = np.asarray(model.inverse_transform(probe), dtype=np.float64)
    except (ValueError, AttributeError) as error:
        raise InputError(
            f"variant must have an inverse, got {type(model).__name__}: {error}"
        ) from None
    if images.shape != (len(probe), 63):
        raise InputError(
            f"variant must give back 63 angles, got {images.shape[1:]} from {type(model).__name__}"
        )
    matrix = images[1:-1] - images[0]
    if np.allclose(
        images[-1], images[0] + 0.5 * matrix.sum(axis=0), rtol=0.0, atol=1e-9
    ):
        return writeable(matrix), writeable(images[0])
    return None
