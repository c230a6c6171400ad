"""The rasteriser: numba loops over arrays. The callers check shapes.

A body is 26 tapered cones, one per bone. In the image a cone is the convex hull of two
discs. In one row of pixels it spans from the least to the greatest of at most six
crossings: two with each disc, and one with each of the two tangent segments. A pixel
belongs to the cone if its centre lies within that span, borders included.

LANES poses are outlined at a time. Each quantity, such as the column of a disc's
centre, is one row of an array:

    place k   0   1  ...  15  |  16  17  ...  31  |  ...  |  400  ...  415  |  ...  511
    bone      0   0  ...   0  |   1   1  ...   1  |  ...  |   25  ...   25  |  unused
    pose      0   1  ...  15  |   0   1  ...  15  |  ...  |    0  ...   15  |

With this order, loops over places run in vector registers. For the same reason they
choose between two values by a conditional expression, not by a branch.

The cone of a bone and a lane is at place `LANES * bone + lane`, and joint j of a lane
at place `LANES * j + lane`. Bone b ends in joint b + 1, LANES places further. If there
is only one pose, its cones are next to each other instead, at place `bone`. `stride` is
the number of places from one bone to the next: LANES or 1.

A bit image is cut into strips of 32 columns. It is (strips, words) uint64; one word
has the bits of two rows. As uint32 it is (strips, rows): bit i of image[s, y] is the
pixel in column 32 s + i of row y. The number of strips is even, the number of rows a
multiple of eight:

            strip 0         strip 1
    row 0   bits 0 ... 31   bits 0 ... 31
    row 1   bits 0 ... 31   bits 0 ... 31
    ...
    row 7   bits 0 ... 31   bits 0 ... 31

A block is eight rows of one strip: one register of AVX2. Blocks are filled in a window
of two strips, whose columns are 0 to 63.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits, inlined, jit
from posefit.geometry.kernels import (
    LANES,
    NATURAL,
    X,
    Y,
    Z,
    all_same,
    empty_lanes,
    place_lanes,
    set_offsets,
    set_view,
)
from posefit.silhouette.spans import BLOCK, ROOM, STRIP_PIXELS, rows_of, set_spans

# metres: a bone is drawn only if both ends are between these depths
NEAR = 0.05
FAR = 1e6
NONE = np.uint64(0)
_NOWHERE = 1 << 20  # the block and strip of an invisible cone: beyond every image
FLAT = 1e-9  # a tangent flatter than this crosses no row of pixels
ZERO = np.float32(0)
ONE = np.float32(1)
WINDOW = np.float32(2 * STRIP_PIXELS)
HUGE = np.float32(1e9)
_NAN = np.float32(np.nan)

# LANES * BONES places fit into ROOM. ROOM is a power of two, so that the lowest bits of
# a block's number are a place.
BONES = 26

# from the number of a cone's block to that of the block below: see `block_number`
_NEXT_BLOCK = (BLOCK << 32) + BLOCK * ROOM

Singles = NDArray[np.float32]
Integers = NDArray[np.int32]


class View(NamedTuple):
    """A camera, in the form that the kernels take."""

    rotation: Array  # (3, 3) camera_from_world
    translation: Array  # (3,)
    focal: Array  # (2,) pixels
    centre: Array  # (2,) pixels
    width: int
    height: int


class Ends(NamedTuple):
    """The projected discs at both ends of the cones."""

    start_u: Array  # column of the centre of the first disc
    start_v: Array  # row
    start_inverse_depth: Array  # 1 / metres; 0 if not drawn
    # the same for all joints: the second disc of a cone is `stride` places further
    joint_u: Array
    joint_v: Array
    joint_inverse_depth: Array
    start_radius: Array  # pixels
    end_radius: Array
    # radius in pixels at depth 1; always at place `LANES * bone + lane`
    start_size: Array
    end_size: Array


class Outlines(NamedTuple):
    """The discs and tangent segments around each cone; rows are from the cone's top."""

    start_u: Singles  # centre and squared radius of the first disc
    start_v: Singles
    start_square: Singles
    end_u: Singles  # of the second disc
    end_v: Singles
    end_square: Singles
    left_u: Singles  # column of the first tangent in row 0
    left_slope: Singles  # columns per row
    # the rows that the segment spans; none if the top is below the bottom
    left_top: Singles
    left_bottom: Singles
    right_u: Singles  # the second tangent
    right_slope: Singles
    right_top: Singles
    right_bottom: Singles
    column: Singles  # first column of the window that is filled
    stop: Singles  # columns of the window that may be filled


class Bounds(NamedTuple):
    """The blocks and strips of each cone in the bit image; _NOWHERE if invisible."""

    first_block: Integers  # of eight rows
    stop_block: Integers  # the one after the last
    first_strip: Integers
    last_strip: Integers
    row: Integers  # the first block's first row, from BLOCK rows above the cone's top


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
    keys: NDArray[np.int64]  # (ROOM,) the number of each cone's first block
    steps: NDArray[np.int64]  # differences between the numbers of successive blocks
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
def project_joints(parents, lanes, ends, stride):
    """Write the discs of all cones; 1 / depth is 0 if a joint is not drawn."""
    if stride == 1:
        for j in range(BONES + 1):
            lanes[X + j] = lanes[X + LANES * j]
            lanes[Y + j] = lanes[Y + LANES * j]
            lanes[Z + j] = lanes[Z + LANES * j]
    for k in range((BONES + 1) * stride):
        z = lanes[Z + k]
        inside = (z >= NEAR) & (z <= FAR)  # false for nan as well
        inverse_depth = 1.0 / (z if inside else 1.0)
        ends.joint_u[k] = lanes[X + k] * inverse_depth if inside else 0.0
        ends.joint_v[k] = lanes[Y + k] * inverse_depth if inside else 0.0
        ends.joint_inverse_depth[k] = inverse_depth if inside else 0.0
    # most bones start at the end of the previous one; correct the others below
    for k in range(BONES * stride):
        ends.start_u[k] = ends.joint_u[k]
        ends.start_v[k] = ends.joint_v[k]
        ends.start_inverse_depth[k] = ends.joint_inverse_depth[k]
    for b in range(parents.size):
        if parents[b] != b:
            at = stride * b
            start = stride * (parents[b] & NATURAL)
            for k in range(stride):
                ends.start_u[at + k] = ends.joint_u[start + k]
                ends.start_v[at + k] = ends.joint_v[start + k]
                ends.start_inverse_depth[at + k] = ends.joint_inverse_depth[start + k]
    size_stride = LANES // stride
    for k in range(BONES * stride):
        start = ends.start_inverse_depth[k] * ends.start_size[size_stride * k]
        end = ends.joint_inverse_depth[stride + k] * ends.end_size[size_stride * k]
        ends.start_radius[k] = start
        ends.end_radius[k] = end


@inlined
def tangent_segment(normal, gap, first, last, top):
    """Return a tangent's column in row `top`, its slope, and its first and last row.

    It touches the first disc (u, v, radius) and the last one (v, radius) in the
    direction of a unit normal (x, y). The slope is in columns per row, and rows are
    from `top`. The last row is above the first if the tangent crosses no row: if it is
    flat, or if one disc covers the other.
    """
    x, y = normal
    u0, v0, r0 = first
    v1, r1 = last
    a = v0 + r0 * y - top
    b = v1 + r1 * y - top
    crosses = (abs(x) > FLAT) & (gap > 0.0)
    slope = -y / (x if crosses else 1.0)
    begin = min(a, b) if crosses else 1.0
    end = max(a, b) if crosses else 0.0
    return u0 + r0 * x - a * slope, slope, begin, end


@inlined
def pixel_range(low, high, size):
    """Return the first pixel between two coordinates, and the one after the last.

    Both are within an image of `size` pixels.
    """
    first = min(max(np.ceil(low), 0.0), size)
    stop = max(min(np.floor(high) + 1.0, size), 0.0)
    return first, stop


@inlined
def outline_cones(ends, outlines, bounds, stride, strips, width, height):
    """Write each cone's bounds, discs and tangent segments, with rows from its top.

    Blocks begin at every eighth row of the image. So the blocks of two cones are the
    same words or have none in common, and a processor can read a block again
    immediately after it has written it.
    """
    for k in range(BONES * stride):
        u0 = ends.start_u[k]
        v0 = ends.start_v[k]
        r0 = ends.start_radius[k]
        u1 = ends.joint_u[stride + k]
        v1 = ends.joint_v[stride + k]
        r1 = ends.end_radius[k]
        dx = u1 - u0
        dy = v1 - v0
        dr = r0 - r1
        dd = dx * dx + dy * dy
        gap = dd - dr * dr
        # The tangents have unit normals n with n . (c1 - c0) = r0 - r1: `along` times
        # the axis (dx, dy), plus or minus `across` times its perpendicular.
        length = 1.0 / max(dd, 1e-30)
        along = dr * length
        across = math.sqrt(max(gap, 0.0)) * length
        top, bottom = pixel_range(min(v0 - r0, v1 - r1), max(v0 + r0, v1 + r1), height)
        left, right = pixel_range(min(u0 - r0, u1 - r1), max(u0 + r0, u1 + r1), width)
        visible = (
            (top < bottom)
            & (left < right)
            & (ends.start_inverse_depth[k] > 0.0)
            & (ends.joint_inverse_depth[stride + k] > 0.0)
        )
        first_block = np.int32(top) // BLOCK
        stop_block = (np.int32(bottom) + (BLOCK - 1)) // BLOCK
        first_strip = min(np.int32(left) // STRIP_PIXELS, strips - 2)
        last_strip = (np.int32(right) - 1) // STRIP_PIXELS
        bounds.first_block[k] = first_block if visible else _NOWHERE
        bounds.stop_block[k] = stop_block if visible else 0
        bounds.first_strip[k] = first_strip if visible else _NOWHERE
        bounds.last_strip[k] = last_strip if visible else -1
        bounds.row[k] = BLOCK * (first_block + 1) - np.int32(top)
        outlines.start_u[k] = u0
        outlines.start_v[k] = v0 - top
        outlines.start_square[k] = r0 * r0
        outlines.end_u[k] = u1
        outlines.end_v[k] = v1 - top
        outlines.end_square[k] = r1 * r1
        first = u0, v0, r0
        last = v1, r1
        normal = along * dx - across * dy, along * dy + across * dx
        u, slope, begin, end = tangent_segment(normal, gap, first, last, top)
        outlines.left_u[k] = u
        outlines.left_slope[k] = slope
        outlines.left_top[k] = begin
        outlines.left_bottom[k] = end
        normal = along * dx + across * dy, along * dy - across * dx
        u, slope, begin, end = tangent_segment(normal, gap, first, last, top)
        outlines.right_u[k] = u
        outlines.right_slope[k] = slope
        outlines.right_top[k] = begin
        outlines.right_bottom[k] = end


@inlined
def bounding_box(lane, stride, bounds):
    """Return a pose's box in the bit image, and how many windows its widest cone has.

    A window is two strips wide.
    """
    top = _NOWHERE
    bottom = 0
    left = _NOWHERE
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

    The upper half is the index of the block's first uint32 word in the bit image. The
    lower half is the block's first row times ROOM, plus the cone's place k. Rows are
    from BLOCK rows above the cone's top, so that they are not negative.
    """
    return (np.int64(word) << 32) + np.int64(row * ROOM + k)


@inlined
def block_parts(block):
    """Return the word, the row and the place in a block's number."""
    row = np.float32((block & 0xFFFFFFFF) // ROOM)
    return block >> 32, row, block & (ROOM - 1)


@inlined
def place_window(step, k, bounds, outlines, keys, image):
    """Write the position of the `step`-th window of the cone at place k.

    The cone must have that many windows. Most cones are no wider than one, so that
    their spans are computed once.
    """
    strip = min(bounds.first_strip[k] + 2 * step, image.shape[0] - 2)
    word = strip * 2 * image.shape[1] + BLOCK * bounds.first_block[k]
    keys[k] = block_number(word, bounds.row[k], k)
    column = np.float32(np.int32(STRIP_PIXELS * strip))
    stop = np.float32(np.int32(STRIP_PIXELS * (bounds.last_strip[k] + 1)))
    outlines.column[k] = column
    outlines.stop[k] = min(stop - column, WINDOW)


@inlined
def list_blocks(step, lane, stride, bounds, outlines, keys, steps, image):
    """Write the differences between the numbers of a pose's blocks; return the count.

    All `steps` are _NEXT_BLOCK already; a different one is written only for the first
    block of a cone. A loop over the blocks of each cone would have a different length
    for every cone, and a mispredicted branch costs as much as filling a block.
    """
    end = 0
    after = 0
    for b in range(BONES):
        k = (stride * b + lane) & NATURAL
        if step == 0 or bounds.first_strip[k] + 2 * step <= bounds.last_strip[k]:
            if step:
                place_window(step, k, bounds, outlines, keys, image)
            count = max(int(bounds.stop_block[k]) - int(bounds.first_block[k]), 0)
            # if the cone has no blocks, the next cone overwrites this
            steps[end & NATURAL] = keys[k] - after + _NEXT_BLOCK
            after = keys[k] + count * _NEXT_BLOCK if count > 0 else after
            end += count
    steps[end & NATURAL] = _NEXT_BLOCK
    return end


@inlined
def span_rows(spans, outlines, k, row):
    """Write the first and the stop column of the cone at place k in a block's rows.

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
        place_window(0, k, bounds, outlines, work.keys, work.image)
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
    keys = work.keys
    steps = work.steps
    spans = work.spans
    further = 2 * image.shape[1]
    box, windows = bounding_box(lane, stride, bounds)
    for step in range(windows):
        block = -_NEXT_BLOCK
        count = list_blocks(step, lane, stride, bounds, outlines, keys, steps, image)
        for i in range(count):
            block += steps[i]
            steps[i] = _NEXT_BLOCK
            word, row, k = block_parts(block)
            span_rows(spans, outlines, k, row)
            set_spans(image, word, further, spans)
    return image, box
