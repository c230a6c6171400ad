"""What a prior is: a space of joint angles with few coordinates, in the manner of scikit-learn."""

from collections.abc import Callable
from pathlib import Path
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import Skeleton


class Prior(Protocol):
    """Maps joint angles (n, 63) to latents (n, m) and back. The root is no part of it: SAPSO section 2.

    It is built as `factory(**settings)`, settings keyword-only. `low`, `high` and the methods below `fit` may be used
    only after `fit`. `inverse_transform` and `feasible` must give the same bits for a row whatever rows stand
    beside it.
    """

    low: Array  # (m,) the range of the latents, constraint 1
    high: Array  # (m,)

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn from joint angles (T, 63) in radians, of a person with this skeleton, and return itself."""
        ...

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        ...

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        ...

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are poses at all (n,), constraint 2; constraint 1 is checked by the box."""
        ...

    def save(self, path: str | Path) -> None:
        """Write everything `fit` learned to an .npz file."""
        ...


# Builds an unfitted prior, as `factory(**settings)`.
PriorFactory = Callable[..., Prior]
