"""How far the border of a drawn body is from that of a mask, and what would bring them together, in numba.

A drawn body is, in pixels, where its joints are and the two radii of each bone: J joints and B bones are
2 J + 2 B numbers, all that its border hangs on. Shapes are checked by the callers.
"""

import math

import numpy as np

from posefit.arrays import inlined, jit

CAP = 2  # points of a quarter, about, of the disc at a bone's end
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


@inlined
def _add(block, slope, share, across, down, wide, off, weight):
    """Add the square of one distance, which moves by (across, down) with its bone's axis and by `wide` with radii."""
    rest = 1.0 - share
    values = (across * rest, down * rest, across * share, down * share, wide * rest, wide * share)
    for i in range(6):
        slope[i] += weight * off * values[i]
        for j in range(6):
            block[i, j] += weight * values[i] * values[j]


@jit
def _write_cones(parents, centres, radii, cones, discs):
    """Write what distances from bones need (B, 8), and a disc about each (B, 3).

    A cone is its first point, its axis, of length 1, its length, its first radius, by how much less the last is, and
    how far along the axis a point's nearest is from where it would be on a cylinder, for each pixel across.
    """
    for b in range(parents.size):
        x, y = centres[parents[b], 0], centres[parents[b], 1]
        r0, r1 = radii[b, 0], radii[b, 1]
        dx, dy, dr = centres[b + 1, 0] - x, centres[b + 1, 1] - y, r0 - r1
        length = math.sqrt(dx * dx + dy * dy)
        discs[b, 0], discs[b, 1], discs[b, 2] = x + 0.5 * dx, y + 0.5 * dy, 0.5 * length + max(r0, r1)
        if length <= abs(dr) + TINY:  # one disc covers the other
            if dr < 0.0:
                x, y, r0 = x + dx, y + dy, r1
            dx, dy, dr, length = 0.0, 0.0, 0.0, 0.0
        inverse, slope = 1.0 / max(length, TINY), dr / math.sqrt(max(length * length - dr * dr, TINY))
        cones[b, 0], cones[b, 1], cones[b, 2], cones[b, 3] = x, y, dx * inverse, dy * inverse
        cones[b, 4], cones[b, 5], cones[b, 6], cones[b, 7] = length, r0, dr * inverse, slope


@inlined
def _from_cone(x, y, cone):
    """Return how far a point is off the nearest of a cone's discs, in x and in y, and its radius."""
    ox, oy = x - cone[0], y - cone[1]
    along = ox * cone[2] + oy * cone[3]
    across = abs(oy * cone[2] - ox * cone[3])
    at = min(max(along - across * cone[7], 0.0), cone[4])
    return ox - at * cone[2], oy - at * cone[3], cone[5] - at * cone[6]


@jit
def _nearest_bone(x, y, first, cones, discs):
    """Return the bone whose border is nearest to a point, and how far that is off; begin with `first`."""
    least, bone = np.inf, first
    for k in range(-1, discs.shape[0]):
        b = first if k < 0 else k
        reach = least + discs[b, 2]
        if (x - discs[b, 0]) ** 2 + (y - discs[b, 1]) ** 2 >= reach * reach:
            continue
        ox, oy, radius = _from_cone(x, y, cones[b])
        off = math.sqrt(ox * ox + oy * oy) - radius
        if off < least:
            least, bone = off, b
    return bone


@jit
def _write_beside(bone, discs, beside):
    """Write the other bones whose discs meet that of a bone, and return how many there are."""
    count = 0
    for b in range(discs.shape[0]):
        reach = discs[b, 2] + discs[bone, 2]
        off = (discs[b, 0] - discs[bone, 0]) ** 2 + (discs[b, 1] - discs[bone, 1]) ** 2
        if b != bone and off < reach * reach:
            beside[count] = b
            count += 1
    return count


@jit
def _covered(x, y, beside, cones, discs):
    for b in beside:
        if (x - discs[b, 0]) ** 2 + (y - discs[b, 1]) ** 2 < discs[b, 2] * discs[b, 2]:
            ox, oy, radius = _from_cone(x, y, cones[b])
            if radius > COVERED and ox * ox + oy * oy < (radius - COVERED) ** 2:
                return True
    return False


@jit
def pull(parents, centres, radii, field, corner, size, points, step, scale, blocks, slopes):
    """Add the squares of what points (n, 2) of the mask's border are off the body's, and the body's off the mask's.

    Each point of the mask's stands for `step` pixels. Those of a bone go to its own 6 x 6 half of a second derivative,
    and half of a gradient: of where its two joints are, column and row, and of both radii.
    """
    cones, discs = np.empty((parents.size, 8)), np.empty((parents.size, 3))
    _write_cones(parents, centres, radii, cones, discs)
    bone, beside = 0, np.empty(parents.size, np.int64)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        bone = _nearest_bone(x, y, bone, cones, discs)
        p, n = parents[bone], bone + 1
        off, share, nx, ny = cone_distance(
            x, y, centres[p, 0], centres[p, 1], radii[bone, 0], centres[n, 0], centres[n, 1], radii[bone, 1]
        )
        weight = step / (1.0 + (off / scale) ** 2)
        _add(blocks[bone], slopes[bone], share, -nx, -ny, -1.0, off, weight)
    spacing = 2.0 * step
    for b in range(parents.size):
        p = parents[b]
        dx, dy = centres[b + 1, 0] - centres[p, 0], centres[b + 1, 1] - centres[p, 1]
        r0, r1 = radii[b, 0], radii[b, 1]
        length = math.sqrt(dx * dx + dy * dy)
        if length <= abs(r0 - r1) + TINY:
            continue
        dx, dy = dx / length, dy / length
        others = beside[: _write_beside(b, discs, beside)]
        cosine = (r0 - r1) / length
        sine = math.sqrt(1.0 - cosine * cosine)
        tilt = math.acos(cosine)  # from the axis to the normal of the cone's side
        sides = max(int(length / spacing) + 1, 2)
        for k in range(2 * (sides + 1 + 2 * CAP)):
            i, side = k // 2, 1.0 - 2.0 * (k % 2)
            if i <= sides:
                share, along, aside = i / sides, cosine, sine
                stands = length * sine / sides * (0.5 if i in (0, sides) else 1.0)
            elif side > 0.0:
                share = 1.0 if i <= sides + CAP else 0.0
                if share > 0.0:
                    angle, stands = tilt * (i - sides - 0.5) / CAP, r1 * tilt / CAP
                else:
                    rest = math.pi - tilt
                    angle, stands = tilt + rest * (i - sides - CAP - 0.5) / CAP, r0 * rest / CAP
                along, aside = math.cos(angle), math.sin(angle)
            nx, ny = along * dx - side * aside * dy, along * dy + side * aside * dx
            radius = r0 + share * (r1 - r0)
            x = centres[p, 0] + share * length * dx + radius * nx
            y = centres[p, 1] + share * length * dy + radius * ny
            column, row = x - corner[0] - 0.5, y - corner[1] - 0.5
            left, top = math.floor(column), math.floor(row)
            if not (0 <= left < size[1] - 1 and 0 <= top < size[0] - 1):
                continue
            if _covered(x, y, others, cones, discs):
                continue
            u, v = column - left, row - top
            upper, lower = field[top], field[top + 1]
            one, two, three, four = upper[left], upper[left + 1], lower[left], lower[left + 1]
            off = (one * (1.0 - u) + two * u) * (1.0 - v) + (three * (1.0 - u) + four * u) * v
            across = (two - one) * (1.0 - v) + (four - three) * v
            down = (three - one) * (1.0 - u) + (four - two) * u
            weight = stands / (1.0 + (off / scale) ** 2)
            _add(blocks[b], slopes[b], share, across, down, across * nx + down * ny, off, weight)


@jit
def pull_to_borders(parents, centres, radii, fields, corners, sizes, points, starts, step, scales, out):
    """Add, frame by frame, half the second derivative and half the gradient of the squares of all distances, in pixels.

    `centres` (T, J, 2) and `radii` (T, B, 2) are the drawn body; `fields` (T, h, w), `corners` and `sizes` (T, 2),
    `points` (n, 2) and `starts` (T + 1,) are `MaskContours`, whose points stand for `step` pixels of the border each. A
    distance counts by the pixels that it stands for, and the less the farther it is off, beyond `scales` (T,). `out`
    is curves (T, 2 J + 2 B, 2 J + 2 B) and slopes (T, 2 J + 2 B).
    """
    curves, slopes = out
    joints, bones = centres.shape[1], parents.size
    blocks, forces, columns = np.empty((bones, 6, 6)), np.empty((bones, 6)), np.empty(6, np.int64)
    for k in range(centres.shape[0]):
        if starts[k] == starts[k + 1]:
            continue
        blocks[:], forces[:] = 0.0, 0.0
        mask = fields[k], corners[k], sizes[k], points[starts[k] : starts[k + 1]], step, scales[k]
        pull(parents, centres[k], radii[k], *mask, blocks, forces)
        for b in range(bones):
            for i in range(2):
                columns[i], columns[2 + i] = 2 * parents[b] + i, 2 * (b + 1) + i
                columns[4 + i] = 2 * (joints + b) + i
            for i in range(6):
                slopes[k, columns[i]] += forces[b, i]
                for j in range(6):
                    curves[k, columns[i], columns[j]] += blocks[b, i, j]
