"""Outlines of cones: where a body's bones are in an image, and how they are bounded.

A body is 26 tapered cones, one per bone. In the image a cone is the convex hull of two
discs, bounded by arcs of both and by two tangent segments. This module writes discs and
tangents of LANES poses at once; `rasteriser` fills them. The callers check shapes.

Each quantity, such as the column of a disc's centre, is one row of an array. A slot is
one element of such a row:

    slot k    0   1  ...  15  |  16  17  ...  31  |  ...  |  400  ...  415  |  ...  511
    bone      0   0  ...   0  |   1   1  ...   1  |  ...  |   25  ...   25  |  unused
    pose      0   1  ...  15  |   0   1  ...  15  |  ...  |    0  ...   15  |

With this order, loops over slots run in vector registers. For the same reason they
choose between two values by a conditional expression, not by a branch.

The cone of a bone and a lane is in slot `LANES * bone + lane`, and joint j of a lane in
slot `LANES * j + lane`. Bone b ends in joint b + 1, LANES slots further. If there is
only one pose, its cones are next to each other instead, in slot `bone`. `stride` is the
number of slots from one bone to the next: LANES or 1.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined
from posefit.geometry.kernels import LANES, NATURAL, X, Y, Z
from posefit.silhouette.spans import BLOCK, STRIP_PIXELS

# metres: a bone is drawn only if both ends are between these depths
NEAR = 0.05
FAR = 1e6
FLAT = 1e-9  # a tangent flatter than this crosses no row of pixels
NOWHERE = 1 << 20  # the block and strip of an invisible cone: beyond every image
BONES = 26

Singles = NDArray[np.float32]
Integers = NDArray[np.int32]


class Ends(NamedTuple):
    """The projected discs at both ends of the cones."""

    start_u: Array  # column of the centre of the first disc
    start_v: Array  # row
    start_inverse_depth: Array  # 1 / metres; 0 if not drawn
    # the same for all joints: the second disc of a cone is `stride` slots further
    joint_u: Array
    joint_v: Array
    joint_inverse_depth: Array
    start_radius: Array  # pixels
    end_radius: Array
    # radius in pixels at depth 1; always in slot `LANES * bone + lane`
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
    """The blocks and strips of each cone in the bit image; NOWHERE if invisible."""

    first_block: Integers  # of eight rows
    stop_block: Integers  # the one after the last
    first_strip: Integers
    last_strip: Integers
    # The first row of the first block. It may be up to seven rows above the cone's top,
    # so it is counted from BLOCK rows above the top: then it is not negative.
    row: Integers


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
        bounds.first_block[k] = first_block if visible else NOWHERE
        bounds.stop_block[k] = stop_block if visible else 0
        bounds.first_strip[k] = first_strip if visible else NOWHERE
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
