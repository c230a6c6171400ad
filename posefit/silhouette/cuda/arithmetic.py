"""What a device says in one instruction and Python in several.

Each function stands here as plain Python, which numba's simulator runs, and below it as numba compiles it for a device.
"""

import math
from typing import Any

import numpy as np
from numba import cuda
from numba.cuda.extending import overload


def fused(factor: Any, by: Any, addend: Any) -> Any:
    """Return factor * by + addend of float32 numbers, rounded once: as compiled loops have it on a CPU with FMA."""
    return np.float32(float(factor) * float(by) + float(addend))


@overload(fused)  # type: ignore[untyped-decorator]
def _fused_compiled(factor, by, addend):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares the signatures
    return lambda factor, by, addend: cuda.fma(factor, by, addend)


def single_root(square: Any) -> Any:
    """Return the square root of a float32 of 0 or more, as one."""
    return np.float32(math.sqrt(square))


@overload(single_root)  # type: ignore[untyped-decorator]
def _single_root_compiled(square):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda square: math.sqrt(square)


def spanned(first: Any, stop: Any) -> Any:
    """Return a word of 32 bits, those from `first` on set that come before `stop`; both are cut to 0 to 32."""
    bits = (1 << min(max(int(stop), 0), 32)) - (1 << min(max(int(first), 0), 32))
    return np.uint32(max(bits, 0))


@overload(spanned)  # type: ignore[untyped-decorator]
def _spanned_compiled(first, stop):  # type: ignore[no-untyped-def]  # noqa: ARG001
    def compiled(first, stop):  # type: ignore[no-untyped-def]
        a, b = np.uint64(min(max(first, 0), 32)), np.uint64(min(max(stop, 0), 32))
        return np.uint32((np.uint64(1) << b) - (np.uint64(1) << a)) if b > a else np.uint32(0)

    return compiled


def floored(number: Any) -> Any:
    """Return the largest whole number that is not above a number, as one of its own kind; infinity stays."""
    return np.floor(number)


@overload(floored)  # type: ignore[untyped-decorator]
def _floored_compiled(number):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda number: math.floor(number)


def ceiled(number: Any) -> Any:
    """Return the least whole number that is not below a number, as one of its own kind; infinity stays."""
    return np.ceil(number)


@overload(ceiled)  # type: ignore[untyped-decorator]
def _ceiled_compiled(number):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda number: math.ceil(number)
