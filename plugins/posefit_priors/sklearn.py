"""Decompositions of scikit-learn with an inverse, as priors: `sklearn:KernelPCA`."""

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

# classes of `sklearn.decomposition` that have an inverse or are linear
VARIANTS = (
    "DictionaryLearning", "FactorAnalysis", "FastICA", "IncrementalPCA", "KernelPCA",
    "MiniBatchDictionaryLearning", "MiniBatchSparsePCA", "PCA", "SparsePCA",
    "TruncatedSVD",
)  # fmt: skip
# largest number of poses for KernelPCA, whose memory grows with its square
KERNEL_POSES = 5_000
DEFAULTS: dict[str, dict[str, Any]] = {
    "KernelPCA": {"kernel": "rbf", "gamma": 0.2, "fit_inverse_transform": True}
}


class Transformed:
    """The space of a scikit-learn transformer, with constraints 1 and 2 on its latents.

    A linear transformer is inverted by posefit's own loop. Any other is inverted row by
    row, about 100 us each, because a row must always give the same bits.

    Settings:
        variant: The class, such as KernelPCA; `sklearn:NAME` sets it.
        components (m): The transformer's `n_components`, 1 or more.
        options: Other parameters of the transformer, as a JSON object.
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
        """Learn the space from joint angles (T, 63).

        Raises ValueError if the class cannot learn from them, or has no inverse.
        """
        angles = angles_of(angles, max(CLUSTERS, self._settings[1] + 1))
        if self._settings[0] == "KernelPCA" and len(angles) > KERNEL_POSES:
            raise InputError(
                f"KernelPCA must learn from at most {KERNEL_POSES} poses, "
                f"got {len(angles)}"
            )
        self._model = _built(*self._settings)
        self._model.fit(angles)
        latents = self.transform(angles)
        if latents.ndim != 2 or latents.shape[1] < 1 or not np.isfinite(latents).all():
            name = type(self._model).__name__
            raise InputError(
                "variant must give finite latents (n, m), "
                f"got {latents.shape} from {name}"
            )
        self._linear = _linear(self._model, latents.shape[1])
        self.low = latents.min(axis=0)
        self.high = latents.max(axis=0)
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
        """Return which latents (n, m) are closer than chi to a cluster's centre (n,).

        As SAPSO 2.2.
        """
        return np.asarray(distances(writeable(latents), self.centres) < self.reach)


def _built(variant: str, components: int, options: str) -> Any:
    """Return the transformer. Raises ValueError if a name or parameter is unknown."""
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
            f"options of {variant} must be among {', '.join(sorted(known))}, "
            f"got {', '.join(unknown)}"
        )
    for name, value in defaults.items():
        if name in known:
            parameters.setdefault(name, value)
    return kind(**parameters)


def _linear(model: Any, components: int) -> tuple[Array, Array] | None:
    """Return the matrix (m, 63) and mean (63,) of a linear inverse, or None."""
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
            "variant must have an inverse to 63 angles, "
            f"got {images.shape[1:]} from {type(model).__name__}"
        )
    matrix = images[1:-1] - images[0]
    if np.allclose(
        images[-1], images[0] + 0.5 * matrix.sum(axis=0), rtol=0.0, atol=1e-9
    ):
        return writeable(matrix), writeable(images[0])
    return None
