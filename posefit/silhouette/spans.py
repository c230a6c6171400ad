"""Instructions that numba does not offer, or only slow ones.

They are rows of a known length, the bits of eight spans, and the number of set bits in
a word. Each is plain Python, followed by the instructions that numba compiles instead.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

STRIP_PIXELS = 32  # columns of a strip: the bits of one vector lane
BLOCK = 8  # rows that are filled together
ROOM = 512  # the length of a row of a work array


def rows_of(block: Any) -> Any:
    """Return the rows (n, ROOM) of a work array, with a length known to the compiler.

    The compiler then sees that rows do not overlap, so that loops that write several
    rows run in vector registers. With an unknown length it would check for overlaps
    before each loop if there are few rows, and otherwise would not use vector
    registers.
    """
    return block


@intrinsic
def _rows_of(typing_context: Any, block: Any) -> Any:  # noqa: ARG001
    return block(block), _build_rows


@overload(rows_of)
def _rows_of_compiled(block):  # noqa: ARG001
    return lambda block: _rows_of(block)  # type: ignore[call-arg]


def _build_rows(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Build `rows_of`: the same array, with constants for its shape and strides."""
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
    """Return the number of set bits in a word."""
    return int(bits).bit_count()


@intrinsic
def _ctpop(typing_context: Any, bits: Any) -> Any:  # noqa: ARG001
    return types.uint64(types.uint64), _build_ctpop


def _build_ctpop(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
    """Build `popcount` as one instruction."""
    return builder.ctpop(arguments[0])


# numba requires the argument names of `popcount`
@overload(popcount)
def _popcount_compiled(bits):  # noqa: ARG001
    return lambda bits: _ctpop(bits)  # type: ignore[call-arg]


def set_spans(image: Any, word: Any, to_right: Any, spans: Any) -> None:
    """Set the bits of eight spans in a window of two strips.

    `word` is the index of the first of eight uint32 words of the left strip in the bit
    image; the words of the right strip are `to_right` words further. `spans` (16,) are
    the first bits of the spans, at least 0, and then their stop bits, at most 64. A
    span with its stop before its first bit is empty. Bits from 32 on are in the right
    strip.
    """
    pixels = image.reshape(-1).view(np.uint32)
    for k in range(BLOCK):
        first = int(spans[k])
        stop = max(int(spans[k]), int(spans[BLOCK + k]))
        bits = 0
        if first < 2 * STRIP_PIXELS:
            bits = ((1 << stop) - (1 << first)) & 0xFFFFFFFFFFFFFFFF
        pixels[word + k] |= np.uint32(bits & 0xFFFFFFFF)
        pixels[word + to_right + k] |= np.uint32(bits >> STRIP_PIXELS)


@intrinsic
def _set_spans(
    typing_context: Any,  # noqa: ARG001
    image: Any,
    word: Any,  # noqa: ARG001
    to_right: Any,  # noqa: ARG001
    spans: Any,
) -> Any:
    return types.void(image, types.int64, types.int64, spans), _build_spans


# Not `inline="always"`: when numba inlines a typed function it removes apparently dead
# code, and it does not know that a row is a view of its block.
@overload(set_spans)
def _set_spans_compiled(image, word, to_right, spans):  # noqa: ARG001
    def compiled(image, word, to_right, spans):
        _set_spans(image, word, to_right, spans)  # type: ignore[call-arg]

    return compiled


def _build_spans(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Build `set_spans` as instructions for eight lanes of 32 bits."""
    vector = ir.VectorType(ir.IntType(32), BLOCK)
    image, word, to_right, spans = arguments

    def splat(value: int) -> Any:
        return ir.Constant(vector, [value] * BLOCK)

    def lanes_at(kind: Any, array: Any, index: Any) -> Any:
        data = context.make_array(kind)(context, builder, array).data
        pixels = builder.bitcast(data, ir.IntType(32).as_pointer())
        return builder.bitcast(builder.gep(pixels, [index]), vector.as_pointer())

    def shifted(shift: Any, by: Any) -> Any:
        # A shift by 32 or more leaves nothing. x86 with AVX2 shifts like this in one
        # instruction, without the select.
        return builder.select(
            builder.icmp_unsigned("<", by, splat(STRIP_PIXELS)),
            shift(splat(-1), by),
            splat(0),
        )

    def add_bits(at: Any, bits: Any) -> None:
        words = lanes_at(signature.args[0], image, at)
        builder.store(builder.or_(builder.load(words, align=4), bits), words, align=4)

    def loaded(at: int) -> Any:
        index = ir.Constant(ir.IntType(64), at)
        return builder.load(lanes_at(signature.args[3], spans, index), align=4)

    first = loaded(0)
    stop = loaded(BLOCK)
    # a span with its stop before its first bit is empty
    stop = builder.select(builder.icmp_signed(">", stop, first), stop, first)
    # the bits from `first` on, without the bits from `stop` on; in the right strip both
    # are counted from the window's end
    add_bits(word, builder.xor(shifted(builder.shl, first), shifted(builder.shl, stop)))
    first = builder.sub(splat(2 * STRIP_PIXELS), first)
    stop = builder.sub(splat(2 * STRIP_PIXELS), stop)
    add_bits(
        builder.add(word, to_right),
        builder.xor(shifted(builder.lshr, first), shifted(builder.lshr, stop)),
    )
    return context.get_dummy_value()
