"""The rasteriser: numba loops over arrays. Shapes are checked by the callers.

A bit image is cut into strips, each 32 pixels wide: it is (strips, words) uint64, and the word image[s, i] holds two
rows of its strip. As (strips, rows) uint32, bit k of image[s, y] is pixel (32 s + k, y): eight neighbouring rows
are one vector register of AVX2, whose lanes are as wide as those of the float32 numbers that they are made from.
Strips are even in number, rows a multiple of eight. A cone is the hull of two discs. In one row of pixels it spans
from the least to the greatest of at most six crossings: two with each disc, one with each of the two tangent
segments. A pixel belongs to it when its centre lies within that span, borders included.
"""

import math
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, inlined, jit
from posefit.geometry.kernels import (
    LANES,
    NATURAL,
    X,
    Y,
    Z,
    empty_lanes,
    place_lanes,
    set_offsets,
    set_view,
)
from posefit.silhouette.spans import BLOCK, STRIP_PIXELS, set_spans

# metres; a bone with an end outside of this depth is not drawn
NEAR = 0.05
FAR = 1e6
NONE = np.uint64(0)
_NOWHERE = 1 << 20  # a block or strip beyond every image
FLAT = 1e-9  # a tangent flatter than this lies between rows of pixels
ZERO = np.float32(0)
ONE = np.float32(1)
WINDOW = np.float32(2 * STRIP_PIXELS)
HUGE = np.float32(1e9)
_NAN = np.float32(np.nan)

# Scratch rows of LANES poses, each with ROOM for what there is of them, in one flat array as in `geometry.kernels`.
ROOM = 32 * LANES
CONES = 26 * LANES
# where bones start, and joints: pixels, and 1 / depth
_U0, _V0, _D0, _U, _V, _D = (row * ROOM for row in range(6))
# radii in pixels, where the depth is 1, at the start of bones and at their end
_SCALED = 6 * ROOM
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


def strips_and_words(width: int, height: int) -> tuple[int, int]:
    """Return the shape of an image's bit image."""
    return 2 * ((width + 2 * STRIP_PIXELS - 1) // (2 * STRIP_PIXELS)), (
        height + BLOCK - 1
    ) // BLOCK * (BLOCK // 2)


@inlined
def project(parents, lanes, ends):
    """Write where joints are in the picture, and those that bones start at; 1 / depth is 0 where nothing is drawn."""
    for k in range(CONES + LANES):
        z = lanes[Z + k]
        inside = (z >= NEAR) & (z <= FAR)  # false for nan as well
        depth = 1.0 / (z if inside else 1.0)
        u = lanes[X + k] * depth if inside else 0.0
        v = lanes[Y + k] * depth if inside else 0.0
        ends[_U + k], ends[_V + k], ends[_D + k] = u, v, depth if inside else 0.0
    for k in range(CONES):  # most bones start where the one before ends
        ends[_U0 + k], ends[_V0 + k], ends[_D0 + k] = (
            ends[_U + k],
            ends[_V + k],
            ends[_D + k],
        )
    for b in range(parents.size):
        if parents[b] != b:
            at = LANES * b
            start = LANES * (parents[b] & NATURAL)
            for k in range(LANES):
                ends[_U0 + at + k], ends[_V0 + at + k] = (
                    ends[_U + start + k],
                    ends[_V + start + k],
                )
                ends[_D0 + at + k] = ends[_D + start + k]


@inlined
def outline(ends, lines, bounds, strips, width, height):
    """Write each cone's bounds, and the discs and tangent segments that border it, rows counted from its top.

    The bounds are its first block of rows and the one after its last, and its first and last strip: of what is not
    visible none between them. Blocks begin at every eighth row of the image: two cones' blocks are then the same words
    or none in common, and a processor that has just written one can read it again at once.
    """
    for k in range(CONES):
        u0 = ends[_U0 + k]
        v0 = ends[_V0 + k]
        r0 = ends[_D0 + k] * ends[_SCALED + k]
        u1 = ends[_U + LANES + k]
        v1 = ends[_V + LANES + k]
        r1 = ends[_D + LANES + k] * ends[_SCALED + ROOM + k]
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
        drawn = (
            (top < bottom)
            & (left < right)
            & (ends[_D0 + k] > 0.0)
            & (ends[_D + LANES + k] > 0.0)
        )
        first = np.int32(top) // BLOCK
        bounds[_BLOCK + k] = first if drawn else _NOWHERE
        bounds[_STOP_BLOCK + k] = (
            (np.int32(bottom) + (BLOCK - 1)) // BLOCK if drawn else 0
        )
        bounds[_FIRST + k] = (
            min(np.int32(left) // STRIP_PIXELS, strips - 2) if drawn else _NOWHERE
        )
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
            crosses = (abs(x) > FLAT) & (gap > 0.0)
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
    top = _NOWHERE
    bottom = 0
    left = _NOWHERE
    right = -1
    most = 0
    for b in range(CONES // LANES):
        k = (LANES * b + lane) & NATURAL
        top = min(top, int(bounds[_BLOCK + k]))
        bottom = max(bottom, int(bounds[_STOP_BLOCK + k]))
        left = min(left, int(bounds[_FIRST + k]))
        right = max(right, int(bounds[_LAST + k]))
        most = max(most, int(bounds[_LAST + k]) - int(bounds[_FIRST + k]))
    box[0], box[1], box[2], box[3] = (
        top * (BLOCK // 2),
        bottom * (BLOCK // 2),
        left,
        right,
    )
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
    lines[_STOP + k] = min(
        np.float32(np.int32(STRIP_PIXELS * (bounds[_LAST + k] + 1))) - column, WINDOW
    )


@inlined
def list_blocks(step, lane, bounds, lines, keys, steps, strips, stride):
    """Write by how much the number of each block to fill of a pose is above that before it; return how many there are.

    `steps` are _NEXT all through: only where a cone begins is another one written. A loop over the blocks of each cone
    would end for every cone at another number, and a mispredicted branch costs as much as a block.
    """
    end = 0
    after = 0
    for b in range(CONES // LANES):
        k = (LANES * b + lane) & NATURAL
        if step == 0 or bounds[_FIRST + k] + 2 * step <= bounds[_LAST + k]:
            if step:
                window(step, k, bounds, lines, keys, strips, stride)
            count = max(int(bounds[_STOP_BLOCK + k]) - int(bounds[_BLOCK + k]), 0)
            # that of a cone without blocks is written over by the next cone's
            steps[end & NATURAL] = keys[k] - after + _NEXT
            after = keys[k] + count * _NEXT if count > 0 else after
            end += count
    steps[end & NATURAL] = _NEXT
    return end


@inlined
def columns(spans, lines, j, row):
    """Write the first column of the cone at place j of a scratch row, and the one after its last, in a block's rows.

    `row` is the first of them. Columns are counted from the first pixel of the cone's window. Rows above and below the
    cone are empty: what a row does not cross is nan, which min and max pass over.
    """
    column = lines[_COLUMN + j]
    stop = lines[_STOP + j]
    x0 = lines[_X0 + j]
    y0 = lines[_Y0 + j]
    s0 = lines[_S0 + j]
    x1 = lines[_X1 + j]
    y1 = lines[_Y1 + j]
    s1 = lines[_S1 + j]
    xp = lines[_XP + j]
    mp = lines[_MP + j]
    pa = lines[_PA + j]
    pb = lines[_PB + j]
    xq = lines[_XQ + j]
    mq = lines[_MQ + j]
    qa = lines[_QA + j]
    qb = lines[_QB + j]
    for k in range(BLOCK):
        y = row + np.float32(k - BLOCK)
        x = xp + mp * y
        crosses = (y >= pa) & (y <= pb)
        low = x if crosses else HUGE
        high = x if crosses else -HUGE
        x = xq + mq * y if (y >= qa) & (y <= qb) else _NAN
        low = min(low, x)
        high = max(high, x)
        h = np.sqrt(s0 - (y - y0) * (y - y0))
        low = min(low, x0 - h)
        high = max(high, x0 + h)
        h = np.sqrt(s1 - (y - y1) * (y - y1))
        low = min(low, x1 - h)
        high = max(high, x1 + h)
        spans[k] = np.int32(np.ceil(max(low - column, ZERO)))
        spans[k + BLOCK] = np.int32(min(high - column + ONE, stop))


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
        np.full((CONES // LANES) * (2 * words // BLOCK + 1) + 1, _NEXT),
        np.empty(4, np.int64),
    )
    return empty_lanes(), filling, image


@inlined
def set_scene(work, first, stop, offsets, radii, view):
    """Give some lanes a body, of bones (26, 3) and radii (26, 2), and a camera."""
    lanes, (ends, _, _, _, _, _, _), _ = work
    set_offsets(lanes, first, stop, offsets)
    centre = view.centre[0] - 0.5, view.centre[1] - 0.5
    set_view(lanes, first, stop, view.rotation, view.translation, view.focal, centre)
    scale = math.sqrt(view.focal[0] * view.focal[1])
    for b in range(radii.shape[0]):
        for end in range(2):
            for lane in range(first, stop):
                ends[_SCALED + end * ROOM + LANES * b + lane] = scale * radii[b, end]


@jit
def outline_poses(chain, poses, places, rows, width, height, work):
    """Outline the poses (n, 66) at places (n, 3) that are in these rows (LANES,), each in the scene of its lane.

    `work` is what `scratch` makes and `set_scene` fills.
    """
    lanes, (ends, lines, bounds, _, keys, _, _), image = work
    place_lanes(chain, poses, places, rows, lanes)
    project(chain.parents, lanes, ends)
    strips = image.shape[0]
    stride = 2 * image.shape[1]
    outline(ends, lines, bounds, strips, float(width), float(height))
    for k in range(CONES):
        window(0, k, bounds, lines, keys, strips, stride)


@jit
def fill_pose(lane, work):
    """Set the pixels of an outlined pose in the clear bit image of `work`; return it and its bounding box.

    The lane's outline is used up.
    """
    _, (_, lines, bounds, spans, keys, steps, box), image = work
    strips = image.shape[0]
    stride = 2 * image.shape[1]
    for step in range(bounding_box(lane, bounds, box)):
        block = -_NEXT
        for i in range(
            list_blocks(step, lane, bounds, lines, keys, steps, strips, stride)
        ):
            block += steps[i]
            steps[i] = _NEXT
            columns(
                spans,
                lines,
                block & (ROOM - 1),
                np.float32((block & 0xFFFFFFFF) // ROOM),
            )
            set_spans(image, block >> 32, stride, spans)
    return image, box
