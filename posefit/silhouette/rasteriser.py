"""The rasteriser: bodies drawn into bit images by numba loops over arrays.

In one row of pixels a cone spans from the least to the greatest of at most six
crossings: two with each disc, and one with each of the two tangent segments. A pixel
belongs to the cone if its centre lies within that span, borders included.

    outline_poses: LANES poses at once         fill_pose: one of them

      angles                                     outlines
        |  geometry.kernels.place_lanes            |  list_blocks
      joints, in the camera's frame              blocks of all cones, eight rows each
        |  outlines.project_joints                 |  span_rows
      two discs a cone (Ends)                    first and stop column of each row
        |  outlines.outline_cones                  |  spans.set_spans
      tangents, blocks (Outlines, Bounds)        bits of the image

A bit image is cut into strips of 32 columns. It is (strips, words) uint64; one word has
the bits of two rows. As uint32 it is (strips, rows): bit i of image[s, y] is the pixel
in column 32 s + i of row y. The number of strips is even, the number of rows a multiple
of eight:

            strip 0         strip 1
    row 0   bits 0 ... 31   bits 0 ... 31
    row 1   bits 0 ... 31   bits 0 ... 31
    ...
    row 7   bits 0 ... 31   bits 0 ... 31

A block is eight rows of one strip: one register of AVX2. Blocks are filled in a window
of two strips, whose columns are 0 to 63. A cone wider than a window is filled window by
window, from left to right.

Arrays with an element for each cone have it in the cone's slot, see `outlines`. The
callers check shapes.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits, inlined, jit
from posefit.geometry.kernels import (
    LANES,
    NATURAL,
    all_same,
    empty_lanes,
    place_lanes,
    set_offsets,
    set_view,
)
from posefit.silhouette.outlines import (
    BONES,
    NOWHERE,
    Bounds,
    Ends,
    Integers,
    Outlines,
    Singles,
    outline_cones,
    project_joints,
)
from posefit.silhouette.spans import BLOCK, ROOM, STRIP_PIXELS, rows_of, set_spans

NONE = np.uint64(0)
ZERO = np.float32(0)
ONE = np.float32(1)
WINDOW = np.float32(2 * STRIP_PIXELS)
HUGE = np.float32(1e9)
_NAN = np.float32(np.nan)

# From the number of a cone's block to that of the block below, see `block_number`.
# LANES * BONES slots fit into ROOM. ROOM is a power of two, so that the lowest bits of
# a block's number are a slot.
_NEXT_BLOCK = (BLOCK << 32) + BLOCK * ROOM


class View(NamedTuple):
    """A camera, in the form that the kernels take."""

    rotation: Array  # (3, 3) camera_from_world
    translation: Array  # (3,)
    focal: Array  # (2,) pixels
    centre: Array  # (2,) pixels
    width: int
    height: int


class Box(NamedTuple):
    """The words of a bit image that a pose may have set."""

    first_word: int
    stop_word: int  # the one after the last
    first_strip: int
    last_strip: int


class Work(NamedTuple):
    """The work arrays of one thread."""

    lanes: Array  # kinematics of LANES poses
    ends: Array  # (rows, ROOM) the fields of `Ends`
    outlines: Singles  # (rows, ROOM) the fields of `Outlines`
    bounds: Integers  # (rows, ROOM) the fields of `Bounds`
    # (ROOM,) `block_number` of each cone's first block in the present window
    first_blocks: NDArray[np.int64]
    # differences between the numbers of a pose's successive blocks: see `list_blocks`
    differences: NDArray[np.int64]
    spans: Integers  # (2 BLOCK,) first columns and stop columns of eight rows
    image: Bits  # (strips, words) clear between poses


@inlined
def ends_in(work):
    """Return the rows of `Ends`."""
    rows = rows_of(work.ends)
    return Ends(
        rows[0],
        rows[1],
        rows[2],
        rows[3],
        rows[4],
        rows[5],
        rows[6],
        rows[7],
        rows[8],
        rows[9],
    )


@inlined
def outlines_in(work):
    """Return the rows of `Outlines`."""
    rows = rows_of(work.outlines)
    return Outlines(
        rows[0],
        rows[1],
        rows[2],
        rows[3],
        rows[4],
        rows[5],
        rows[6],
        rows[7],
        rows[8],
        rows[9],
        rows[10],
        rows[11],
        rows[12],
        rows[13],
        rows[14],
        rows[15],
    )


@inlined
def bounds_in(work):
    """Return the rows of `Bounds`."""
    rows = rows_of(work.bounds)
    return Bounds(rows[0], rows[1], rows[2], rows[3], rows[4])


def strips_and_words(width: int, height: int) -> tuple[int, int]:
    """Return the shape of an image's bit image."""
    strips = 2 * ((width + 2 * STRIP_PIXELS - 1) // (2 * STRIP_PIXELS))
    words = (height + BLOCK - 1) // BLOCK * (BLOCK // 2)
    return strips, words


@inlined
def bounding_box(lane, stride, bounds):
    """Return a pose's box in the bit image, and how many windows its widest cone has.

    A window is two strips wide.
    """
    top = NOWHERE
    bottom = 0
    left = NOWHERE
    right = -1
    widest = 0
    for b in range(BONES):
        k = (stride * b + lane) & NATURAL
        first = int(bounds.first_strip[k])
        last = int(bounds.last_strip[k])
        top = min(top, int(bounds.first_block[k]))
        bottom = max(bottom, int(bounds.stop_block[k]))
        left = min(left, first)
        right = max(right, last)
        widest = max(widest, last - first)
    words = BLOCK // 2
    return Box(top * words, bottom * words, left, right), widest // 2 + 1


@inlined
def block_number(word, row, k):
    """Return a block's position as one number, so that a list of blocks is one array.

    bits 63 ... 32: the index of the block's first uint32 word in the bit image
    bits 31 ... 9:  the block's first row, as in `Bounds.row`
    bits 8 ... 0:   the cone's slot k, below ROOM
    """
    return (np.int64(word) << 32) + np.int64(row * ROOM + k)


@inlined
def block_parts(block):
    """Return the word, the row and the slot in a block's number."""
    row = np.float32((block & 0xFFFFFFFF) // ROOM)
    return block >> 32, row, block & (ROOM - 1)


@inlined
def set_window(window, k, bounds, outlines, first_blocks, image):
    """Write where the given window, counted from 0, of the cone in slot k begins.

    The cone must have that many windows. Most cones are no wider than one, so that
    their spans are computed once.
    """
    strip = min(bounds.first_strip[k] + 2 * window, image.shape[0] - 2)
    word = strip * 2 * image.shape[1] + BLOCK * bounds.first_block[k]
    first_blocks[k] = block_number(word, bounds.row[k], k)
    column = np.float32(np.int32(STRIP_PIXELS * strip))
    stop = np.float32(np.int32(STRIP_PIXELS * (bounds.last_strip[k] + 1)))
    outlines.column[k] = column
    outlines.stop[k] = min(stop - column, WINDOW)


@inlined
def list_blocks(
    window, lane, stride, bounds, outlines, first_blocks, differences, image
):
    """Write a pose's blocks in a window of each cone; return their number.

    A loop over the blocks of each cone would have a different length for every cone,
    and a mispredicted branch costs as much as filling a block. So all blocks are one
    list, of the differences of their numbers. Within a cone these are _NEXT_BLOCK, as
    all `differences` are before. Only those that lead to the first block of a cone are
    written. With cones of 3, 0 and 2 blocks, which begin with the numbers p, q and r:

        block         p        p + N    p + 2 N    r                r + N
        difference    p + N    N        N          r - (p + 2 N)    N

    Here N is _NEXT_BLOCK. The sum of the differences starts from -N.
    """
    end = 0
    after = 0  # the number that would follow the latest cone's last block
    for b in range(BONES):
        k = (stride * b + lane) & NATURAL
        if window == 0 or bounds.first_strip[k] + 2 * window <= bounds.last_strip[k]:
            if window:
                set_window(window, k, bounds, outlines, first_blocks, image)
            count = max(int(bounds.stop_block[k]) - int(bounds.first_block[k]), 0)
            # if the cone has no blocks, the next cone overwrites this
            differences[end & NATURAL] = first_blocks[k] - after + _NEXT_BLOCK
            after = first_blocks[k] + count * _NEXT_BLOCK if count > 0 else after
            end += count
    # a last cone without blocks has written one difference too many
    differences[end & NATURAL] = _NEXT_BLOCK
    return end


@inlined
def span_rows(spans, outlines, k, row):
    """Write the first and the stop column of the cone in slot k in a block's rows.

    `row` is the block's first row. Columns are from the first pixel of the cone's
    window. Rows above and below the cone are empty: the square roots are nan there, and
    min and max ignore nan.
    """
    # Read before the loop: the compiler cannot know that writing a span leaves them as
    # they are.
    column = outlines.column[k]
    stop = outlines.stop[k]
    start_u = outlines.start_u[k]
    start_v = outlines.start_v[k]
    start_square = outlines.start_square[k]
    end_u = outlines.end_u[k]
    end_v = outlines.end_v[k]
    end_square = outlines.end_square[k]
    left_u = outlines.left_u[k]
    left_slope = outlines.left_slope[k]
    left_top = outlines.left_top[k]
    left_bottom = outlines.left_bottom[k]
    right_u = outlines.right_u[k]
    right_slope = outlines.right_slope[k]
    right_top = outlines.right_top[k]
    right_bottom = outlines.right_bottom[k]
    for i in range(BLOCK):
        y = row + np.float32(i - BLOCK)
        x = left_u + left_slope * y
        crosses = (y >= left_top) & (y <= left_bottom)
        low = x if crosses else HUGE
        high = x if crosses else -HUGE
        crosses = (y >= right_top) & (y <= right_bottom)
        x = right_u + right_slope * y if crosses else _NAN
        low = min(low, x)
        high = max(high, x)
        half = np.sqrt(start_square - (y - start_v) * (y - start_v))
        low = min(low, start_u - half)
        high = max(high, start_u + half)
        half = np.sqrt(end_square - (y - end_v) * (y - end_v))
        low = min(low, end_u - half)
        high = max(high, end_u + half)
        spans[i] = np.int32(np.ceil(max(low - column, ZERO)))
        spans[i + BLOCK] = np.int32(min(high - column + ONE, stop))


@inlined
def work_arrays(strips, words):
    """Return the work arrays of one thread, with a clear bit image."""
    image = np.empty((strips, words), np.uint64)
    for strip in range(image.shape[0]):
        for i in range(image.shape[1]):
            image[strip, i] = NONE
    most_blocks = BONES * (2 * words // BLOCK + 1)
    return Work(
        empty_lanes(),
        np.empty((10, ROOM)),
        np.empty((16, ROOM), np.float32),
        np.empty((5, ROOM), np.int32),
        np.empty(ROOM, np.int64),
        np.full(most_blocks + 1, _NEXT_BLOCK),
        np.empty(2 * BLOCK, np.int32),
        image,
    )


@inlined
def set_scene(work, first, stop, offsets, radii, view):
    """Set the body, bones (26, 3) and radii (26, 2), and the camera of some lanes."""
    set_offsets(work.lanes, first, stop, offsets)
    centre = view.centre[0] - 0.5, view.centre[1] - 0.5
    set_view(
        work.lanes, first, stop, view.rotation, view.translation, view.focal, centre
    )
    scale = math.sqrt(view.focal[0] * view.focal[1])
    ends = ends_in(work)
    for b in range(radii.shape[0]):
        for lane in range(first, stop):
            ends.start_size[LANES * b + lane] = scale * radii[b, 0]
            ends.end_size[LANES * b + lane] = scale * radii[b, 1]


@jit
def outline_poses(chain, poses, places, rows, width, height, work):
    """Outline up to LANES poses, each in the scene of its lane; return the stride.

    `rows` (LANES,) selects the poses among poses (n, 66) at places (n, 3). `work` comes
    from `work_arrays` and `set_scene`. The stride is 1 if all rows are the same; then
    only the first lane has a pose to fill.
    """
    ends = ends_in(work)
    outlines = outlines_in(work)
    bounds = bounds_in(work)
    strips = work.image.shape[0]
    stride = 1 if all_same(rows) else LANES
    place_lanes(chain, poses, places, rows, work.lanes)
    project_joints(chain.parents, work.lanes, ends, stride)
    outline_cones(ends, outlines, bounds, stride, strips, float(width), float(height))
    for k in range(BONES * stride):
        set_window(0, k, bounds, outlines, work.first_blocks, work.image)
    return stride


@jit
def fill_pose(lane, stride, work):
    """Fill an outlined pose in the bit image of `work`; return it and its bounding box.

    The bit image must be clear. A lane can be filled once, since this changes its
    outline. `stride` comes from `outline_poses`.
    """
    outlines = outlines_in(work)
    bounds = bounds_in(work)
    image = work.image
    first_blocks = work.first_blocks
    differences = work.differences
    spans = work.spans
    to_right = 2 * image.shape[1]  # uint32 words from a strip to the next one
    box, windows = bounding_box(lane, stride, bounds)
    for window in range(windows):
        count = list_blocks(
            window, lane, stride, bounds, outlines, first_blocks, differences, image
        )
        block = -_NEXT_BLOCK
        for i in range(count):
            block += differences[i]
            differences[i] = _NEXT_BLOCK  # as the next list expects it
            word, row, k = block_parts(block)
            span_rows(spans, outlines, k, row)
            set_spans(image, word, to_right, spans)
    return image, box
