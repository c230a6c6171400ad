"""The rasteriser: numba loops over arrays. Shapes are checked by the callers.

A bit image is (words, height + PAD) uint64: bit i of image[w, y] is pixel (64 w + i, y). Words stand in columns, so
that eight neighbouring rows are one vector register. A cone is the hull of two discs. In one row of pixels it spans
from the least to the greatest of at most six crossings: two with each disc, one with each of the two tangent
segments. A pixel belongs to it when its centre lies within that span, borders included.
"""

import math
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, jit
from posefit.geometry.kernels import place_joints

BLOCK = 8  # rows filled at a time
PAD = 2 * BLOCK  # rows below the image that a block may spill into
NEAR, FAR = 0.05, 1e6  # metres; a bone with an end outside of this depth is not drawn
_FLAT = 1e-9  # a tangent flatter than this lies between rows of pixels
_HUGE = np.float32(1e9)
ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
NONE = np.uint64(0)
_ZERO, _ONE, _WORD = np.float32(0), np.float32(1), np.float32(64)

# Scratch rows, each LANES long and one lane a bone, in one flat array: offsets known to the compiler are what lets
# it see that the loop over bones in `outline` may run in vector registers.
LANES = 32
_U0, _V0, _R0, _U1, _V1, _R1 = (row * LANES for row in range(6))
_SCRATCH_ENDS = 6 * LANES
_TOP, _BOTTOM, _LEFT, _RIGHT = (row * LANES for row in range(4))
_SCRATCH_BOUNDS = 4 * LANES
_X0, _Y0, _S0, _X1, _Y1, _S1 = (row * LANES for row in range(6))
_XP, _MP, _PA, _PB, _XQ, _MQ, _QA, _QB = (row * LANES for row in range(6, 14))
_SCRATCH_OUTLINE = 14 * LANES


class View(NamedTuple):
    """A camera as the kernel wants it."""

    rotation: Array  # (3, 3) camera_from_world
    translation: Array  # (3,)
    focal: Array  # (2,) pixels
    centre: Array  # (2,) pixels
    width: int
    height: int


@jit
def below(k):
    """Return a word whose lowest k bits are set, k from 0 to 64."""
    return ALL if k > 63 else ~(ALL << np.uint64(k))


@jit
def outline(ends, lines, bounds, width, height):
    """Write each cone's pixel bounds, and the discs and tangent segments that border it, rows counted from its top."""
    for k in range(LANES):
        u0, v0, r0 = ends[_U0 + k], ends[_V0 + k], ends[_R0 + k]
        u1, v1, r1 = ends[_U1 + k], ends[_V1 + k], ends[_R1 + k]
        dx = u1 - u0
        dy = v1 - v0
        dr = r0 - r1
        dd = dx * dx + dy * dy
        gap = dd - dr * dr
        # the two unit normals n with n . (c1 - c0) = r0 - r1: along the axis, plus or minus across it
        along = dr / max(dd, 1e-30)
        across = math.sqrt(max(gap, 0.0)) / max(dd, 1e-30)
        px = along * dx - across * dy
        py = along * dy + across * dx
        qx = along * dx + across * dy
        qy = along * dy - across * dx
        top = min(max(np.ceil(min(v0 - r0, v1 - r1)), 0.0), height)
        bounds[_TOP + k] = np.int32(top)
        bounds[_BOTTOM + k] = np.int32(max(min(np.floor(max(v0 + r0, v1 + r1)) + 1.0, height), 0.0))
        bounds[_LEFT + k] = np.int32(min(max(np.ceil(min(u0 - r0, u1 - r1)), 0.0), width))
        bounds[_RIGHT + k] = np.int32(max(min(np.floor(max(u0 + r0, u1 + r1)) + 1.0, width), 0.0))
        lines[_X0 + k] = u0
        lines[_Y0 + k] = v0 - top
        lines[_S0 + k] = r0 * r0
        lines[_X1 + k] = u1
        lines[_Y1 + k] = v1 - top
        lines[_S1 + k] = r1 * r1
        a = v0 + r0 * py - top
        b = v1 + r1 * py - top
        crosses = (abs(px) > _FLAT) & (gap > 0.0)
        slope = -py / (px if crosses else 1.0)
        lines[_XP + k] = u0 + r0 * px - a * slope
        lines[_MP + k] = slope
        lines[_PA + k] = min(a, b) if crosses else 1.0
        lines[_PB + k] = max(a, b) if crosses else 0.0
        a = v0 + r0 * qy - top
        b = v1 + r1 * qy - top
        crosses = (abs(qx) > _FLAT) & (gap > 0.0)
        slope = -qy / (qx if crosses else 1.0)
        lines[_XQ + k] = u0 + r0 * qx - a * slope
        lines[_MQ + k] = slope
        lines[_QA + k] = min(a, b) if crosses else 1.0
        lines[_QB + k] = max(a, b) if crosses else 0.0


@jit
def plan(bones, seen, bounds, box, items):
    """Write the (bone, word, block) items to fill and the image's bounding box; return how many items.

    The usual cone, of few blocks in one or two words, is listed without a branch on its size: a mispredicted
    branch costs as much as filling a block.
    """
    top, bottom, left, right = 1 << 30, 0, 1 << 30, -1
    p = 0
    for j in range(bones):
        y0, y1 = int(bounds[_TOP + j]), int(bounds[_BOTTOM + j])
        x0, x1 = int(bounds[_LEFT + j]), int(bounds[_RIGHT + j])
        drawn = seen[j] & (y0 < y1) & (x0 < x1)
        blocks = (y1 - y0 + BLOCK - 1) // BLOCK if drawn else 0
        first, last = x0 >> 6, (x1 - 1) >> 6
        top = min(top, y0 if drawn else top)
        bottom = max(bottom, y1 if drawn else bottom)
        left = min(left, first if drawn else left)
        right = max(right, last if drawn else right)
        if (blocks <= 8) & (last - first <= 1):
            key = (j << 32) | (first << 16)
            for i in range(8):
                items[p + i] = key + i
            p += blocks
            key += 1 << 16
            for i in range(8):
                items[p + i] = key + i
            p += blocks if last > first else 0
        elif drawn:
            for w in range(first, last + 1):
                for i in range(blocks):
                    items[p] = (j << 32) | (w << 16) | i
                    p += 1
    box[0], box[1], box[2], box[3] = top, bottom, left, right
    return p


@jit
def fill(rows, lines, j, row, column):
    """Set the pixels of cone j in eight rows of one word: from `row` of the cone on, from pixel `column` on.

    Rows below the cone cross neither disc nor tangent and stay as they are.
    """
    x0, y0, s0 = lines[_X0 + j], lines[_Y0 + j], lines[_S0 + j]
    x1, y1, s1 = lines[_X1 + j], lines[_Y1 + j], lines[_S1 + j]
    xp, mp, pa, pb = lines[_XP + j], lines[_MP + j], lines[_PA + j], lines[_PB + j]
    xq, mq, qa, qb = lines[_XQ + j], lines[_MQ + j], lines[_QA + j], lines[_QB + j]
    for k in range(BLOCK):
        y = np.float32(row + k)
        d = s0 - (y - y0) * (y - y0)
        h = math.sqrt(max(d, _ZERO))
        low = x0 - h if d >= _ZERO else _HUGE
        high = x0 + h if d >= _ZERO else -_HUGE
        d = s1 - (y - y1) * (y - y1)
        h = math.sqrt(max(d, _ZERO))
        low = min(low, x1 - h if d >= _ZERO else _HUGE)
        high = max(high, x1 + h if d >= _ZERO else -_HUGE)
        x = xp + mp * y
        crosses = (y >= pa) & (y <= pb)
        low = min(low, x if crosses else _HUGE)
        high = max(high, x if crosses else -_HUGE)
        x = xq + mq * y
        crosses = (y >= qa) & (y <= qb)
        low = min(low, x if crosses else _HUGE)
        high = max(high, x if crosses else -_HUGE)
        first = np.int32(np.ceil(min(max(low - column, _ZERO), _WORD)))
        stop = np.int32(np.floor(min(max(high - column + _ONE, _ZERO), _WORD)))
        rows[k] |= below(stop) & ~below(first)


@jit
def rasterise(chain, radii, view, joints, seen, ends, lines, bounds, items, box, image):
    """Set the pixels of every cone of one body in a clear bit image, and its bounding box. Overwrites `joints`."""
    rotation, translation = view.rotation, view.translation
    scale = math.sqrt(view.focal[0] * view.focal[1])
    for j in range(joints.shape[0]):
        a, b, c = joints[j, 0], joints[j, 1], joints[j, 2]
        x = rotation[0, 0] * a + rotation[0, 1] * b + rotation[0, 2] * c + translation[0]
        y = rotation[1, 0] * a + rotation[1, 1] * b + rotation[1, 2] * c + translation[1]
        z = rotation[2, 0] * a + rotation[2, 1] * b + rotation[2, 2] * c + translation[2]
        inside = (z >= NEAR) & (z <= FAR)  # false for nan as well
        depth = 1.0 / z if inside else 0.0
        joints[j, 0] = view.centre[0] + view.focal[0] * x * depth - 0.5 if inside else 0.0
        joints[j, 1] = view.centre[1] + view.focal[1] * y * depth - 0.5 if inside else 0.0
        joints[j, 2] = scale * depth
    for b in range(chain.parents.size):
        p = chain.parents[b]
        ends[_U0 + b] = joints[p, 0]
        ends[_V0 + b] = joints[p, 1]
        ends[_R0 + b] = joints[p, 2] * radii[b, 0]
        ends[_U1 + b] = joints[b + 1, 0]
        ends[_V1 + b] = joints[b + 1, 1]
        ends[_R1 + b] = joints[b + 1, 2] * radii[b, 1]
        seen[b] = (joints[p, 2] > 0.0) & (joints[b + 1, 2] > 0.0)
    outline(ends, lines, bounds, float(view.width), float(view.height))
    pixels, stride = image.reshape(-1), image.shape[1]
    for i in range(plan(chain.parents.size, seen, bounds, box, items)):
        j, w, row = items[i] >> 32, (items[i] >> 16) & 0xFFFF, (items[i] & 0xFFFF) * BLOCK
        at = w * stride + bounds[_TOP + j] + row
        fill(pixels[at : at + BLOCK], lines, j, row, np.float32(64 * w))


@jit
def scratch(view, bones, angles):
    """Return the work arrays of one thread: for the kinematics, for the outlines, and a clear bit image."""
    words = (view.width + 63) // 64
    kinematics = (np.empty(angles), np.empty(angles), np.empty((bones + 1, 3, 3)), np.empty((bones + 1, 3)))
    outlines = (
        np.zeros(bones, np.bool_),
        np.zeros(_SCRATCH_ENDS),
        np.zeros(_SCRATCH_OUTLINE, np.float32),
        np.zeros(_SCRATCH_BOUNDS, np.int32),
        np.empty(bones * words * (view.height // BLOCK + 2) + 16, np.int64),
        np.zeros(4, np.int64),
    )
    return kinematics, outlines, np.zeros((words, view.height + PAD), np.uint64)


@jit
def draw_pose(chain, radii, view, pose, translation, work):
    """Set the pixels of one body in the clear bit image of `work`, which `scratch` makes; return it and its box."""
    (sines, cosines, frames, joints), (seen, ends, lines, bounds, items, box), image = work
    place_joints(chain, pose, translation, sines, cosines, frames, joints)
    rasterise(chain, radii, view, joints, seen, ends, lines, bounds, items, box, image)
    return image, box
