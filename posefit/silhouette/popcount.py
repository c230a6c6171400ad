"""How many bits of a word are set: one instruction of the processor, where numba compiles it."""

from typing import Any

from numba import types
from numba.extending import intrinsic, overload


def popcount(bits: Any) -> int:
    """Return how many bits of a word are set."""
    return int(bits).bit_count()


@intrinsic  # type: ignore[untyped-decorator]
def _ctpop(typing_context: Any, bits: Any) -> Any:  # noqa: ARG001 - numba calls both functions by these names
    return types.uint64(types.uint64), lambda context, builder, signature, arguments: builder.ctpop(arguments[0])  # noqa: ARG005


@overload(popcount)  # type: ignore[untyped-decorator]
def _popcount_compiled(bits):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares the two signatures
    return lambda bits: _ctpop(bits)  # type: ignore[call-arg]
