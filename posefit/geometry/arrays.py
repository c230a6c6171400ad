"""Arrays as the compiled loops want them."""

import numpy as np
from numpy.typing import ArrayLike

from posefit.geometry.rotation import Array


def writeable(values: ArrayLike) -> Array:
    """Return values as a float64 array in C order that may be written to, the same array where it is one.

    Compiled loops are typed by their arguments' layout: one more layout would cost one more compilation.
    """
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and values.flags.carray:
        return values
    return np.require(values, np.float64, ["C", "W"])
