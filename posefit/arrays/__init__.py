"""Arrays and compiled loops, as every floor of the house uses them."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posefit.arrays.compiling import compiled_once

Array = NDArray[np.float64]
Bits = NDArray[np.uint64]  # 64 pixels a number


def jit(function: Callable[..., Any]) -> Any:
    """Return a plain function of arrays compiled by numba, once a machine; it may run in several threads at once.

    Rounding may differ from strict IEEE order only where a product and a sum are contracted, or in a zero's sign.
    """
    import numba

    compiled = numba.njit(nogil=True, error_model="numpy", fastmath={"contract", "nsz"})(function)
    return compiled if compiled is function else compiled_once(compiled)  # numba may be told to compile nothing


def writeable(values: ArrayLike) -> Array:
    """Return values as a float64 array in C order that may be written to, the same array where it is one.

    Compiled loops are typed by their arguments' layout: one more layout would cost one more compilation.
    """
    if isinstance(values, np.ndarray) and values.dtype == np.float64 and values.flags.carray:
        return values
    return np.require(values, np.float64, ["C", "W"])
