"""What numba cannot say at speed: rows of a known length, the bits of eight spans, how many bits of a word are set.

Each is here as plain Python, and below it as numba compiles it.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

STRIP_PIXELS = 32  # pixels: bits of a lane
BLOCK = 8  # rows filled at a time
ROOM = 512  # numbers in a row of a work array


def rows_of(block: Any) -> Any:
    """Return the rows (n, ROOM) of a work array, of a length that the compiler knows.

    So it sees that rows do not overlap, and loops that write several rows run in vector registers. Rows of an unknown
    length it would compare with each other before each loop, if there are few of them, and else give up.
    """
    return block


@intrinsic
def _rows_of(typing_context: Any, block: Any) -> Any:  # noqa: ARG001
    return block(block), _build_rows


@overload(rows_of)
def _rows_of_compiled(block):  # noqa: ARG001
    return lambda block: _rows_of(block)  # type: ignore[call-arg]


def _build_rows(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `rows_of`: the same numbers, with constants for the length of a row and its bytes."""
    array = context.make_array(signature.return_type)
    block = array(context, builder, arguments[0])
    rows = array(context, builder)

    def whole(number: int) -> Any:
        return context.get_constant(types.intp, number)

    size = signature.return_type.dtype.bitwidth // 8
    count = builder.extract_value(block.shape, 0)
    shape = builder.insert_value(block.shape, whole(ROOM), 1)
    strides = builder.insert_value(block.strides, whole(ROOM * size), 0)
    rows.data = block.data
    rows.nitems = builder.mul(count, whole(ROOM))
    rows.itemsize = whole(size)
    rows.shape = shape
    rows.strides = builder.insert_value(strides, whole(size), 1)
    rows.meminfo = block.meminfo
    rows.parent = block.parent
    value = rows._getvalue()
    context.nrt.incref(builder, signature.return_type, value)
    return value


def popcount(bits: Any) -> int:
    """Return how many bits of a word are set."""
    return int(bits).bit_count()


@intrinsic
def _ctpop(typing_context: Any, bits: Any) -> Any:  # noqa: ARG001 - numba calls both functions by these names
    return types.uint64(
        types.uint64
    ), lambda context, builder, signature, arguments: builder.ctpop(arguments[0])  # noqa: ARG005


@overload(popcount)
def _popcount_compiled(bits):  # noqa: ARG001 - numba compares the two signatures
    return lambda bits: _ctpop(bits)  # type: ignore[call-arg]


def set_spans(image: Any, place: Any, stride: Any, spans: Any) -> None:
    """Set the bits of eight spans in eight half words from `place` on, and in the eight ones `stride` farther on.

    `spans` (16,) are eight first bits, from 0 on, and eight that come after a last one, 64 at most; a span that ends
    before it begins is empty. Bits from 32 on are those of the farther words.
    """
    pixels = image.reshape(-1).view(np.uint32)
    for k in range(BLOCK):
        first = int(spans[k])
        stop = max(int(spans[k]), int(spans[BLOCK + k]))
        bits = (
            ((1 << stop) - (1 << first)) & 0xFFFFFFFFFFFFFFFF
            if first < 2 * STRIP_PIXELS
            else 0
        )
        pixels[place + k] |= np.uint32(bits & 0xFFFFFFFF)
        pixels[place + stride + k] |= np.uint32(bits >> STRIP_PIXELS)


@intrinsic
def _set_spans(
    typing_context: Any,  # noqa: ARG001
    image: Any,
    place: Any,  # noqa: ARG001
    stride: Any,  # noqa: ARG001
    spans: Any,
) -> Any:
    return types.void(image, types.int64, types.int64, spans), _build_spans


# Not `inline="always"`: where numba inlines a typed function, it removes what it takes for dead code, and it does not
# know that a row is a view of its block.
@overload(set_spans)
def _set_spans_compiled(image, place, stride, spans):  # noqa: ARG001
    return lambda image, place, stride, spans: _set_spans(image, place, stride, spans)  # type: ignore[call-arg]


def _build_spans(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `set_spans` as instructions for eight lanes of 32 bits."""
    vector = ir.VectorType(ir.IntType(32), BLOCK)
    image, place, stride, spans = arguments

    def splat(value: int) -> Any:
        return ir.Constant(vector, [value] * BLOCK)

    def lanes_at(kind: Any, array: Any, index: Any) -> Any:
        data = context.make_array(kind)(context, builder, array).data
        pixels = builder.bitcast(data, ir.IntType(32).as_pointer())
        return builder.bitcast(builder.gep(pixels, [index]), vector.as_pointer())

    def shifted(shift: Any, by: Any) -> Any:
        # a shift by 32 and more leaves nothing: one instruction on x86 with AVX2, without the choice
        return builder.select(
            builder.icmp_unsigned("<", by, splat(STRIP_PIXELS)),
            shift(splat(-1), by),
            splat(0),
        )

    def add_bits(at: Any, bits: Any) -> None:
        words = lanes_at(signature.args[0], image, at)
        builder.store(builder.or_(builder.load(words, align=4), bits), words, align=4)

    first, stop = (
        builder.load(
            lanes_at(signature.args[3], spans, ir.Constant(ir.IntType(64), at)), align=4
        )
        for at in (0, BLOCK)
    )
    stop = builder.select(builder.icmp_signed(">", stop, first), stop, first)
    # bits from k on
    add_bits(
        place, builder.xor(shifted(builder.shl, first), shifted(builder.shl, stop))
    )
    first, stop = (builder.sub(splat(2 * STRIP_PIXELS), k) for k in (first, stop))
    add_bits(
        builder.add(place, stride),
        builder.xor(shifted(builder.lshr, first), shifted(builder.lshr, stop)),
    )
    return context.get_dummy_value()
