"""Bits of a word, and eight rows at a time: what numba's loops cannot say, or would not say in vector registers.

Each function stands here as plain Python, and below it as numba compiles it.
"""

import math
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

BLOCK = 8  # rows filled at a time
LISTED = 16  # numbers of blocks that are written at a time
_STRIP = 32  # bits of a lane


def popcount(bits: Any) -> int:
    """Return how many bits of a word are set."""
    return int(bits).bit_count()


@intrinsic  # type: ignore[untyped-decorator]
def _ctpop(typing_context: Any, bits: Any) -> Any:  # noqa: ARG001 - numba calls both functions by these names
    return types.uint64(types.uint64), lambda context, builder, signature, arguments: builder.ctpop(arguments[0])  # noqa: ARG005


@overload(popcount)  # type: ignore[untyped-decorator]
def _popcount_compiled(bits):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares the two signatures
    return lambda bits: _ctpop(bits)  # type: ignore[call-arg]


def root(x: Any) -> Any:
    """Return the square root of a float32, nan of a negative one."""
    return np.float32(math.sqrt(x)) if x >= 0.0 else np.float32(np.nan)


@overload(root)  # type: ignore[untyped-decorator]
def _root_compiled(x):  # type: ignore[no-untyped-def]  # noqa: ARG001 - numba compares the two signatures
    return lambda x: math.sqrt(x)


def list_steps(blocks: Any, at: Any, first: Any, step: Any) -> None:
    """Write LISTED whole numbers from place `at` on: `first`, and each next one a step larger."""
    for k in range(LISTED):
        blocks[at + k] = first + k * step


@intrinsic  # type: ignore[untyped-decorator]
def _list_steps(typing_context: Any, blocks: Any, at: Any, first: Any, step: Any) -> Any:  # noqa: ARG001
    return types.void(blocks, types.int64, types.int64, types.int64), _build_steps


@overload(list_steps, inline="always")  # type: ignore[untyped-decorator]
def _list_steps_compiled(blocks, at, first, step):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda blocks, at, first, step: _list_steps(blocks, at, first, step)  # type: ignore[call-arg]


def _build_steps(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `list_steps` as instructions for all its numbers at once: so many registers as they fill."""
    number = ir.IntType(64)
    vector = ir.VectorType(number, LISTED)
    blocks, at, first, step = arguments

    def splat(value: Any) -> Any:
        lane = builder.insert_element(ir.Constant(vector, ir.Undefined), value, ir.IntType(32)(0))
        return builder.shuffle_vector(lane, lane, ir.Constant(ir.VectorType(ir.IntType(32), LISTED), [0] * LISTED))

    steps = builder.mul(splat(step), ir.Constant(vector, list(range(LISTED))))
    data = context.make_array(signature.args[0])(context, builder, blocks).data
    place = builder.bitcast(builder.gep(data, [at]), vector.as_pointer())
    builder.store(builder.add(splat(first), steps), place, align=8)
    return context.get_dummy_value()


def set_spans(pixels: Any, place: Any, stride: Any, spans: Any) -> None:
    """Set the bits of eight spans in eight words from `place` on, and in the eight words `stride` farther on.

    `spans` (16,) are eight first bits, from 0 on, and eight that come after a last one, 64 at most; a span that ends
    before it begins is empty. Bits from 32 on are those of the farther words.
    """
    for k in range(BLOCK):
        first, stop = int(spans[k]), max(int(spans[k]), int(spans[BLOCK + k]))
        bits = ((1 << stop) - (1 << first)) & 0xFFFFFFFFFFFFFFFF if first < 2 * _STRIP else 0
        pixels[place + k] |= np.uint32(bits & 0xFFFFFFFF)
        pixels[place + stride + k] |= np.uint32(bits >> _STRIP)


@intrinsic  # type: ignore[untyped-decorator]
def _set_spans(typing_context: Any, pixels: Any, place: Any, stride: Any, spans: Any) -> Any:  # noqa: ARG001
    return types.void(pixels, types.int64, types.int64, spans), _build_spans


@overload(set_spans, inline="always")  # type: ignore[untyped-decorator]
def _set_spans_compiled(pixels, place, stride, spans):  # type: ignore[no-untyped-def]  # noqa: ARG001
    return lambda pixels, place, stride, spans: _set_spans(pixels, place, stride, spans)  # type: ignore[call-arg]


def _build_spans(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `set_spans` as instructions for eight lanes of 32 bits."""
    vector = ir.VectorType(ir.IntType(32), BLOCK)
    pixels, place, stride, spans = arguments

    def splat(value: int) -> Any:
        return ir.Constant(vector, [value] * BLOCK)

    def lanes_at(kind: Any, array: Any, index: Any) -> Any:
        data = context.make_array(kind)(context, builder, array).data
        return builder.bitcast(builder.gep(data, [index]), vector.as_pointer())

    def shifted(shift: Any, by: Any) -> Any:
        # a shift by 32 and more leaves nothing: one instruction on x86 with AVX2, without the choice
        return builder.select(builder.icmp_unsigned("<", by, splat(_STRIP)), shift(splat(-1), by), splat(0))

    def add_bits(at: Any, bits: Any) -> None:
        words = lanes_at(signature.args[0], pixels, at)
        builder.store(builder.or_(builder.load(words, align=4), bits), words, align=4)

    first, stop = (
        builder.load(lanes_at(signature.args[3], spans, ir.Constant(ir.IntType(64), at)), align=4) for at in (0, BLOCK)
    )
    stop = builder.select(builder.icmp_signed(">", stop, first), stop, first)
    add_bits(place, builder.xor(shifted(builder.shl, first), shifted(builder.shl, stop)))  # bits from k on
    first, stop = (builder.sub(splat(2 * _STRIP), k) for k in (first, stop))
    add_bits(builder.add(place, stride), builder.xor(shifted(builder.lshr, first), shifted(builder.lshr, stop)))
    return context.get_dummy_value()
