"""Cones on a device: the steps of `posefit.silhouette.rasteriser`, a thread a joint, a bone, or some words of a row."""

import math

import numpy as np
from numba import cuda

from posefit.silhouette.cuda.arithmetic import ceiled, floored, fused, single_root, spanned
from posefit.silhouette.rasteriser import FAR, NEAR

BLOCK_ROWS, STRIP = 8, 32  # rows of a block, pixels of a word: as on a CPU
_FLAT = 1e-9
_ZERO, _ONE, _WINDOW = np.float32(0.0), np.float32(1.0), np.float32(64.0)
_HUGE = np.float32(1e9)
U, V, METRE = range(3)  # rows of `ends`, a column a joint
X0, Y0, S0, X1, Y1, S1, XP, MP, PA, PB, XQ, MQ, QA, QB, LINES = range(15)  # rows of `lines`, a column a bone
ROW, STOP, FIRST, LAST, TOP, BOUNDS = range(6)  # rows of `bounds`: those drawn, strips, and the cone's own first row


@cuda.jit(device=True)
def project_joint(j, frames, view, ends):
    """Write the projection of joint j, in pixels, and the pixels of a metre there: 0 where it is not to be drawn."""
    a, b, c = frames[j, 3, 0], frames[j, 3, 1], frames[j, 3, 2]
    x = view[0] * a + view[1] * b + view[2] * c + view[9]
    y = view[3] * a + view[4] * b + view[5] * c + view[10]
    z = view[6] * a + view[7] * b + view[8] * c + view[11]
    ends[U, j] = ends[V, j] = ends[METRE, j] = 0.0
    if NEAR <= z <= FAR:  # false for nan as well
        depth = 1.0 / z
        ends[U, j] = view[14] + view[12] * x * depth - 0.5
        ends[V, j] = view[15] + view[13] * y * depth - 0.5
        ends[METRE, j] = math.sqrt(view[12] * view[13]) * depth


@cuda.jit(device=True)
def write_segment(k, row, px, py, slope, gap, u0, v0, r0, v1, r1, lines):
    """Write one tangent segment of cone k, from row `row` of `lines` on: its line, and the rows that it crosses."""
    a = v0 + r0 * py
    b = v1 + r1 * py
    crosses = abs(px) > _FLAT and gap > 0.0
    lines[row, k] = u0 + r0 * px - a * slope
    lines[row + 1, k] = slope
    lines[row + 2, k] = min(a, b) if crosses else 1.0
    lines[row + 3, k] = max(a, b) if crosses else 0.0


@cuda.jit(device=True)
def write_cone(k, start, radii, ends, strips, width, height, lines, bounds):
    """Write the bounds of cone k, and the discs and tangent segments that border it; no rows where it is invisible."""
    bounds[ROW, k] = bounds[STOP, k] = 0
    u0, v0, r0 = ends[U, start], ends[V, start], ends[METRE, start] * radii[k, 0]
    u1, v1, r1 = ends[U, k + 1], ends[V, k + 1], ends[METRE, k + 1] * radii[k, 1]
    top = min(max(ceiled(min(v0 - r0, v1 - r1)), 0.0), float(height))
    bottom = max(min(floored(max(v0 + r0, v1 + r1)) + 1.0, float(height)), 0.0)
    left = min(max(ceiled(min(u0 - r0, u1 - r1)), 0.0), float(width))
    right = max(min(floored(max(u0 + r0, u1 + r1)) + 1.0, float(width)), 0.0)
    if not (top < bottom and left < right and min(ends[METRE, start], ends[METRE, k + 1]) > 0.0):
        return
    bounds[ROW, k] = int(top) // BLOCK_ROWS * BLOCK_ROWS
    bounds[STOP, k] = min((int(bottom) + BLOCK_ROWS - 1) // BLOCK_ROWS * BLOCK_ROWS, height)
    bounds[FIRST, k] = min(int(left) // STRIP, strips - 2)
    bounds[LAST, k] = (int(right) - 1) // STRIP
    bounds[TOP, k] = int(top)
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
    v0 -= top
    v1 -= top
    lines[X0, k], lines[Y0, k], lines[S0, k] = u0, v0, r0 * r0
    lines[X1, k], lines[Y1, k], lines[S1, k] = u1, v1, r1 * r1
    p = -py / (px if abs(px) > _FLAT and gap > 0.0 else 1.0)
    q = -qy / (qx if abs(qx) > _FLAT and gap > 0.0 else 1.0)
    write_segment(k, XP, px, py, p, gap, u0, v0, r0, v1, r1, lines)
    write_segment(k, XQ, qx, qy, q, gap, u0, v0, r0, v1, r1, lines)


@cuda.jit(device=True)
def crossing(k, y, lines):
    """Return from where to where cone k spans row y, counted from its own first; a huge column first where it does not.

    All are float32, as on a CPU.
    """
    low, high = _HUGE, -_HUGE
    if lines[PA, k] <= y <= lines[PB, k]:
        x = fused(lines[MP, k], y, lines[XP, k])
        low = high = x
    if lines[QA, k] <= y <= lines[QB, k]:
        x = fused(lines[MQ, k], y, lines[XQ, k])
        low, high = min(low, x), max(high, x)
    away = y - lines[Y0, k]
    square = fused(-away, away, lines[S0, k])
    if square >= _ZERO:
        half = single_root(square)
        low, high = min(low, lines[X0, k] - half), max(high, lines[X0, k] + half)
    away = y - lines[Y1, k]
    square = fused(-away, away, lines[S1, k])
    if square >= _ZERO:
        half = single_root(square)
        low, high = min(low, lines[X1, k] - half), max(high, lines[X1, k] + half)
    return low, high


@cuda.jit(device=True)
def word_of(low, high, strip, first, last, start):
    """Return the bits of a span in one strip, of a cone that has the strips from `first` to `last`.

    They are counted, as on a CPU, from the first pixel of the window of two strips that begins at strip `start`: so
    both round the same way.
    """
    if strip < first or strip > last:
        return np.uint32(0)
    column = np.float32(STRIP * start)
    stop = min(np.float32(STRIP * (last + 1)) - column, _WINDOW)
    a = np.int32(ceiled(max(low - column, _ZERO)))
    b = np.int32(min(high - column + _ONE, stop))
    before = STRIP * (strip - start)
    return spanned(a - before, b - before)
