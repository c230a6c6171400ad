"""What the priors share: checks of settings and joint angles, and arrays in a file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from posefit.archive import read_arrays
from posefit.arrays import Array
from posefit.errors import InputError

LARGEST = 250_000_000  # bytes of a file, and of its arrays as float64; a space learned from 200,000 poses has 100 MB
Shape = tuple[str | int, ...]


class Stored:
    """A prior whose learned arrays are its attributes, by name those of `SHAPES`."""

    SHAPES: ClassVar[Mapping[str, Shape]]

    def arrays(self) -> dict[str, Any]:
        """Return the learned arrays by name."""
        return {name: getattr(self, name) for name in self.SHAPES}

    def save(self, path: str | Path) -> None:
        """Write the learned space to an .npz file."""
        np.savez(path, **self.arrays())

    @classmethod
    def load(cls, path: str | Path, prefix: str = "") -> Self:
        """Return the space that `save` wrote; `prefix` precedes the names of a space within another's file.

        Raises ValueError where the file is not one.
        """
        prior, arrays = cls(), load_arrays(path, {prefix + name: shape for name, shape in cls.SHAPES.items()})
        for name in cls.SHAPES:
            setattr(prior, name, arrays[prefix + name])
        return prior


def angles_of(angles: Array, least: int) -> Array:
    """Return joint angles (T, 63) as float64. Raises ValueError where they are not, or fewer than `least` frames."""
    angles = np.asarray(angles, dtype=np.float64)
    if angles.ndim != 2 or angles.shape[1] != 63:
        raise InputError(f"angles must have shape (T, 63), got {angles.shape}")
    if len(angles) < least:
        raise InputError(f"angles must hold at least {least} frames, got {len(angles)}")
    if not np.isfinite(angles).all():
        raise InputError(f"angles must be finite, got {np.count_nonzero(~np.isfinite(angles))} that are not")
    return angles


def load_arrays(path: str | Path, shapes: Mapping[str, Shape]) -> dict[str, Array]:
    """Return the arrays of an .npz file by name. A letter in a shape is a size that all its places share.

    Raises ValueError where an array is missing, has another shape or is not finite.
    """
    stored = read_arrays(Path(path), tuple(shapes), ", ".join(shapes), LARGEST)
    arrays: dict[str, Array] = {}
    for name in shapes:
        if name not in stored or stored[name].dtype.kind not in "biuf":
            kind = "none" if name not in stored else f"one of {stored[name].dtype}"
            raise InputError(f"{path}: expected an .npz file with {', '.join(shapes)}, got {kind} for {name}")
        arrays[name] = np.array(stored[name], dtype=np.float64)
    sizes: dict[str | int, int] = {}
    for name, shape in shapes.items():
        came = arrays[name].shape
        for side, size in zip(shape, came, strict=False):
            sizes.setdefault(side, size if isinstance(side, str) else side)
        wanted = tuple(sizes.get(side, 0) for side in shape)
        if came != wanted or not np.isfinite(arrays[name]).all():
            raise InputError(f"{path}: {name} must be finite and of shape {wanted}, got {came}")
    if "low" in arrays and not (arrays["low"] <= arrays["high"]).all():
        raise InputError(f"{path}: low must be at most high, got some above it")
    return arrays


def indices_of(path: str | Path, name: str, values: NDArray[Any], count: int) -> NDArray[np.intp]:
    """Return distinct indices from 0 to below `count`. Raises ValueError where numbers of a file are not such."""
    whole = (values == np.round(values)) & (values >= 0.0) & (values < count)
    if not whole.all() or len(np.unique(values)) != len(values):
        raise InputError(f"{path}: {name} must be different whole numbers from 0 to {count - 1}, got others")
    return values.astype(np.intp)
