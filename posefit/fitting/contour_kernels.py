"""Gauss-Newton on contours, compiled by numba.

The residuals are distances between the border of a drawn body and the border of a mask.
A step moves the body so that they shrink. docs/background/contour-fit.md derives the
method. Its equations are numbered, and comments such as `# contour (3)` refer to them.
In short:

- A bone is drawn as a tapered cone. Six numbers place it in the picture: two joints
  (u, v) and two radii. Each residual is a distance between the borders. It depends on
  the disc at one share of the bone, and through that share on the discs at both ends
  (1) to (4).
- The residuals of a bone are summed to a 6 x 6 Hessian and a gradient (5), with a
  weight that bounds outliers (6). Both consist of 24 sums of products, which are
  expanded once all residuals are added.
- A twist, velocity and rotation, moves a bone. The chain rule turns the Hessian and
  the gradient into a spatial Hessian and a spatial force over twists (7) to (9), as a
  rigid body has a spatial inertia.
- An angle turns all bones beyond its joint. Its derivatives need the sums over these
  bones. The composite-rigid-body algorithm forms them from the ends of the limbs to
  the root (10) to (13).
- A step of one frame solves the normal equations with a prior, by elimination (15),
  (16).

The callers check shapes.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit
from posefit.geometry.kernels import place_frames, sine_cosine
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.rasteriser import NEAR

NUMBERS = 3 + ANGLES  # numbers of a place and a pose
# a point of the border has two independent errors, with these standard deviations
BORDER_DEVIATION = 0.01  # metres
PIXEL_DEVIATION = 0.5  # pixels
# metres: a border of this length shares its error, and counts as one measurement
CORRELATION_LENGTH = 0.09
MIN_ROBUST_SCALE = 3.0  # pixels: larger distances count less
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
    step: float  # pixels of the border that a point represents
    # (n,) the bone nearest to each point in the step before, at first -1; each step
    # overwrites them
    owners: NDArray[np.int64]


class Contours(NamedTuple):
    """The borders of the masks of T frames, or a single border that all frames share.

    The fields are the same as in `MaskContours`.
    """

    fields: NDArray[np.float32]  # (T, h, w)
    corners: NDArray[np.int64]  # (T, 2)
    sizes: NDArray[np.int64]  # (T, 2)
    points: Array  # (n, 2) frame after frame
    starts: NDArray[np.int64]  # (T + 1,)
    step: float


class Views(NamedTuple):
    """The borders of one frame's masks in V views, and the cameras."""

    rotations: Array  # (V, 3, 3) camera_from_world
    translations: Array  # (V, 3)
    focals: Array  # (V, 2) pixels
    centres: Array  # (V, 2) pixels
    fields: NDArray[np.float32]  # (V, h, w)
    corners: NDArray[np.int64]  # (V, 2)
    sizes: NDArray[np.int64]  # (V, 2)
    points: Array  # (n, 2) view after view
    starts: NDArray[np.int64]  # (V + 1,)
    steps: Array  # (V,) pixels of the border that a point represents


class Pulls(NamedTuple):
    """Prior knowledge about n places and poses: a mean and a precision per number.

    A place and a pose have 69 numbers, of which m may change.
    """

    free: NDArray[np.int64]  # (m,) indices of the numbers that may change
    means: Array  # (n, m)
    precisions: Array  # (m,)


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


class Growth(NamedTuple):
    """Derivatives by F factors of the build, and the factors' normal equations.

    F may be 0.
    """

    joints: Array  # (F, 27, 3), or (T, F, 27, 3): derivatives of joints
    radii: Array  # (F, 26, 2): derivatives of radii
    # (1 + F, 1 + F): half the gradient in the first column, half the second derivatives
    # in the others
    squares: Array


class BoneSquares(NamedTuple):
    """Spatial Hessians and forces, halved, of the bone that ends in each joint.

    They are of one frame, or of T frames.
    """

    hessians: Array  # (27, 6, 6), or (T, 27, 6, 6)
    # (27, 6, 1 + F), or (T, 27, 6, 1 + F): the gradient, and its derivatives by the F
    # factors
    forces: Array


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

    They are 24 products of the residual and its derivatives. `slope` has derivatives by
    the column, the row and the radius of the disc at a `share` of the bone, from 0 at
    its start to 1 at its end. The derivatives by the first disc are `slope` times
    1 - share. The derivatives by the last disc are `slope` times share.
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
                        pair = low * (5 - low) // 2 + max(i, j)
                        product = products[bone, 6 * (end + other) + pair]
                        column = NUMBERS_OF_END[other, j]
                        hessians[bone, row, column] += product


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
    points = empty_points(cones, contour.step)
    for b in range(count):
        # a bone with one disc covered by the other has no sides, and gets no points
        cone = cone_of(cones, b)
        if cone.length > abs(cone.taper) + TINY:
            on_sides = write_side_points(cone, contour.step, points)
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
        weight = contour.step / (1.0 + (distance / scale) ** 2)  # contour (6)
        slope = -nx, -ny, -1.0  # contour (2)
        accumulate(products[bone], share, slope, distance, weight)


@inlined
def side_pieces(length, step):
    """Return the number of pieces that each side of a bone is cut into, two or more."""
    return max(int(length / (2.0 * step)) + 1, 2)


@inlined
def empty_points(cones, step):
    """Return `Points` with room for the points of the longest bone."""
    longest = 0.0
    for b in range(cones.shape[0]):
        longest = max(longest, cone_of(cones, b).length)
    room = 2 * (side_pieces(longest, step) + 1) + 4 * CAP
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
def write_side_points(cone, step, points):
    """Write points on the two sides of a bone's border. Return their number.

    The sides are the segments that touch both discs.
    """
    length = cone.length
    dx = cone.axis_x
    dy = cone.axis_y
    cosine = cone.taper / length
    sine = math.sqrt(1.0 - cosine * cosine)
    pieces = side_pieces(length, step)
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

    The distance is from the mask's border, in pixels, and negative within the mask.
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


@inlined
def _project_joints(camera, frames, centres, per_metre, moves):
    """Write the joints' pixels (27, 2), the pixels per metre there (27,), and `moves`.

    `moves` (27, 3, 3) has the derivatives by a joint's place: of its column, of its
    row, and of the pixels per metre.
    """
    rotation, translation, focal, centre = camera
    for j in range(frames.shape[0]):
        x = frames[j, 3, 0]
        y = frames[j, 3, 1]
        z = frames[j, 3, 2]
        a = _camera_coordinate(0, rotation, translation, x, y, z)
        b = _camera_coordinate(1, rotation, translation, x, y, z)
        # joints behind the camera count as right in front of it
        c = max(_camera_coordinate(2, rotation, translation, x, y, z), NEAR)
        centres[j, 0] = a / c * focal[0] + centre[0]
        centres[j, 1] = b / c * focal[1] + centre[1]
        per_metre[j] = math.sqrt(focal[0] * focal[1]) / c
        for i in range(3):  # contour (7)
            moves[j, 0, i] = focal[0] / c * (rotation[0, i] - a / c * rotation[2, i])
            moves[j, 1, i] = focal[1] / c * (rotation[1, i] - b / c * rotation[2, i])
            moves[j, 2, i] = -per_metre[j] / c * rotation[2, i]


@inlined
def _camera_coordinate(i, rotation, translation, x, y, z):
    """Return the i-th coordinate of a point in the camera's frame, in metres."""
    return rotation[i, 0] * x + rotation[i, 1] * y + rotation[i, 2] * z + translation[i]


@inlined
def _write_twist_rows(b, parent, radii, frames, moves, rows):
    """Write the derivatives (6, 6) of a bone's six numbers by a twist. contour (8).

    A twist is a velocity, then a rotation.
    """
    for end in range(2):
        joint = parent if end == 0 else b + 1
        x = frames[joint, 3, 0]
        y = frames[joint, 3, 1]
        z = frames[joint, 3, 2]
        for kind in range(3):
            # a radius in pixels is one in metres times the pixels per metre
            factor = radii[b, end] if kind == 2 else 1.0
            mx = factor * moves[joint, kind, 0]
            my = factor * moves[joint, kind, 1]
            mz = factor * moves[joint, kind, 2]
            row = rows[NUMBERS_OF_END[end, kind]]
            row[0] = mx
            row[1] = my
            row[2] = mz
            row[3] = y * mz - z * my
            row[4] = z * mx - x * mz
            row[5] = x * my - y * mx


@inlined
def _accumulate_twists(rows, drawn, worth, work, hessian, force):
    """Add a bone's Hessian and gradient to its spatial ones, over twists. contour (9).

    `drawn` has the Hessian and the gradient by the bone's six numbers.
    """
    block, gradient = drawn
    for i in range(6):
        for j in range(6):
            work[i, j] = 0.0
        for k in range(6):
            for j in range(6):
                work[i, j] += block[i, k] * rows[k, j]
    for i in range(6):
        total = 0.0
        for k in range(6):
            total += rows[k, i] * gradient[k]
        force[i, 0] += worth * total
        for j in range(6):
            total = 0.0
            for k in range(6):
                total += rows[k, i] * work[k, j]
            hessian[i, j] += worth * total


@jit
def add_view(parents, radii, camera, frames, contour, reach, grown, sums):
    """Add the squares of one view to the `sums` of the bones.

    `frames` (27, 4, 3) are the joints' coordinate frames. Distances beyond `reach`
    metres count less.
    """
    hessians, forces = sums
    count = parents.size
    centres = np.empty((count + 1, 2))
    per_metre = np.empty(count + 1)
    moves = np.empty((count + 1, 3, 3))
    _project_joints(camera, frames, centres, per_metre, moves)
    drawn_radii = np.empty((count, 2))
    for b in range(count):
        drawn_radii[b, 0] = per_metre[parents[b]] * radii[b, 0]
        drawn_radii[b, 1] = per_metre[b + 1] * radii[b, 1]
    root_per_metre = per_metre[0]
    scale = max(reach * root_per_metre, MIN_ROBUST_SCALE)
    blocks = np.zeros((count, 6, 6))
    gradients = np.zeros((count, 6))
    accumulate_borders(parents, centres, drawn_radii, contour, scale, blocks, gradients)
    variance = BORDER_DEVIATION**2 + (PIXEL_DEVIATION / root_per_metre) ** 2
    worth = 1.0 / (root_per_metre**3 * CORRELATION_LENGTH * variance)  # contour (6)
    rows = np.empty((6, 6))
    work = np.empty((6, 6))
    for b in range(count):
        drawn = blocks[b], gradients[b]
        _write_twist_rows(b, parents[b], radii, frames, moves, rows)
        _accumulate_twists(rows, drawn, worth, work, hessians[b + 1], forces[b + 1])
        if len(grown.joints):
            _add_growth(
                b, parents[b], rows, per_metre, drawn, worth, grown, forces[b + 1]
            )


@jit
def _add_growth(b, parent, rows, per_metre, drawn, worth, grown, forces):
    """Add bone b's normal equations by F factors of the build. contour (14).

    Column 0 is for the residuals, and column 1 + f for factor f: with the gradient
    as its product, the same sums give gradients and second derivatives.

    Args:
        b: The bone.
        parent: The joint where it starts.
        rows: Derivatives (6, 6) of the bone's numbers by a twist, from (8).
        per_metre: The pixels per metre at each joint.
        drawn: The Hessian and the gradient by the bone's numbers, from (5).
        worth: The weight of the view's residuals, from (6).
        grown: The derivatives by the factors; its `squares` are incremented.
        forces: The spatial forces (6, 1 + F) of the bone, which are incremented.
    """
    block, gradient = drawn
    factors = len(grown.joints)
    # derivatives of the bone's numbers by each factor, and `block` times these
    changes = np.zeros((6, 1 + factors))
    changed = np.zeros((6, 1 + factors))
    for end in range(2):
        joint = parent if end == 0 else b + 1
        for kind in range(3):
            k = NUMBERS_OF_END[end, kind]
            for f in range(factors):
                for i in range(3):
                    changes[k, 1 + f] += rows[k, i] * grown.joints[f, joint, i]
                if kind == 2:
                    changes[k, 1 + f] += per_metre[joint] * grown.radii[f, b, end]
    for k in range(6):
        changed[k, 0] = worth * gradient[k]
        for i in range(6):
            for f in range(factors):
                changed[k, 1 + f] += worth * block[k, i] * changes[i, 1 + f]
    for k in range(6):
        for f in range(1 + factors):
            for g in range(1 + factors):
                grown.squares[f, g] += changes[k, f] * changed[k, g]
            for i in range(6 if f else 0):
                forces[i, f] += rows[k, i] * changed[k, f]


@jit
def write_screws(chain, frames, sines, cosines, screws):
    """Write the twists (69, 6) of the place's axes and of the angles. contour (10).

    A twist is a velocity, then a rotation.
    """
    screws[:] = 0.0
    root = frames[0, 3]
    axes = np.empty((3, 3))
    # yaw turns about the world's vertical, pitch about an axis that yaw has turned, and
    # roll about an axis of the body
    axes[0, 0] = 0.0
    axes[0, 1] = 1.0
    axes[0, 2] = 0.0
    axes[1, 0] = cosines[0]
    axes[1, 1] = 0.0
    axes[1, 2] = -sines[0]
    for i in range(3):
        axes[2, i] = frames[0, 2, i]
    for k in range(3):
        screws[k, k] = 1.0
        _screw(screws[3 + k], axes[k], root)
    for b in range(chain.parents.size):
        a = chain.angles[b]
        if a < 0:
            continue
        pivot = frames[chain.parents[b], 3]
        frame = frames[b + 1]
        for i in range(3):
            u = frame[0, i]
            v = frame[1, i]
            w = frame[2, i]
            axes[0, i] = u
            axes[1, i] = v * cosines[a] - w * sines[a]
            before = w * cosines[a] + v * sines[a]
            axes[2, i] = before * cosines[a + 1] - u * sines[a + 1]
        for k in range(3):
            _screw(screws[3 + a + k], axes[k], pivot)


@inlined
def _screw(screw, axis, pivot):
    """Write the twist of a turn about an axis through a point.

    It is the velocity of the world's origin, and the axis.
    """
    screw[0] = pivot[1] * axis[2] - pivot[2] * axis[1]
    screw[1] = pivot[2] * axis[0] - pivot[0] * axis[2]
    screw[2] = pivot[0] * axis[1] - pivot[1] * axis[0]
    screw[3] = axis[0]
    screw[4] = axis[1]
    screw[5] = axis[2]


@jit
def composite_hessian(chain, screws, hessians, forces, matrix, gradients):
    """Write the derivatives by a place and a pose, from the bones' Hessians and forces.

    This is the composite-rigid-body algorithm, with spatial Hessians in place of
    spatial inertias.

    Args:
        chain: The skeleton's.
        screws: Twists (69, 6) of the place and the pose, 0 for a number that is held.
        hessians: Spatial Hessians of the bones. Each is overwritten with the sum over
            all bones that move with the joint.
        forces: Spatial forces of the bones, overwritten in the same way.
        matrix: Second derivatives (69, 69); only the lower half is written.
        gradients: The gradient and its derivatives by factors (69, 1 + F).
    """
    parents = chain.parents
    _sum_towards_root(parents, hessians, forces)
    matrix[:] = 0.0
    gradients[:] = 0.0
    force = np.empty(6)
    for joint in range(parents.size + 1):
        first, count = _numbers(chain, joint)
        for a in range(first, first + count):
            if not screws[a].any():
                continue
            for i in range(6):
                total = 0.0
                for j in range(6):
                    total += hessians[joint, i, j] * screws[a, j]
                force[i] = total
                # contour (12)
                for f in range(gradients.shape[1]):
                    gradients[a, f] += screws[a, i] * forces[joint, i, f]
            # the numbers of the joint and of all joints between it and the root
            other = joint
            while True:
                start, many = _numbers(chain, other)
                for c in range(start, min(start + many, a + 1)):
                    total = 0.0
                    for i in range(6):
                        total += screws[c, i] * force[i]
                    matrix[a, c] = total  # contour (13)
                if other == 0:
                    break
                other = parents[other - 1]


@inlined
def _sum_towards_root(parents, hessians, forces):
    """Add what moves with each joint to its parent, limbs' ends first. contour (11)."""
    for b in range(parents.size - 1, -1, -1):
        p = parents[b]
        for i in range(6):
            for j in range(6):
                hessians[p, i, j] += hessians[b + 1, i, j]
            for f in range(forces.shape[2]):
                forces[p, i, f] += forces[b + 1, i, f]


@inlined
def _numbers(chain, joint):
    """Return the first of the numbers that turn or move a joint, and their count."""
    if joint == 0:
        return 0, 6
    a = chain.angles[joint - 1]
    return (3 + a, 3) if a >= 0 else (0, 0)


@jit
def add_frames(parents, radii, camera, frames, contours, reach, grown, sums):
    """Add the squares of one view of T frames to the `sums` of the bones.

    `frames` (T, 27, 4, 3) are the joints' coordinate frames. See `add_view`.
    """
    starts = contours.starts
    for i in range(len(frames)):
        k = min(i, len(starts) - 2)
        if starts[k] < starts[k + 1]:
            points = contours.points[starts[k] : starts[k + 1]]
            contour = Contour(
                contours.fields[k],
                contours.corners[k],
                contours.sizes[k],
                points,
                contours.step,
                np.full(len(points), -1),
            )
            grows = Growth(grown.joints[i], grown.radii, grown.squares)
            bones = BoneSquares(sums.hessians[i], sums.forces[i])
            add_view(parents, radii, camera, frames[i], contour, reach, grows, bones)


@jit
def fit_poses(chain, radii, views, prior, reaches, max_turn, poses, places):
    """Move poses (n, 66) and places (n, 3) to the contours of one frame.

    One Gauss-Newton step with a `prior` is made for each of `reaches`, in metres. In a
    step no angle turns by more than `max_turn`, in radians.
    """
    free = prior.free
    count = poses.shape[0]
    joints = chain.parents.size + 1
    frames = np.empty((count, joints, 4, 3))
    sines = np.empty((count, ANGLES))
    cosines = np.empty((count, ANGLES))
    owners = np.full((count, len(views.points)), -1)
    bones = BoneSquares(np.empty((joints, 6, 6)), np.empty((joints, 6, 1)))
    all_screws = np.empty((NUMBERS, 6))
    screws = np.zeros((NUMBERS, 6))
    hessian = np.empty((NUMBERS, NUMBERS))
    gradient = np.empty((NUMBERS, 1))
    matrix = np.empty((free.size, free.size))
    step = np.empty(free.size)
    for reach in reaches:
        place_frames(chain, poses, places, sines, cosines, frames)
        for i in range(count):
            _add_views(chain.parents, radii, views, frames[i], owners[i], reach, bones)
            write_screws(chain, frames[i], sines[i], cosines[i], all_screws)
            # the twists of numbers that are held remain 0, so that they add nothing
            for a in free:
                screws[a] = all_screws[a]
            composite_hessian(
                chain, screws, bones.hessians, bones.forces, hessian, gradient
            )
            numbers = places[i], poses[i]
            derivatives = hessian, gradient
            _write_equations(numbers, prior, prior.means[i], derivatives, matrix, step)
            solve_symmetric(matrix, step)
            _subtract(numbers, free, step, max_turn)


@inlined
def _add_views(parents, radii, views, frames, owners, reach, bones):
    """Overwrite the squares of the bones with the sums over one frame's views.

    `owners` (n,) has the nearest bone of each point, view after view. See `add_view`.
    """
    bones.hessians[:] = 0.0
    bones.forces[:] = 0.0
    joints = parents.size + 1
    grown = Growth(
        np.empty((0, joints, 3)), np.empty((0, parents.size, 2)), np.zeros((1, 1))
    )
    for v in range(len(views.steps)):
        first = views.starts[v]
        stop = views.starts[v + 1]
        if first < stop:
            camera = (
                views.rotations[v],
                views.translations[v],
                views.focals[v],
                views.centres[v],
            )
            contour = Contour(
                views.fields[v],
                views.corners[v],
                views.sizes[v],
                views.points[first:stop],
                views.steps[v],
                owners[first:stop],
            )
            add_view(parents, radii, camera, frames, contour, reach, grown, bones)


@inlined
def _write_equations(numbers, prior, means, derivatives, matrix, right):
    """Write the normal equations of a step, `matrix` and `right`. contour (15).

    Of the matrix (m, m) only the lower half is written. The right side is (m,).
    """
    place, pose = numbers
    hessian, gradient = derivatives
    free = prior.free
    for a in range(free.size):
        number = free[a]
        value = place[number] if number < 3 else pose[number - 3]
        precision = prior.precisions[a]
        right[a] = gradient[number, 0] + precision * (value - means[a])
        for b in range(a + 1):
            matrix[a, b] = hessian[number, free[b]]
        matrix[a, a] += precision


@inlined
def _subtract(numbers, free, step, max_turn):
    """Subtract a step (m,) from the free numbers of a place and a pose.

    No angle changes by more than `max_turn`.
    """
    place, pose = numbers
    for a in range(free.size):
        number = free[a]
        if number < 3:
            place[number] -= step[a]
        else:
            pose[number - 3] -= min(max(step[a], -max_turn), max_turn)


@jit
def solve_symmetric(matrix, right):
    """Solve a positive definite system by elimination, in place. contour (16).

    Only the lower half of the matrix (m, m) is read. The matrix is overwritten, and the
    right side (m,) becomes the solution.

    Numbers are eliminated from the last to the first, that is from the ends of the
    limbs inwards. An angle shares second derivatives only with the numbers between it
    and the root, and in this order all other zeros remain zero (Featherstone, Rigid
    body dynamics algorithms, 2008, section 6.5).
    """
    m = right.size
    for k in range(m - 1, -1, -1):
        for i in range(k):
            if matrix[k, i] == 0.0:
                continue
            factor = matrix[k, i] / matrix[k, k]
            for j in range(i + 1):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(m):
        total = right[k]
        for j in range(k):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]


@jit
def add_all_bones(chain, placed, bones, free, out):
    """Write the results of `composite_hessian` for T frames.

    Args:
        chain: The skeleton's.
        placed: Frames, sines and cosines from `place_frames`.
        bones: Spatial Hessians and forces, which are overwritten.
        free: Indices (m,) of the numbers of a frame that may change.
        out: The arrays to write. Second derivatives (T, m, m), and gradients with their
            derivatives by factors (T, m, 1 + F).
    """
    frames, sines, cosines = placed
    hessians, forces = bones
    matrices, gradients = out
    all_screws = np.empty((NUMBERS, 6))
    screws = np.zeros((NUMBERS, 6))
    matrix = np.empty((NUMBERS, NUMBERS))
    gradient = np.empty((NUMBERS, gradients.shape[2]))
    for k in range(len(frames)):
        write_screws(chain, frames[k], sines[k], cosines[k], all_screws)
        for a in free:
            screws[a] = all_screws[a]
        composite_hessian(chain, screws, hessians[k], forces[k], matrix, gradient)
        for i in range(len(free)):
            gradients[k, i] = gradient[free[i]]
            for j in range(i + 1):
                matrices[k, i, j] = matrices[k, j, i] = matrix[free[i], free[j]]
