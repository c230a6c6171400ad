"""Residuals of a contour fit: distances between the borders of masks and of bones.

A bone is here what a camera sees of it: a tapered cone, the hull of two discs in the
picture. The six numbers of a bone are the columns, rows and radii of these discs. This
module sums the residuals of each bone, as docs/background/contour-fit.md derives in (1)
to (6):

    from the mask's border                 from the body's border
    each point to the nearest bone         points on the sides and caps of each bone
      cone_distance (1), (2)                 write_side_points, write_cap_points (3)
             |                               hide: not those within another bone
             |                               field_distance (4)
             |                                        |
             +------> accumulate (5), (6) <-----------+
                      24 sums of products a bone
                               |
                             expand (5)
                      Hessian (6, 6) and gradient (6,) of each bone

Residuals are in pixels. Hessians and gradients are halved. The callers check shapes.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit
from posefit.geometry.kernels import sine_cosine

CAP = 2  # points on one half of the arc at a bone's end
# a point of a bone's border is hidden if it lies deeper than this, in pixels, within
# another bone
COVERED = 0.25
TINY = 1e-9
# A bone has six numbers: the columns and rows of its first and its last disc, then both
# radii. Row 0 has the indices of the first disc's column, row and radius.
NUMBERS_OF_END = np.array([[0, 1, 4], [2, 3, 5]])
PRODUCTS = 24  # sums of products of a bone's residuals, see `accumulate`


class Contour(NamedTuple):
    """The border of the mask of one frame."""

    field: NDArray[np.float32]  # (h, w) pixels outside the mask, negative within
    corner: NDArray[np.int64]  # (2,) column and row of the field's first pixel
    size: NDArray[np.int64]  # (2,) rows and columns of the field
    points: Array  # (n, 2) pixels of the border
    spacing: float  # pixels of the border that a point represents
    # (n,) the bone nearest to each point in the step before, at first -1; each step
    # overwrites them
    owners: NDArray[np.int64]


class Cone(NamedTuple):
    """A drawn bone: the numbers from which distances follow.

    A cone gets many distances. Divisions and roots take longest, and are done once.
    """

    x: float  # centre of the first disc, pixels
    y: float
    radius: float  # of the first disc
    axis_x: float  # direction to the centre of the last disc
    axis_y: float
    length: float  # distance between both centres
    taper: float  # the first radius minus the last
    tangent: float  # of the angle between the sides and the axis
    inverse: float  # 1 over the length, or 0 if one disc covers the other


CONE = len(Cone._fields)


class Points(NamedTuple):
    """Points on the border of a drawn bone.

    Each number has an array (P,), so that loops over points run in vector registers.
    """

    columns: Array  # pixels
    rows: Array
    normal_columns: Array  # the normal of the border, out of the bone
    normal_rows: Array
    shares: Array  # 0 at the bone's first disc, 1 at its last
    lengths: Array  # pixels of the border that a point represents
    hidden: NDArray[np.bool_]  # whether another bone covers it


@jit
def write_cones(parents, centres, radii, cones, discs):
    """Write the numbers of `cones` (B, CONE), and `discs` (B, 3).

    A disc encloses its bone. Its three numbers are its centre and radius.
    """
    for b in range(parents.size):
        x = centres[parents[b], 0]
        y = centres[parents[b], 1]
        r0 = radii[b, 0]
        r1 = radii[b, 1]
        dx = centres[b + 1, 0] - x
        dy = centres[b + 1, 1] - y
        dr = r0 - r1
        square = dx * dx + dy * dy
        length = math.sqrt(square)
        tangent = 0.0
        inverse = 0.0
        if square > dr * dr + TINY:
            tangent = dr / math.sqrt(square - dr * dr)
            inverse = 1.0 / length
        axis_x = dx / max(length, TINY)
        axis_y = dy / max(length, TINY)
        cone = Cone(x, y, r0, axis_x, axis_y, length, dr, tangent, inverse)
        for k in range(CONE):
            cones[b, k] = cone[k]
        discs[b, 0] = x + 0.5 * dx
        discs[b, 1] = y + 0.5 * dy
        discs[b, 2] = 0.5 * length + max(r0, r1)


@inlined
def cone_of(cones, b):
    """Return the cone of bone b."""
    row = cones[b]
    return Cone(row[0], row[1], row[2], row[3], row[4], row[5], row[6], row[7], row[8])


@inlined
def _nearest_disc(x, y, cone):
    """Return the disc of a cone that is nearest to a point.

    Returns:
        Its share of the bone, the offset (2,) of the point from its centre, and its
        radius.
    """
    x -= cone.x
    y -= cone.y
    along = x * cone.axis_x + y * cone.axis_y
    across = abs(y * cone.axis_x - x * cone.axis_y)
    share = (along - across * cone.tangent) * cone.inverse
    if cone.inverse == 0.0 and cone.taper < 0.0:
        share = 1.0
    share = min(max(share, 0.0), 1.0)
    part = share * cone.length
    radius = cone.radius - share * cone.taper
    return share, x - part * cone.axis_x, y - part * cone.axis_y, radius


@inlined
def cone_distance(x, y, cone):
    """Return a point's distance from a cone, its share of the bone, and the normal.

    The distance is negative within the cone.
    """
    share, ox, oy, radius = _nearest_disc(x, y, cone)
    off = math.sqrt(ox * ox + oy * oy)
    distance = off - radius  # contour (1)
    return distance, share, ox / max(off, TINY), oy / max(off, TINY)


@inlined
def _nearer(x, y, cone, distance):
    """Return whether a point is nearer to a cone than a distance, without a root."""
    _, ox, oy, radius = _nearest_disc(x, y, cone)
    reach = radius + distance
    return (reach > 0.0) & (ox * ox + oy * oy < reach * reach)


@inlined
def accumulate(products, share, slope, residual, weight):
    """Add the products of a residual to the products of its bone. contour (5).

    `slope` has derivatives h by the column, the row and the radius of the disc at a
    `share` of the bone, from 0 at its start to 1 at its end. The derivatives by the
    first disc are h times 1 - share. The derivatives by the last disc are h times
    share. So the 24 products of the residual and its derivatives are:

        0 ... 5     h h^T times (1 - share)^2, its upper triangle row by row
        6 ... 11    the same times (1 - share) share
        12 ... 17   the same times share^2
        18 ... 20   h times the residual and 1 - share
        21 ... 23   h times the residual and share
    """
    rest = 1.0 - share
    near = rest * rest
    both = rest * share
    far = share * share
    k = 0
    for i in range(3):
        weighted = weight * slope[i]
        for j in range(i, 3):
            product = weighted * slope[j]
            products[k] += product * near
            products[6 + k] += product * both
            products[12 + k] += product * far
            k += 1
        products[18 + i] += weighted * residual * rest
        products[21 + i] += weighted * residual * share


@inlined
def expand(products, hessians, gradients):
    """Add the products of bones (B, 24) to their Hessians and gradients. contour (5).

    The Hessians (B, 6, 6) and gradients (B, 6) are halved.
    """
    for bone in range(products.shape[0]):
        for end in range(2):
            for i in range(3):
                row = NUMBERS_OF_END[end, i]
                gradients[bone, row] += products[bone, 18 + 3 * end + i]
                for other in range(2):
                    for j in range(3):
                        low = min(i, j)
                        # the place of (i, j) in the upper triangle, row by row
                        pair = low * (5 - low) // 2 + max(i, j)
                        product = products[bone, 6 * (end + other) + pair]
                        column = NUMBERS_OF_END[other, j]
                        hessians[bone, row, column] += product


@jit
def accumulate_borders(parents, centres, radii, contour, scale, hessians, gradients):
    """Add the squared distances between the mask's border and the body's, both ways.

    They are added for each bone, as half a Hessian (B, 6, 6) and half a gradient (B, 6)
    by the column and row of its two joints and by both radii. Distances beyond `scale`
    pixels count less. The owners of the contour's points become the bones that are
    nearest now.
    """
    count = parents.size
    cones = np.empty((count, CONE))
    discs = np.empty((count, 3))
    write_cones(parents, centres, radii, cones, discs)
    products = np.zeros((count, PRODUCTS))
    _accumulate_mask_border(contour, scale, cones, discs, products)
    neighbours = np.empty(count, np.int64)
    points = empty_points(cones, contour.spacing)
    for b in range(count):
        # a bone with one disc covered by the other has no sides, and gets no points
        cone = cone_of(cones, b)
        if cone.length > abs(cone.taper) + TINY:
            on_sides = write_side_points(cone, contour.spacing, points)
            drawn = write_cap_points(cone, points, on_sides)
            for i in range(_write_neighbours(b, discs, neighbours)):
                hide(points, drawn, cone_of(cones, neighbours[i]))
            _accumulate_points(points, drawn, contour, scale, products[b])
    expand(products, hessians, gradients)


@inlined
def _accumulate_mask_border(contour, scale, cones, discs, products):
    """Add the squared distances of the mask's border from the nearest bones.

    Most points keep their nearest bone from one step to the next, so a search that
    begins with it is short.
    """
    owners = contour.owners
    bone = 0
    for i in range(contour.points.shape[0]):
        x = contour.points[i, 0]
        y = contour.points[i, 1]
        first = owners[i] if owners[i] >= 0 else bone
        bone = _nearest_bone(x, y, first, cones, discs)
        owners[i] = bone
        distance, share, nx, ny = cone_distance(x, y, cone_of(cones, bone))
        weight = contour.spacing / (1.0 + (distance / scale) ** 2)  # contour (6)
        slope = -nx, -ny, -1.0  # contour (2)
        accumulate(products[bone], share, slope, distance, weight)


@inlined
def _nearest_bone(x, y, first, cones, discs):
    """Return the bone with the border nearest to a point, searching from `first` on."""
    least = cone_distance(x, y, cone_of(cones, first))[0]
    bone = first
    for b in range(discs.shape[0]):
        reach = least + discs[b, 2]
        dx = x - discs[b, 0]
        dy = y - discs[b, 1]
        near = b != first and dx * dx + dy * dy < reach * reach
        if near and _nearer(x, y, cone_of(cones, b), least):
            least = cone_distance(x, y, cone_of(cones, b))[0]
            bone = b
    return bone


@inlined
def side_pieces(length, spacing):
    """Return the number of pieces that each side of a bone is cut into, two or more."""
    return max(int(length / (2.0 * spacing)) + 1, 2)


@inlined
def empty_points(cones, spacing):
    """Return `Points` with room for the points of the longest bone."""
    longest = 0.0
    for b in range(cones.shape[0]):
        longest = max(longest, cone_of(cones, b).length)
    room = 2 * (side_pieces(longest, spacing) + 1) + 4 * CAP
    numbers = np.empty((6, room))
    return Points(
        numbers[0],
        numbers[1],
        numbers[2],
        numbers[3],
        numbers[4],
        numbers[5],
        np.empty(room, np.bool_),
    )


@inlined
def _write_point(points, k, cone, share, normal, length):
    """Write point k, where the `normal` meets the disc at a share of a bone."""
    nx, ny = normal
    radius = cone.radius - share * cone.taper
    part = share * cone.length
    points.columns[k] = cone.x + part * cone.axis_x + radius * nx  # contour (3)
    points.rows[k] = cone.y + part * cone.axis_y + radius * ny
    points.normal_columns[k] = nx
    points.normal_rows[k] = ny
    points.shares[k] = share
    points.lengths[k] = length
    points.hidden[k] = False


@inlined
def write_side_points(cone, spacing, points):
    """Write points on the two sides of a bone's border. Return their number.

    The sides are the segments that touch both discs.
    """
    length = cone.length
    dx = cone.axis_x
    dy = cone.axis_y
    cosine = cone.taper / length
    sine = math.sqrt(1.0 - cosine * cosine)
    pieces = side_pieces(length, spacing)
    for i in range(pieces + 1):
        share = i / pieces
        # the first and the last point have only one neighbour: half a piece each
        piece = length * sine / pieces * (0.5 if i in (0, pieces) else 1.0)
        for side in range(2):
            across = sine if side == 0 else -sine
            normal = cosine * dx - across * dy, cosine * dy + across * dx
            _write_point(points, 2 * i + side, cone, share, normal, piece)
    return 2 * (pieces + 1)


@inlined
def write_cap_points(cone, points, count):
    """Write points on the two arcs of a bone's border, after `count` others.

    Returns:
        The number of all points.
    """
    dx = cone.axis_x
    dy = cone.axis_y
    # the angle from the axis to the normal of the cone's side
    tilt = math.acos(cone.taper / cone.length)
    # the arc of the last disc is around the axis, the arc of the first around its
    # opposite
    for share, start, arc in ((1.0, 0.0, tilt), (0.0, tilt, math.pi - tilt)):
        radius = cone.radius - share * cone.taper
        piece = radius * arc / CAP
        for i in range(CAP):
            sine, along = sine_cosine(start + arc * ((i + 0.5) / CAP))
            for across in (sine, -sine):
                normal = along * dx - across * dy, along * dy + across * dx
                _write_point(points, count, cone, share, normal, piece)
                count += 1
    return count


@inlined
def _write_neighbours(bone, discs, neighbours):
    """Write which bones have a disc that meets this bone's. Return their number."""
    count = 0
    for b in range(discs.shape[0]):
        reach = discs[b, 2] + discs[bone, 2]
        off = (discs[b, 0] - discs[bone, 0]) ** 2 + (discs[b, 1] - discs[bone, 1]) ** 2
        if b != bone and off < reach * reach:
            neighbours[count] = b
            count += 1
    return count


@inlined
def hide(points, count, cone):
    """Mark as hidden which of the first `count` points a cone covers."""
    # Out of the loop: an array that is taken from a tuple changes its reference count,
    # which keeps the loop from vector registers.
    columns = points.columns
    rows = points.rows
    hidden = points.hidden
    for k in range(count):
        hidden[k] |= _nearer(columns[k], rows[k], cone, -COVERED)


@inlined
def _accumulate_points(points, count, contour, scale, products):
    """Add the squared distances of a bone's visible points from the mask's border.

    A point that is hidden, or outside the field, adds nothing.
    """
    for k in range(count):
        if points.hidden[k]:
            continue
        x = points.columns[k]
        y = points.rows[k]
        known, distance, slope_x, slope_y = field_distance(x, y, contour)
        if known:
            # contour (6)
            weight = points.lengths[k] / (1.0 + (distance / scale) ** 2)
            along = slope_x * points.normal_columns[k] + slope_y * points.normal_rows[k]
            slope = slope_x, slope_y, along  # contour (4)
            accumulate(products, points.shares[k], slope, distance, weight)


@inlined
def field_distance(x, y, contour):
    """Return whether the field covers a point, its distance there, and the slope (2,).

    The distance is from the mask's border, in pixels, and negative within the mask. It
    is interpolated bilinearly between the centres of four pixels.
    """
    known = False
    off = 0.0
    across = 0.0
    down = 0.0
    column = x - contour.corner[0] - 0.5
    row = y - contour.corner[1] - 0.5
    left = math.floor(column)
    top = math.floor(row)
    if 0 <= left < contour.size[1] - 1 and 0 <= top < contour.size[0] - 1:
        u = column - left
        v = row - top
        f00 = contour.field[top, left]
        f01 = contour.field[top, left + 1]
        f10 = contour.field[top + 1, left]
        f11 = contour.field[top + 1, left + 1]
        off = (f00 * (1.0 - u) + f01 * u) * (1.0 - v) + (f10 * (1.0 - u) + f11 * u) * v
        across = (f01 - f00) * (1.0 - v) + (f11 - f10) * v
        down = (f10 - f00) * (1.0 - u) + (f11 - f01) * u
        known = True
    return known, off, across, down
