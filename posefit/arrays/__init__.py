"""Array types, checked arrays that cannot be written to, and the compilation of plain functions of arrays."""

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
    # A processor that is named has its own instructions and none besides. numba, not yet imported, takes the name for
    # their order only: x86-64-v3 would still have AVX-512 where this machine has it.
    os.environ.setdefault("NUMBA_CPU_FEATURES", "")


def jit(function: Callable[..., Any]) -> Any:
    """Return a plain function of arrays compiled by numba, once a machine; it may run in several threads at once.

    Rounding may differ from strict IEEE order only where a product and a sum are contracted, or in a zero's sign.
    """
    return _compiled(function, "never")


def inlined(function: Callable[..., Any]) -> Any:
    """Return a plain function of arrays that becomes part of the compiled functions that call it.

    A call costs as much as filling a few blocks of pixels: each array is counted as in use, and then as not.
    """
    return _compiled(function, "always")


def _compiled(function: Callable[..., Any], inline: str) -> Any:
    import numba

    from posefit.arrays.compiling import cached

    options: dict[str, Any] = {
        "nogil": True,
        "error_model": "numpy",
        "fastmath": {"contract", "nsz"},
        "inline": inline,
    }
    # these functions are not called from C; wrappers for it would take a twelfth of the time to compile
    options["no_cfunc_wrapper"] = True
    compiled: Any = numba.njit(**options)(function)
    # NUMBA_DISABLE_JIT: nothing is compiled
    return compiled if compiled is function else cached(compiled)


def writeable(values: ArrayLike) -> Array:
    """Return values as a float64 array in C order that may be written to, the same array where it is one.

    Compiled loops are typed by their arguments' layout: one more layout would cost one more compilation.
    """
    if (
        isinstance(values, np.ndarray)
        and values.dtype == np.float64
        and values.flags.carray
    ):
        return values
    return np.require(values, np.float64, ["C", "W"])


def frozen(name: str, values: ArrayLike, shape: tuple[int | str, ...]) -> Array:
    """Return a copy of finite numbers that cannot be written to; a word in a shape stands for any length.

    Raises InputError, beginning with the name, where they are no such numbers.
    """
    sides = f"({', '.join(map(str, shape))}{',' if len(shape) == 1 else ''})"
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError, OverflowError):
        raise InputError(
            f"{name} must be numbers of shape {sides}, got {quoted(values)}"
        ) from None
    fits = array.shape == shape or (
        array.ndim == len(shape)
        and all(
            isinstance(side, str) or side == length
            for side, length in zip(shape, array.shape, strict=True)
        )
    )
    if not fits:
        raise InputError(f"{name} must have shape {sides}, got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(
            f"{name} must be finite, got {np.count_nonzero(~np.isfinite(array))} that are not"
        )
    array.setflags(write=False)
    return array
