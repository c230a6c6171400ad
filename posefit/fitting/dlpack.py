"""Arrays of other libraries, such as PyTorch and JAX, converted through DLPack."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.reading import quoted

CPU = 1  # DLPack's number of this device


def as_numpy(name: str, values: Any) -> tuple[Any, Callable[[Array], Any]]:
    """Return values as a NumPy array, and a function that converts results back.

    An array on the CPU is not copied. From another device it is copied, and its results
    are copied back. Results have the type of the values if that is a floating type:
    float32 of JAX or PyTorch gives float32. NumPy's arrays, values without
    `__dlpack__`, and their results are returned unchanged.

    Args:
        name: The name of the values in messages.
        values: The array.

    Returns:
        The NumPy array, and a function that turns results (n,) into an array of the
        values' library.

    Raises:
        InputError: The array has no numbers to read, because it is traced (`jit`,
            `vmap`) or needs a gradient.
    """
    if isinstance(values, np.ndarray | np.generic) or not hasattr(values, "__dlpack__"):
        return values, lambda results: results
    try:
        here = values.__dlpack_device__()[0] == CPU
        if here:
            array = np.from_dlpack(values)
        else:
            array = np.from_dlpack(values, device="cpu")
    except (AttributeError, BufferError, RuntimeError, TypeError) as error:
        kind_of_array = f"{type(values).__module__}.{type(values).__name__}"
        raise InputError(
            f"{name} must be an array that DLPack can read: neither traced by jit or"
            f" vmap nor with a gradient, got {kind_of_array}:"
            f" {quoted(str(error).splitlines()[0])}"
        ) from None
    if hasattr(values, "__array_namespace__"):
        library = values.__array_namespace__()
    else:  # PyTorch
        library = sys.modules[type(values).__module__.partition(".")[0]]
    if array.dtype.kind == "f":
        kind = array.dtype
    else:
        kind = np.dtype(np.float64)
    # CuPy has no argument for the device: it uses the current one
    if here or library.__name__ == "cupy":
        place = {}
    else:
        place = {"device": values.device}
    return array, lambda results: library.asarray(
        results.astype(kind, copy=False), **place
    )
