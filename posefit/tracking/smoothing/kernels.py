"""How far the border of a drawn body is from that of a mask, and what would bring them together, in numba.

A drawn body is, in pixels, where its joints are and the two radii of each bone: J joints and B bones are
2 J + 2 B numbers, all that its border hangs on. Shapes are checked by the callers.
"""

import math

import numpy as np

from posefit.arrays import jit

CAP = 3  # points of a quarter, about, of the disc at a bone's end
COVERED = 0.25  # pixels within another bone from which on a point of a bone's border is hidden
TINY = 1e-9


@jit
def cone_distance(x, y, x0, y0, r0, x1, y1, r1):
    """Return how far a point is outside a cone, below 0 within, the share of the bone it is at, and its normal."""
    dx, dy, dr = x1 - x0, y1 - y0, r0 - r1
    square = dx * dx + dy * dy
    if square <= dr * dr + TINY:  # one disc covers the other
        share = 0.0 if r0 >= r1 else 1.0
    else:
        length = math.sqrt(square)
        along = ((x - x0) * dx + (y - y0) * dy) / length
        across = abs((y - y0) * dx - (x - x0) * dy) / length
        share = min(max((along - across * dr / math.sqrt(square - dr * dr)) / length, 0.0), 1.0)
    ox, oy = x - (x0 + share * dx), y - (y0 + share * dy)
    off = math.sqrt(ox * ox + oy * oy)
    return off - (r0 - share * dr), share, ox / max(off, TINY), oy / max(off, TINY)


@jit
def _bone_distance(x, y, bone, parents, centres, radii):
    p, n = parents[bone], bone + 1
    return cone_distance(
        x, y, centres[p, 0], centres[p, 1], radii[bone, 0], centres[n, 0], centres[n, 1], radii[bone, 1]
    )


@jit
def _add(curves, slopes, parent, bone, joints, share, across, down, wide, off, weight):
    """Add the square of one distance, which moves by (across, down) with its bone's axis and by `wide` with radii."""
    first = 2 * joints + 2 * bone
    columns = (2 * parent, 2 * parent + 1, 2 * bone + 2, 2 * bone + 3, first, first + 1)
    rest = 1.0 - share
    values = (across * rest, down * rest, across * share, down * share, wide * rest, wide * share)
    for i in range(6):
        slopes[columns[i]] += weight * off * values[i]
        for j in range(6):
            curves[columns[i], columns[j]] += weight * values[i] * values[j]


@jit
def _covered(x, y, bone, parents, centres, radii):
    for b in range(parents.size):
        if b != bone and _bone_distance(x, y, b, parents, centres, radii)[0] < -COVERED:
            return True
    return False


@jit
def _pull_points(points, parents, centres, radii, step, scale, curves, slopes):
    """Add what brings the body's border to points (n, 2) of the mask's."""
    joints = centres.shape[0]
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        least, bone, share, nx, ny = np.inf, 0, 0.0, 0.0, 0.0
        for b in range(parents.size):
            off, at, ox, oy = _bone_distance(x, y, b, parents, centres, radii)
            if off < least:
                least, bone, share, nx, ny = off, b, at, ox, oy
        weight = step / (1.0 + (least / scale) ** 2)
        _add(curves, slopes, parents[bone], bone, joints, share, -nx, -ny, -1.0, least, weight)


@jit
def _pull_bones(field, corner, size, parents, centres, radii, spacing, scale, curves, slopes):
    """Add what brings points of the body's border to the mask's, by a field of how far pixels are outside of it."""
    joints = centres.shape[0]
    for b in range(parents.size):
        p = parents[b]
        dx, dy = centres[b + 1, 0] - centres[p, 0], centres[b + 1, 1] - centres[p, 1]
        r0, r1 = radii[b, 0], radii[b, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length <= abs(r0 - r1) + TINY:
            continue
        dx, dy = dx / length, dy / length
        tilt = math.acos((r0 - r1) / length)  # from the axis to the normal of the cone's side
        sides = max(int(length / spacing) + 1, 2)
        for k in range(2 * (sides + 1 + 2 * CAP)):
            side, i = (1.0 if k % 2 == 0 else -1.0), k // 2
            if i <= sides:
                share, angle = i / sides, tilt
                step = length * math.sin(tilt) / sides * (0.5 if i in (0, sides) else 1.0)
            elif i <= sides + CAP:
                share, angle = 1.0, tilt * (i - sides - 0.5) / CAP
                step = r1 * tilt / CAP
            else:
                share, angle = 0.0, tilt + (math.pi - tilt) * (i - sides - CAP - 0.5) / CAP
                step = r0 * (math.pi - tilt) / CAP
            nx = math.cos(angle) * dx - side * math.sin(angle) * dy
            ny = math.cos(angle) * dy + side * math.sin(angle) * dx
            radius = r0 + share * (r1 - r0)
            x = centres[p, 0] + share * length * dx + radius * nx
            y = centres[p, 1] + share * length * dy + radius * ny
            column, row = x - corner[0] - 0.5, y - corner[1] - 0.5
            left, top = math.floor(column), math.floor(row)
            if not (0 <= left < size[1] - 1 and 0 <= top < size[0] - 1):
                continue
            if _covered(x, y, b, parents, centres, radii):
                continue
            u, v = column - left, row - top
            upper, lower = field[top], field[top + 1]
            one, two, three, four = upper[left], upper[left + 1], lower[left], lower[left + 1]
            off = (one * (1.0 - u) + two * u) * (1.0 - v) + (three * (1.0 - u) + four * u) * v
            across = (two - one) * (1.0 - v) + (four - three) * v
            down = (three - one) * (1.0 - u) + (four - two) * u
            weight = step / (1.0 + (off / scale) ** 2)
            _add(curves, slopes, p, b, joints, share, across, down, across * nx + down * ny, off, weight)


@jit
def pull_to_borders(parents, centres, radii, fields, corners, sizes, points, starts, step, scales, out):
    """Add, frame by frame, half the second derivative and half the gradient of the squares of all distances, in pixels.

    `centres` (T, J, 2) and `radii` (T, B, 2) are the drawn body; `fields` (T, h, w), `corners` and `sizes` (T, 2),
    `points` (n, 2) and `starts` (T + 1,) are `MaskContours`, whose points stand for `step` pixels of the border each. A
    distance counts by the pixels that it stands for, and the less the farther it is off, beyond `scales` (T,). `out`
    is curves (T, 2 J + 2 B, 2 J + 2 B) and slopes (T, 2 J + 2 B).
    """
    curves, slopes = out
    for k in range(centres.shape[0]):
        if starts[k] == starts[k + 1]:
            continue
        drawn = parents, centres[k], radii[k]
        added = scales[k], curves[k], slopes[k]
        _pull_points(points[starts[k] : starts[k + 1]], *drawn, step, *added)
        _pull_bones(fields[k], corners[k], sizes[k], *drawn, 2.0 * step, *added)
