"""The rasteriser: numba loops over arrays. Shapes are checked by the callers.

A bit image is cut into strips, each 32 pixels wide: it is (strips, words) uint64, and the word image[s, i] holds two
rows of its strip. As (strips, rows) uint32, bit k of image[s, y] is pixel (32 s + k, y): eight neighbouring rows
are one vector register of AVX2, whose lanes are as wide as those of the float32 numbers that they are made from.
Strips are even in number, rows a multiple of eight. A cone is the hull of two discs. In one row of pixels it spans
from the least to the greatest of at most six crossings: two with each disc, one with each of the two tangent
segments. A pixel belongs to it when its centre lies within that span, borders included.

What numba's loops cannot say, or would not say in vector registers, stands first: as plain Python, and below it as
numba compiles it.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from posefit.arrays import Array, inlined, jit
from posefit.arrays.calling import call
from posefit.arrays.instructions import in_all_lanes
from posefit.geometry.kernels import LANES, NATURAL, X, Y, Z, empty_lanes, set_offsets, set_view

STRIP_PIXELS = 32  # pixels: bits of a lane
BLOCK = 8  # rows filled at a time
LISTED = 16  # numbers of blocks that are written at a time
NEAR, FAR = 0.05, 1e6  # metres; a bone with an end outside of this depth is not drawn
NONE = np.uint64(0)
_NOWHERE = 1 << 20  # a block or strip beyond every image
_FLAT = 1e-9  # a tangent flatter than this lies between rows of pixels
_ZERO, _ONE, _WINDOW = np.float32(0), np.float32(1), np.float32(2 * STRIP_PIXELS)
_HUGE, _NAN = np.float32(1e9), np.float32(np.nan)

# Scratch rows of LANES poses, each with ROOM for what there is of them, in one flat array as in `geometry.kernels`.
ROOM, CONES = 32 * LANES, 26 * LANES
_U0, _V0, _D0, _U, _V, _D = (row * ROOM for row in range(6))  # where bones start, and joints: pixels, and 1 / depth
_SCALED = 6 * ROOM  # radii in pixels, where the depth is 1, at the start of bones and at their end
_BLOCK, _STOP_BLOCK, _FIRST, _LAST, _ROW = (row * ROOM for row in range(5))
_X0, _Y0, _S0, _X1, _Y1, _S1 = (row * ROOM for row in range(6))
_XP, _MP, _PA, _PB, _XQ, _MQ, _QA, _QB = (row * ROOM for row in range(6, 14))
_COLUMN, _STOP = (row * ROOM for row in range(14, 16))

# A block to fill is one number: its first word as uint32 in the upper half; in the lower its first row, counted from
# BLOCK rows above the cone's top so that none is negative, and in the lowest bits the cone's place in a scratch row.
_NEXT = (BLOCK << 32) + BLOCK * ROOM  # from a cone's block to the next


class View(NamedTuple):
    """A camera as the kernel wants it."""

    rotation: Array  # (3, 3) camera_from_world
    translation: Array  # (3,)
    focal: Array  # (2,) pixels
    centre: Array  # (2,) pixels
    width: int
    height: int


def popcount(bits: Any) -> int:
    """Return how many bits of a word are set."""
    return int(bits).bit_count()


@intrinsic
def _ctpop(typing_context: Any, bits: Any) -> Any:  # noqa: ARG001 - numba calls both functions by these names
    return types.uint64(types.uint64), lambda context, builder, signature, arguments: builder.ctpop(arguments[0])  # noqa: ARG005


@overload(popcount)
def _popcount_compiled(bits):  # noqa: ARG001 - numba compares the two signatures
    return lambda bits: _ctpop(bits)  # type: ignore[call-arg]


def root(x: Any) -> Any:
    """Return the square root of a float32, nan of a negative one."""
    return np.float32(math.sqrt(x)) if x >= 0.0 else np.float32(np.nan)


@overload(root)
def _root_compiled(x):  # noqa: ARG001 - numba compares the two signatures
    return lambda x: math.sqrt(x)


def list_steps(blocks: Any, at: Any, first: Any, step: Any) -> None:
    """Write LISTED whole numbers from place `at` on: `first`, and each next one a step larger."""
    for k in range(LISTED):
        blocks[at + k] = first + k * step


@intrinsic
def _list_steps(typing_context: Any, blocks: Any, at: Any, first: Any, step: Any) -> Any:  # noqa: ARG001
    return types.void(blocks, types.int64, types.int64, types.int64), _build_steps


@overload(list_steps, inline="always")
def _list_steps_compiled(blocks, at, first, step):  # noqa: ARG001
    return lambda blocks, at, first, step: _list_steps(blocks, at, first, step)  # type: ignore[call-arg]


def _build_steps(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Write `list_steps` as instructions for all its numbers at once: so many registers as they fill."""
    number = ir.IntType(64)
    vector = ir.VectorType(number, LISTED)
    blocks, at, first, step = arguments

    steps = builder.mul(in_all_lanes(builder, step, LISTED), ir.Constant(vector, list(range(LISTED))))
    data = context.make_array(signature.args[0])(context, builder, blocks).data
    place = builder.bitcast(builder.gep(data, [at]), vector.as_pointer())
    builder.store(builder.add(in_all_lanes(builder, first, LISTED), steps), place, align=8)
    return context.get_dummy_value()


def set_spans(image: Any, place: Any, stride: Any, spans: Any) -> None:
    """Set the bits of eight spans in eight half words from `place` on, and in the eight ones `stride` farther on.

    `spans` (16,) are eight first bits, from 0 on, and eight that come after a last one, 64 at most; a span that ends
    before it begins is empty. Bits from 32 on are those of the farther words.
    """
    pixels = image.reshape(-1).view(np.uint32)
    for k in range(BLOCK):
        first, stop = int(spans[k]), max(int(spans[k]), int(spans[BLOCK + k]))
        bits = ((1 << stop) - (1 << first)) & 0xFFFFFFFFFFFFFFFF if first < 2 * STRIP_PIXELS else 0
        pixels[place + k] |= np.uint32(bits & 0xFFFFFFFF)
        pixels[place + stride + k] |= np.uint32(bits >> STRIP_PIXELS)


@intrinsic
def _set_spans(typing_context: Any, image: Any, place: Any, stride: Any, spans: Any) -> Any:  # noqa: ARG001
    return types.void(image, types.int64, types.int64, spans), _build_spans


@overload(set_spans, inline="always")
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
        return builder.select(builder.icmp_unsigned("<", by, splat(STRIP_PIXELS)), shift(splat(-1), by), splat(0))

    def add_bits(at: Any, bits: Any) -> None:
        words = lanes_at(signature.args[0], image, at)
        builder.store(builder.or_(builder.load(words, align=4), bits), words, align=4)

    first, stop = (
        builder.load(lanes_at(signature.args[3], spans, ir.Constant(ir.IntType(64), at)), align=4) for at in (0, BLOCK)
    )
    stop = builder.select(builder.icmp_signed(">", stop, first), stop, first)
    add_bits(place, builder.xor(shifted(builder.shl, first), shifted(builder.shl, stop)))  # bits from k on
    first, stop = (builder.sub(splat(2 * STRIP_PIXELS), k) for k in (first, stop))
    add_bits(builder.add(place, stride), builder.xor(shifted(builder.lshr, first), shifted(builder.lshr, stop)))
    return context.get_dummy_value()


def strips_and_words(width: int, height: int) -> tuple[int, int]:
    """Return the shape of an image's bit image."""
    return 2 * ((width + 2 * STRIP_PIXELS - 1) // (2 * STRIP_PIXELS)), (height + BLOCK - 1) // BLOCK * (BLOCK // 2)


@inlined
def project(parents, lanes, ends):
    """Write where joints are in the picture, and those that bones start at; 1 / depth is 0 where nothing is drawn."""
    for k in range(CONES + LANES):
        z = lanes[Z + k]
        inside = (z >= NEAR) & (z <= FAR)  # false for nan as well
        depth = 1.0 / (z if inside else 1.0)
        u, v = lanes[X + k] * depth if inside else 0.0, lanes[Y + k] * depth if inside else 0.0
        ends[_U + k], ends[_V + k], ends[_D + k] = u, v, depth if inside else 0.0
    for k in range(CONES):  # most bones start where the one before ends
        ends[_U0 + k], ends[_V0 + k], ends[_D0 + k] = ends[_U + k], ends[_V + k], ends[_D + k]
    for b in range(parents.size):
        if parents[b] != b:
            at, start = LANES * b, LANES * (parents[b] & NATURAL)
            for k in range(LANES):
                ends[_U0 + at + k], ends[_V0 + at + k] = ends[_U + start + k], ends[_V + start + k]
                ends[_D0 + at + k] = ends[_D + start + k]


@inlined
def outline(ends, lines, bounds, strips, width, height):
    """Write each cone's bounds, and the discs and tangent segments that border it, rows counted from its top.

    The bounds are its first block of rows and the one after its last, and its first and last strip: of what is not
    visible none between them. Blocks begin at every eighth row of the image: two cones' blocks are then the same words
    or none in common, and a processor that has just written one can read it again at once.
    """
    for k in range(CONES):
        u0, v0, r0 = ends[_U0 + k], ends[_V0 + k], ends[_D0 + k] * ends[_SCALED + k]
        u1, v1, r1 = ends[_U + LANES + k], ends[_V + LANES + k], ends[_D + LANES + k] * ends[_SCALED + ROOM + k]
        dx = u1 - u0
        dy = v1 - v0
        dr = r0 - r1
        dd = dx * dx + dy * dy
        gap = dd - dr * dr
        # the two unit normals n with n . (c1 - c0) = r0 - r1: along the axis, plus or minus across it
        length = 1.0 / max(dd, 1e-30)
        along = dr * length
        across = math.sqrt(max(gap, 0.0)) * length
        top = min(max(np.ceil(min(v0 - r0, v1 - r1)), 0.0), height)
        bottom = max(min(np.floor(max(v0 + r0, v1 + r1)) + 1.0, height), 0.0)
        left = min(max(np.ceil(min(u0 - r0, u1 - r1)), 0.0), width)
        right = max(min(np.floor(max(u0 + r0, u1 + r1)) + 1.0, width), 0.0)
        drawn = (top < bottom) & (left < right) & (ends[_D0 + k] > 0.0) & (ends[_D + LANES + k] > 0.0)
        first = np.int32(top) // BLOCK
        bounds[_BLOCK + k] = first if drawn else _NOWHERE
        bounds[_STOP_BLOCK + k] = (np.int32(bottom) + (BLOCK - 1)) // BLOCK if drawn else 0
        bounds[_FIRST + k] = min(np.int32(left) // STRIP_PIXELS, strips - 2) if drawn else _NOWHERE
        bounds[_LAST + k] = (np.int32(right) - 1) // STRIP_PIXELS if drawn else -1
        bounds[_ROW + k] = BLOCK * (first + 1) - np.int32(top)
        lines[_X0 + k] = u0
        lines[_Y0 + k] = v0 - top
        lines[_S0 + k] = r0 * r0
        lines[_X1 + k] = u1
        lines[_Y1 + k] = v1 - top
        lines[_S1 + k] = r1 * r1
        for side in range(2):
            apart = across if side == 0 else -across
            x = along * dx - apart * dy
            y = along * dy + apart * dx
            a = v0 + r0 * y - top
            b = v1 + r1 * y - top
            crosses = (abs(x) > _FLAT) & (gap > 0.0)
            slope = -y / (x if crosses else 1.0)
            at = side * (_XQ - _XP) + k
            lines[_XP + at] = u0 + r0 * x - a * slope
            lines[_MP + at] = slope
            lines[_PA + at] = min(a, b) if crosses else 1.0
            lines[_PB + at] = max(a, b) if crosses else 0.0


@inlined
def bounding_box(lane, bounds, box):
    """Write a pose's bounding box in the bit image: its first and last + 1 word, its first and last strip.

    Returns how many windows of two strips its widest cone has.
    """
    top, bottom, left, right, most = _NOWHERE, 0, _NOWHERE, -1, 0
    for b in range(CONES // LANES):
        k = (LANES * b + lane) & NATURAL
        top = min(top, int(bounds[_BLOCK + k]))
        bottom = max(bottom, int(bounds[_STOP_BLOCK + k]))
        left = min(left, int(bounds[_FIRST + k]))
        right = max(right, int(bounds[_LAST + k]))
        most = max(most, int(bounds[_LAST + k]) - int(bounds[_FIRST + k]))
    box[0], box[1], box[2], box[3] = top * (BLOCK // 2), bottom * (BLOCK // 2), left, right
    return most // 2 + 1


@inlined
def window(step, k, bounds, lines, keys, strips, stride):
    """Write where the `step`-th window of two strips of the cone at place k of a scratch row lies, one that it has.

    Most cones are no wider than a window, so that their spans are computed once.
    """
    strip = min(bounds[_FIRST + k] + 2 * step, strips - 2)
    place = strip * stride + BLOCK * bounds[_BLOCK + k]
    keys[k] = (np.int64(place) << 32) + np.int64(bounds[_ROW + k] * ROOM + k)
    column = np.float32(np.int32(STRIP_PIXELS * strip))
    lines[_COLUMN + k] = column
    lines[_STOP + k] = min(np.float32(np.int32(STRIP_PIXELS * (bounds[_LAST + k] + 1))) - column, _WINDOW)


@inlined
def list_blocks(step, lane, bounds, lines, keys, blocks, strips, stride):
    """Write the blocks to fill of a pose, each one number of place, row and cone; return how many.

    They are listed so many at a time, whether or not a cone has them: a mispredicted branch costs as much as a block.
    """
    end = 0
    for b in range(CONES // LANES):
        k = (LANES * b + lane) & NATURAL
        if step == 0 or bounds[_FIRST + k] + 2 * step <= bounds[_LAST + k]:
            if step:
                window(step, k, bounds, lines, keys, strips, stride)
            count = max(int(bounds[_STOP_BLOCK + k]) - int(bounds[_BLOCK + k]), 0)
            for i in range(0, count, LISTED):
                list_steps(blocks, end + i, keys[k] + i * _NEXT, _NEXT)
            end += count
    return end


@inlined
def columns(spans, lines, j, row):
    """Write the first column of the cone at place j of a scratch row, and the one after its last, in a block's rows.

    `row` is the first of them. Columns are counted from the first pixel of the cone's window. Rows above and below the
    cone are empty: what a row does not cross is nan, which min and max pass over.
    """
    column, stop = lines[_COLUMN + j], lines[_STOP + j]
    x0, y0, s0 = lines[_X0 + j], lines[_Y0 + j], lines[_S0 + j]
    x1, y1, s1 = lines[_X1 + j], lines[_Y1 + j], lines[_S1 + j]
    xp, mp, pa, pb = lines[_XP + j], lines[_MP + j], lines[_PA + j], lines[_PB + j]
    xq, mq, qa, qb = lines[_XQ + j], lines[_MQ + j], lines[_QA + j], lines[_QB + j]
    for k in range(BLOCK):
        y = row + np.float32(k - BLOCK)
        x = xp + mp * y
        crosses = (y >= pa) & (y <= pb)
        low = x if crosses else _HUGE
        high = x if crosses else -_HUGE
        x = xq + mq * y if (y >= qa) & (y <= qb) else _NAN
        low = min(low, x)
        high = max(high, x)
        h = root(s0 - (y - y0) * (y - y0))
        low = min(low, x0 - h)
        high = max(high, x0 + h)
        h = root(s1 - (y - y1) * (y - y1))
        low = min(low, x1 - h)
        high = max(high, x1 + h)
        spans[k] = np.int32(np.ceil(max(low - column, _ZERO)))
        spans[k + BLOCK] = np.int32(min(high - column + _ONE, stop))


@inlined
def scratch(strips, words):
    """Return the work arrays of one thread: for the kinematics, for outlines and filling, and a clear bit image."""
    image = np.empty((strips, words), np.uint64)
    for strip in range(image.shape[0]):
        for i in range(image.shape[1]):
            image[strip, i] = NONE
    filling = (
        np.empty(8 * ROOM),
        np.empty(16 * ROOM, np.float32),
        np.empty(5 * ROOM, np.int32),
        np.empty(2 * BLOCK, np.int32),
        np.empty(ROOM, np.int64),
        np.empty((CONES // LANES) * (2 * words // BLOCK + 1) + LISTED, np.int64),
        np.empty(4, np.int64),
    )
    return empty_lanes(), filling, image


@inlined
def set_scene(work, first, stop, offsets, radii, view):
    """Give some lanes a body, of bones (26, 3) and radii (26, 2), and a camera."""
    (_, lanes), (ends, _, _, _, _, _, _), _ = work
    set_offsets(lanes, first, stop, offsets)
    centre = view.centre[0] - 0.5, view.centre[1] - 0.5
    set_view(lanes, first, stop, view.rotation, view.translation, view.focal, centre)
    scale = math.sqrt(view.focal[0] * view.focal[1])
    for b in range(radii.shape[0]):
        for end in range(2):
            for lane in range(first, stop):
                ends[_SCALED + end * ROOM + LANES * b + lane] = scale * radii[b, end]


@jit
def outline_poses(kinematics, chain, poses, places, rows, width, height, work):
    """Outline the poses (n, 66) at places (n, 3) that are in these rows (LANES,), each in the scene of its lane.

    `kinematics` is the address of `place_lanes`; `work` is what `scratch` makes and `set_scene` fills.
    """
    (slots, lanes), (ends, lines, bounds, _, keys, _, _), image = work
    call(kinematics, (chain, poses, places, rows, slots, lanes))
    project(chain.parents, lanes, ends)
    strips, stride = image.shape[0], 2 * image.shape[1]
    outline(ends, lines, bounds, strips, float(width), float(height))
    for k in range(CONES):
        window(0, k, bounds, lines, keys, strips, stride)


@jit
def fill_pose(lane, work):
    """Set the pixels of an outlined pose in the clear bit image of `work`; return it and its bounding box.

    The lane's outline is used up.
    """
    _, (_, lines, bounds, spans, keys, blocks, box), image = work
    strips, stride = image.shape[0], 2 * image.shape[1]
    for step in range(bounding_box(lane, bounds, box)):
        for i in range(list_blocks(step, lane, bounds, lines, keys, blocks, strips, stride)):
            block = blocks[i]
            columns(spans, lines, block & (ROOM - 1), np.float32((block & 0xFFFFFFFF) // ROOM))
            set_spans(image, block >> 32, stride, spans)
    return image, box
