"""Array types, checked read-only arrays, and compilation of functions of arrays."""

import os
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posefit.errors import InputError
from posefit.reading import quoted

Array = NDArray[np.float64]
Bits = NDArray[np.uint64]  # 64 pixels a number

if "NUMBA_CPU_NAME" in os.environ:
    # Code for a named processor must use only that processor's instructions. numba,
    # which is not imported yet, uses the name only to schedule instructions: code for
    # x86-64-v3 would still use AVX-512 on a machine that has it.
    os.environ.setdefault("NUMBA_CPU_FEATURES", "")


def jit(function: Callable[..., Any]) -> Any:
    """Return a plain function of arrays, compiled by numba once per machine.

    It may run in several threads at once. Its rounding differs from strict IEEE order
    only if a product and a sum are contracted, or in the sign of a zero.
    """
    return _compiled(function, "never")


def inlined(function: Callable[..., Any]) -> Any:
    """Return a plain function of arrays that is inlined into its compiled callers.

    A call would cost as much as filling a few blocks of pixels, since it changes the
    reference count of each array twice.
    """
    return _compiled(function, "always")


def _compiled(function: Callable[..., Any], inline: str) -> Any:
    from posefit.arrays.compiling import compiled

    options = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"contract", "nsz"},
        "inline": inline,
        # These functions are not called from C. Wrappers for that would take a twelfth
        # of the time to compile.
        "no_cfunc_wrapper": True,
    }
    return compiled(function, options)


def writeable(values: ArrayLike) -> Array:
    """Return values as a writeable float64 array in C order.

    An array that is one already is returned itself. Compiled loops are typed by their
    arguments' layout: another layout would cost another compilation.
    """
    if isinstance(values, np.ndarray):
        fits = values.dtype == np.float64 and values.flags.carray
        if fits:
            return values
    return np.require(values, np.float64, ["C", "W"])


def frozen(name: str, values: ArrayLike, shape: tuple[int | str, ...]) -> Array:
    """Return a read-only float64 copy of finite numbers.

    Args:
        name: The name of the numbers, which begins messages.
        values: The numbers.
        shape: The shape that they must have; a word in it means any length.

    Returns:
        The copy.

    Raises:
        InputError: If they are not numbers, have another shape, or are not finite.
    """
    sides = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{name} must be numbers of shape {sides}, got {quoted(values)}"
        ) from None
    fits = array.ndim == len(shape)
    if fits:
        for side, length in zip(shape, array.shape, strict=True):
            fits &= isinstance(side, str) or side == length
    if not fits:
        raise InputError(f"{name} must have shape {sides}, got {array.shape}")
    finite = np.isfinite(array)
    if not finite.all():
        raise InputError(
            f"{name} must be finite, got {np.count_nonzero(~finite)} that are not"
        )
    array.setflags(write=False)
    return array
