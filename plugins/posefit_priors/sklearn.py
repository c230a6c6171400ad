"""Decompositions of scikit-learn that have an inverse, as priors: `sklearn:KernelPCA`, `sklearn:FactorAnalysis`."""

import importlib
import json
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.fitting.check import at_least, one_of
from posefit.geometry.skeleton import Skeleton
from posefit.limits import timed
from posefit.reading import cut, parsed_json, quoted
from posefit_priors.arrays import angles_of, check_clustering, load_arrays
from posefit_priors.clusters import clustered
from posefit_priors.kernels import near, recover
from posefit_priors.pca import CLUSTERS, COMPONENTS, QUANTILE, reach_of

# of `sklearn.decomposition`, those that have an inverse or are linear: a file may name no other class
VARIANTS = (
    "DictionaryLearning", "FactorAnalysis", "FastICA", "IncrementalPCA", "KernelPCA", "MiniBatchDictionaryLearning",
    "MiniBatchSparsePCA", "PCA", "SparsePCA", "TruncatedSVD",
)  # fmt: skip
KERNEL_POSES = 5_000  # of a KernelPCA, whose memory is their square
LOADING_SECONDS = 10.0  # a space of a file may take to be learned again
DEFAULTS: dict[str, dict[str, Any]] = {"KernelPCA": {"kernel": "rbf", "gamma": 0.2, "fit_inverse_transform": True}}


class Transformed:
    """The space of a scikit-learn transformer, with the paper's constraints 1 and 2 on its latents.

    A linear transformer is inverted by our own loop; any other row by row, about 100 us each, since the same row must
    always give the same bits.

    Settings:
        variant: the class, such as KernelPCA; `sklearn:NAME` sets it.
        components (m): its `n_components`, 1 or more.
        options: its other parameters, a JSON object.
        clusters (K): centres that K-means finds among the training poses, 1 or more. As `pca`.
        quantile: chi is this quantile of the training distances, above 0 and at most 1. As `pca`.
        seed: of the clustering, and of the class where it takes one, 0 or more.
    """

    low: Array  # (m,)
    high: Array  # (m,)
    centres: Array  # (K, m)
    reach: Array  # ()
    _limit: float | None = None  # seconds that the class may take to learn

    def __init__(
        self,
        *,
        variant: str = "KernelPCA",
        components: int = COMPONENTS,
        options: str = "{}",
        clusters: int = CLUSTERS,
        quantile: float = QUANTILE,
        seed: int = 0,
    ) -> None:
        at_least("components", components, 1)
        check_clustering(clusters, quantile, seed)
        # in the order of a file
        self._settings = [variant, components, options, clusters, quantile, seed]
        self._transformer = variant, components, options, seed
        self._components, self._clusters, self._quantile, self._seed = components, clusters, quantile, seed
        _built(*self._transformer)

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn the space from joint angles (T, 63). Raises ValueError where the class cannot, or has no inverse."""
        self._angles = angles_of(angles, max(self._clusters, self._components + 1))
        if self._transformer[0] == "KernelPCA" and len(self._angles) > KERNEL_POSES:
            raise InputError(f"KernelPCA must learn from at most {KERNEL_POSES} poses, got {len(self._angles)}")
        self._model = _built(*self._transformer)
        with timed(self._limit):
            self._model.fit(self._angles)
        latents = self.transform(self._angles)
        if latents.ndim != 2 or latents.shape[1] < 1 or not np.isfinite(latents).all():
            name = type(self._model).__name__
            raise InputError(f"variant must give finite latents (n, m), got {latents.shape} from {name}")
        self._linear = _linear(self._model, latents.shape[1])
        self.low, self.high = latents.min(axis=0), latents.max(axis=0)
        self.centres = clustered(latents, self._clusters, self._seed)[0]
        self.reach = reach_of(self.centres, latents, self._quantile)
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray(self._model.transform(np.asarray(angles)), dtype=np.float64)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        from sklearn import config_context

        angles = np.empty((len(latents), 63))
        if self._linear is not None:
            recover(writeable(latents), *self._linear, angles)
            return angles
        with config_context(assume_finite=True, skip_parameter_validation=True):
            for row, latent in enumerate(np.asarray(latents)):
                angles[row] = self._model.inverse_transform(latent[None])[0]
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are nearer than chi to a cluster's centre (n,). As SAPSO 2.2."""
        allowed = np.empty(len(latents), dtype=bool)
        near(writeable(latents), self.centres, self.reach, allowed)
        return allowed

    def save(self, path: str | Path) -> None:
        """Write what the space was learned from to an .npz file; `load` learns it again."""
        text = np.frombuffer(json.dumps(self._settings).encode(), dtype=np.uint8)
        np.savez(path, angles=self._angles, words=text)

    @classmethod
    def load(cls, path: str | Path) -> "Transformed":
        """Return the space that `save` wrote. Raises ValueError where the file is not one."""
        arrays = load_arrays(path, {"angles": ("n", 63), "words": ("k",)})
        names = ("variant", "components", "options", "clusters", "quantile", "seed")
        letters = arrays["words"]
        if ((letters < 0) | (letters > 255)).any():
            raise InputError(f"{path}: words must be bytes, 0 to 255, got {letters.min():g} to {letters.max():g}")
        try:
            settings = dict(zip(names, parsed_json(letters.astype(np.uint8).tobytes().decode()), strict=True))
            prior = cls(**settings)
            prior._limit = LOADING_SECONDS
            return prior.fit(arrays["angles"])
        except TimeoutError:
            raise InputError(f"{path}: expected a prior learned in {LOADING_SECONDS:g} s, got a slower one") from None
        except Exception as error:  # of any transformer
            came = cut(" ".join(str(error).split()))
            raise InputError(f"{path}: expected the settings of a prior, got {came}") from None


def _built(variant: str, components: int, options: str, seed: int) -> Any:
    """Return the transformer. Raises ValueError where there is none of that name, or its parameters are others."""
    one_of("variant", variant, VARIANTS)
    kind = getattr(importlib.import_module("sklearn.decomposition"), variant)
    try:
        parameters = json.loads(options)
        if not isinstance(parameters, dict):
            raise TypeError(type(parameters).__name__)
    except (ValueError, TypeError) as error:
        raise InputError(f"options must be a JSON object, got {quoted(options)} ({error})") from None
    known = kind().get_params()
    defaults = {"n_components": components, "random_state": seed, **DEFAULTS.get(variant, {})}
    if unknown := sorted(set(parameters) - set(known)):
        raise InputError(f"options of {variant} must be of {', '.join(sorted(known))}, got {', '.join(unknown)}")
    return kind(**{name: value for name, value in defaults.items() if name in known} | parameters)


def _linear(model: Any, components: int) -> tuple[Array, Array] | None:
    """Return the matrix (m, 63) and the mean (63,) of a transformer whose inverse is linear; None of another."""
    if type(model).__name__ == "FactorAnalysis":
        return writeable(model.components_), writeable(model.mean_)
    probe = np.vstack([np.zeros(components), np.eye(components), np.full(components, 0.5)])
    try:
        images = np.asarray(model.inverse_transform(probe), dtype=np.float64)
    except (ValueError, AttributeError) as error:
        raise InputError(f"variant must have an inverse, got {type(model).__name__}: {error}") from None
    if images.shape != (len(probe), 63):
        raise InputError(f"variant must give back 63 angles, got {images.shape[1:]} from {type(model).__name__}")
    matrix = images[1:-1] - images[0]
    if np.allclose(images[-1], images[0] + 0.5 * matrix.sum(axis=0), rtol=0.0, atol=1e-9):
        return writeable(matrix), writeable(images[0])
    return None
