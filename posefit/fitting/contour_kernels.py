"""How far the border of a drawn body is from that of a mask, and what would bring them together, in numba.

The border of a drawn body depends on two joints and two radii of each bone. What moves them is a twist: an angle
turns everything beyond its joint. So the squares of a bone's distances are a 6 x 6 matrix over twists, and an angle
meets the sum of those of the bones that it moves. Shapes are checked by the callers.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, inlined, jit
from posefit.geometry.kernels import place_frames
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.rasteriser import NEAR

NUMBERS = 3 + ANGLES  # of a place and a pose
# metres that a point of the border may be off: standard deviation, as the next
BORDER_DEVIATION = 0.01
PIXEL_DEVIATION = 0.5  # pixels, besides
# metres of the border that are off together, so that they are one measurement
CORRELATION_LENGTH = 0.09
MIN_ROBUST_SCALE = 3.0  # pixels: what is farther off counts less
CAP = 2  # points of a quarter, about, of the disc at a bone's end
# pixels within another bone from which on a point of a bone's border is hidden
COVERED = 0.25
TINY = 1e-9


class Contour(NamedTuple):
    """The border of the mask of one frame."""

    field: NDArray[np.float32]  # (h, w) pixels outside the mask, below 0 within
    corner: NDArray[np.int64]  # (2,) column and row of the field's first pixel
    size: NDArray[np.int64]  # (2,) rows and columns of the field
    points: Array  # (n, 2) pixels of the border
    step: float  # pixels of the border that a point stands for


class Contours(NamedTuple):
    """The borders of the masks of T frames, or one that all frames share, as `MaskContours` has them."""

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
    steps: Array  # (V,) pixels of the border that a point stands for


class Growth(NamedTuple):
    """What changes with F factors of the build, and the squares by them; F may be 0."""

    joints: Array  # (F, 27, 3), or (T, F, 27, 3): how joints change
    radii: Array  # (F, 26, 2): how radii change
    # (1 + F, 1 + F): in its first column half the gradient, in the rest half the second
    # derivatives
    squares: Array


class BoneSquares(NamedTuple):
    """Half the Hessians of each joint's bone, or of T frames', and forces, over twists."""

    hessians: Array  # (27, 6, 6), or (T, 27, 6, 6)
    # (27, 6, 1 + F), or (T, 27, 6, 1 + F): half the gradient, and half the derivatives
    # by F factors
    forces: Array


@jit
def write_cones(parents, centres, radii, cones, discs):
    """Write what distances from bones need (B, 8), and a disc about each bone (B, 3): its middle and radius.

    A cone is its first point and radius, by how much the last point is off it and the last radius is less, its length,
    and that of its sides; 0 where one of its discs covers the other.
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
        side = math.sqrt(square - dr * dr) if square > dr * dr + TINY else 0.0
        for i, value in enumerate((x, y, r0, dx, dy, dr, length, side)):
            cones[b, i] = value
        discs[b, 0], discs[b, 1], discs[b, 2] = (
            x + 0.5 * dx,
            y + 0.5 * dy,
            0.5 * length + max(r0, r1),
        )


@inlined
def cone_distance(x, y, cones, bone):
    """Return how far a point is outside a cone, below 0 within, the share of the bone it is at, and its normal."""
    x0 = cones[bone, 0]
    y0 = cones[bone, 1]
    r0 = cones[bone, 2]
    dx = cones[bone, 3]
    dy = cones[bone, 4]
    dr = cones[bone, 5]
    length = cones[bone, 6]
    side = cones[bone, 7]
    if side == 0.0:
        share = 0.0 if dr >= 0.0 else 1.0
    else:
        along = ((x - x0) * dx + (y - y0) * dy) / length
        across = abs((y - y0) * dx - (x - x0) * dy) / length
        share = min(max((along - across * dr / side) / length, 0.0), 1.0)
    ox = x - (x0 + share * dx)
    oy = y - (y0 + share * dy)
    off = math.sqrt(ox * ox + oy * oy)
    return off - (r0 - share * dr), share, ox / max(off, TINY), oy / max(off, TINY)


@inlined
def accumulate(pulls, bone, share, across, down, radius_change, off, weight):
    """Add the square of one distance, which moves by (across, down) with its axis and by `radius_change`.

    What moves a point of a bone is a product: of what moves either end, and of how near the point is to it. So the
    squares are products too, see `expand`.
    """
    rest = 1.0 - share
    near = rest * rest
    both = rest * share
    far = share * share
    wa = weight * across
    wd = weight * down
    wr = weight * radius_change
    aa = wa * across
    ad = wa * down
    ar = wa * radius_change
    dd = wd * down
    dr = wd * radius_change
    rr = wr * radius_change
    pulls[bone, 0] += aa * near
    pulls[bone, 1] += ad * near
    pulls[bone, 2] += ar * near
    pulls[bone, 3] += dd * near
    pulls[bone, 4] += dr * near
    pulls[bone, 5] += rr * near
    pulls[bone, 6] += aa * both
    pulls[bone, 7] += ad * both
    pulls[bone, 8] += ar * both
    pulls[bone, 9] += dd * both
    pulls[bone, 10] += dr * both
    pulls[bone, 11] += rr * both
    pulls[bone, 12] += aa * far
    pulls[bone, 13] += ad * far
    pulls[bone, 14] += ar * far
    pulls[bone, 15] += dd * far
    pulls[bone, 16] += dr * far
    pulls[bone, 17] += rr * far
    pulls[bone, 18] += wa * off * rest
    pulls[bone, 19] += wd * off * rest
    pulls[bone, 20] += wr * off * rest
    pulls[bone, 21] += wa * off * share
    pulls[bone, 22] += wd * off * share
    pulls[bone, 23] += wr * off * share


@inlined
def expand(pulls, blocks, gradients):
    """Add what `accumulate` summed up to the blocks (B, 6, 6) and gradients (B, 6) of bones."""
    places = np.empty((2, 3), np.int64)
    for end in range(2):
        places[end, 0] = 2 * end
        places[end, 1] = 2 * end + 1
        places[end, 2] = 4 + end
    for bone in range(pulls.shape[0]):
        for end in range(2):
            for i in range(3):
                row = places[end, i]
                gradients[bone, row] += pulls[bone, 18 + 3 * end + i]
                for other in range(2):
                    for j in range(3):
                        low = min(i, j)
                        pair = low * (5 - low) // 2 + max(i, j)
                        column = places[other, j]
                        blocks[bone, row, column] += pulls[
                            bone, 6 * (end + other) + pair
                        ]


@inlined
def _nearest_bone(x, y, first, cones, discs):
    """Return the bone whose border is nearest to a point; begin with `first`."""
    least = cone_distance(x, y, cones, first)[0]
    bone = first
    for b in range(discs.shape[0]):
        reach = least + discs[b, 2]
        dx = x - discs[b, 0]
        dy = y - discs[b, 1]
        if b != first and dx * dx + dy * dy < reach * reach:
            off = cone_distance(x, y, cones, b)[0]
            if off < least:
                least = off
                bone = b
    return bone


@inlined
def _write_neighbours(bone, discs, neighbours):
    """Write the other bones whose discs meet that of a bone, and return how many they are."""
    count = 0
    for b in range(discs.shape[0]):
        reach = discs[b, 2] + discs[bone, 2]
        off = (discs[b, 0] - discs[bone, 0]) ** 2 + (discs[b, 1] - discs[bone, 1]) ** 2
        if b != bone and off < reach * reach:
            neighbours[count] = b
            count += 1
    return count


@inlined
def visible(x, y, neighbours, count, cones, discs):
    """Return whether a point of a bone's border is within none of its neighbours."""
    shown = True
    for k in range(count):
        b = neighbours[k]
        dx = x - discs[b, 0]
        dy = y - discs[b, 1]
        near = dx * dx + dy * dy < discs[b, 2] * discs[b, 2]
        if near and cone_distance(x, y, cones, b)[0] < -COVERED:
            shown = False
            break
    return shown


@jit
def add_pulls(parents, centres, radii, contour, scale, owners, blocks, gradients):
    """Add the squares of the distances of the mask's border from the body's, and of the body's from the mask's.

    Those of a bone go to its half of a second derivative, 6 x 6, and half of a gradient: by the column and row of its
    two joints, and by both radii. `owners` (n,) are the bones that were nearest to the points of the mask's border a
    step before, -1 where none was, and then those that are now: a search that begins with the right one is short.
    """
    cones = np.empty((parents.size, 8))
    discs = np.empty((parents.size, 3))
    write_cones(parents, centres, radii, cones, discs)
    pulls = np.zeros((parents.size, 24))
    _add_mask_border(contour, scale, cones, discs, owners, pulls)
    neighbours = np.empty(parents.size, np.int64)
    for bone in range(parents.size):
        # else one of its discs covers the other
        if cones[bone, 6] > abs(cones[bone, 5]) + TINY:
            count = _write_neighbours(bone, discs, neighbours)
            others = neighbours, count, cones, discs
            side_points(bone, contour, scale, others, pulls)
            cap_points(bone, contour, scale, others, pulls)
    expand(pulls, blocks, gradients)


@inlined
def _add_mask_border(contour, scale, cones, discs, owners, pulls):
    """Add the squares of the distances of the mask's border from the nearest bones."""
    points = contour.points
    bone = 0
    for i in range(points.shape[0]):
        x = points[i, 0]
        y = points[i, 1]
        bone = _nearest_bone(x, y, owners[i] if owners[i] >= 0 else bone, cones, discs)
        owners[i] = bone
        off, share, nx, ny = cone_distance(x, y, cones, bone)
        weight = contour.step / (1.0 + (off / scale) ** 2)
        accumulate(pulls, bone, share, -nx, -ny, -1.0, off, weight)


@inlined
def _add_point(x, y, nx, ny, share, worth, bone, contour, scale, others, pulls):
    """Add the square of the distance from the mask's border of a point of a bone's border with a normal."""
    neighbours, count, cones, discs = others
    known, off, across, down = _mask_distance(x, y, contour)
    if known and visible(x, y, neighbours, count, cones, discs):
        weight = worth / (1.0 + (off / scale) ** 2)
        turned = across * nx + down * ny
        accumulate(pulls, bone, share, across, down, turned, off, weight)


@inlined
def side_points(bone, contour, scale, others, pulls):
    """Add the squares of the distances of both straight sides of a bone's border, where they are visible."""
    cones = others[2]
    length = cones[bone, 6]
    dx = cones[bone, 3] / length
    dy = cones[bone, 4] / length
    cosine = cones[bone, 5] / length
    sine = math.sqrt(1.0 - cosine * cosine)
    parts = max(int(length / (2.0 * contour.step)) + 1, 2)
    for i in range(parts + 1):
        share = i / parts
        worth = length * sine / parts * (0.5 if i in (0, parts) else 1.0)
        radius = cones[bone, 2] - share * cones[bone, 5]
        x = cones[bone, 0] + share * cones[bone, 3]
        y = cones[bone, 1] + share * cones[bone, 4]
        for k in range(2):
            aside = sine if k == 0 else -sine
            nx = cosine * dx - aside * dy
            ny = cosine * dy + aside * dx
            _add_point(
                x + radius * nx,
                y + radius * ny,
                nx,
                ny,
                share,
                worth,
                bone,
                contour,
                scale,
                others,
                pulls,
            )


@inlined
def cap_points(bone, contour, scale, others, pulls):
    """Add the squares of the distances of the round ends of a bone's border, where they are visible."""
    cones = others[2]
    length = cones[bone, 6]
    dx = cones[bone, 3] / length
    dy = cones[bone, 4] / length
    # from the axis to the normal of the cone's side
    tilt = math.acos(cones[bone, 5] / length)
    for k in range(2 * CAP):
        # the last end first, then the first one
        share = 1.0 if k < CAP else 0.0
        part = (k % CAP + 0.5) / CAP
        angle = tilt * part if share > 0.0 else tilt + (math.pi - tilt) * part
        around = tilt if share > 0.0 else math.pi - tilt
        radius = cones[bone, 2] - share * cones[bone, 5]
        x = cones[bone, 0] + share * cones[bone, 3]
        y = cones[bone, 1] + share * cones[bone, 4]
        along = math.cos(angle)
        sine = math.sin(angle)
        for side in range(2):
            aside = sine if side == 0 else -sine
            nx = along * dx - aside * dy
            ny = along * dy + aside * dx
            _add_point(
                x + radius * nx,
                y + radius * ny,
                nx,
                ny,
                share,
                radius * around / CAP,
                bone,
                contour,
                scale,
                others,
                pulls,
            )


@inlined
def _mask_distance(x, y, contour):
    """Return whether a point lies in the field, how far it is from the mask's border there, and the slope of that."""
    known = False
    off = 0.0
    across = 0.0
    down = 0.0
    field = contour.field
    column = x - contour.corner[0] - 0.5
    row = y - contour.corner[1] - 0.5
    left = math.floor(column)
    top = math.floor(row)
    if 0 <= left < contour.size[1] - 1 and 0 <= top < contour.size[0] - 1:
        u = column - left
        v = row - top
        f00 = field[top, left]
        f01 = field[top, left + 1]
        f10 = field[top + 1, left]
        f11 = field[top + 1, left + 1]
        off = (f00 * (1.0 - u) + f01 * u) * (1.0 - v) + (f10 * (1.0 - u) + f11 * u) * v
        across = (f01 - f00) * (1.0 - v) + (f11 - f10) * v
        down = (f10 - f00) * (1.0 - u) + (f11 - f01) * u
        known = True
    return known, off, across, down


@jit
def add_view(parents, radii, camera, frames, contour, reach, grown, sums):
    """Add the squares of one view to those of the bones, `sums`. `frames` (27, 4, 3) are of the joints.

    A distance counts less beyond `reach` metres.
    """
    owners = np.full(len(contour.points), -1)
    _add_view(parents, radii, camera, frames, contour, reach, owners, grown, sums)


@inlined
def _add_view(parents, radii, camera, frames, contour, reach, owners, grown, sums):
    """Add what `add_view` does; `owners` are those of `add_pulls`."""
    rotation, translation, focal, centre = camera
    hessians, forces = sums
    bones = parents.size
    centres = np.empty((bones + 1, 2))
    depth = np.empty(bones + 1)
    wide = np.empty((bones, 2))
    # of each joint: how its pixel and its size change with its place
    moves = np.empty((bones + 1, 3, 3))
    for j in range(bones + 1):
        x = frames[j, 3, 0]
        y = frames[j, 3, 1]
        z = frames[j, 3, 2]
        a = (
            rotation[0, 0] * x
            + rotation[0, 1] * y
            + rotation[0, 2] * z
            + translation[0]
        )
        b = (
            rotation[1, 0] * x
            + rotation[1, 1] * y
            + rotation[1, 2] * z
            + translation[1]
        )
        c = max(
            rotation[2, 0] * x
            + rotation[2, 1] * y
            + rotation[2, 2] * z
            + translation[2],
            NEAR,
        )
        centres[j, 0], centres[j, 1] = (
            a / c * focal[0] + centre[0],
            b / c * focal[1] + centre[1],
        )
        depth[j] = math.sqrt(focal[0] * focal[1]) / c
        for i in range(3):
            moves[j, 0, i] = focal[0] / c * (rotation[0, i] - a / c * rotation[2, i])
            moves[j, 1, i] = focal[1] / c * (rotation[1, i] - b / c * rotation[2, i])
            moves[j, 2, i] = -depth[j] / c * rotation[2, i]
    metres = depth[0]  # pixels of one, where the root is
    for b in range(bones):
        wide[b, 0], wide[b, 1] = (
            depth[parents[b]] * radii[b, 0],
            depth[b + 1] * radii[b, 1],
        )
    blocks = np.zeros((bones, 6, 6))
    gradients = np.zeros((bones, 6))
    add_pulls(
        parents,
        centres,
        wide,
        contour,
        max(reach * metres, MIN_ROBUST_SCALE),
        owners,
        blocks,
        gradients,
    )
    deviation = BORDER_DEVIATION**2 + (PIXEL_DEVIATION / metres) ** 2
    worth = 1.0 / (metres**3 * CORRELATION_LENGTH * deviation)
    rows = np.empty((6, 6))
    turned = np.empty((6, 6))
    for b in range(bones):
        p = parents[b]
        # how each of the six numbers changes with a twist: velocity, then rotation
        for k in range(6):
            j = p if k in (0, 1, 4) else b + 1
            size = radii[b, 0] if k == 4 else radii[b, 1]
            which = k % 2 if k < 4 else 2
            factor = 1.0 if k < 4 else size
            mx = factor * moves[j, which, 0]
            my = factor * moves[j, which, 1]
            mz = factor * moves[j, which, 2]
            x = frames[j, 3, 0]
            y = frames[j, 3, 1]
            z = frames[j, 3, 2]
            rows[k, 0], rows[k, 1], rows[k, 2] = mx, my, mz
            rows[k, 3], rows[k, 4], rows[k, 5] = (
                y * mz - z * my,
                z * mx - x * mz,
                x * my - y * mx,
            )
        for i in range(6):
            for j in range(6):
                turned[i, j] = 0.0
            for k in range(6):
                for j in range(6):
                    turned[i, j] += blocks[b, i, k] * rows[k, j]
        for i in range(6):
            total = 0.0
            for k in range(6):
                total += rows[k, i] * gradients[b, k]
            forces[b + 1, i, 0] += worth * total
            for j in range(6):
                total = 0.0
                for k in range(6):
                    total += rows[k, i] * turned[k, j]
                hessians[b + 1, i, j] += worth * total
        if len(grown.joints):
            _add_growth(
                b,
                p,
                rows,
                depth,
                (blocks[b], gradients[b]),
                worth,
                grown,
                forces[b + 1],
            )


@jit
def _add_growth(b, p, rows, depth, square, worth, grown, forces):
    """Add what bone b, from joint p, has to do with factors of the build, see `add_view`."""
    block, gradient = square
    factors = len(grown.joints)
    changes = np.zeros((6, 1 + factors))
    changed = np.zeros((6, 1 + factors))
    for k in range(6):
        j = p if k in (0, 1, 4) else b + 1
        for f in range(factors):
            for i in range(3):
                changes[k, 1 + f] += rows[k, i] * grown.joints[f, j, i]
            if k > 3:
                changes[k, 1 + f] += depth[j] * grown.radii[f, b, k - 4]
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
    """Write the twist (69, 6) of the place's axes, velocity then rotation, and of each angle."""
    screws[:] = 0.0
    root = frames[0, 3]
    axes = np.empty((3, 3))
    axes[0, 0], axes[0, 1], axes[0, 2] = 0.0, 1.0, 0.0
    axes[1, 0], axes[1, 1], axes[1, 2] = cosines[0], 0.0, -sines[0]
    axes[2, 0], axes[2, 1], axes[2, 2] = (
        frames[0, 2, 0],
        frames[0, 2, 1],
        frames[0, 2, 2],
    )
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
    screw[0] = pivot[1] * axis[2] - pivot[2] * axis[1]
    screw[1] = pivot[2] * axis[0] - pivot[0] * axis[2]
    screw[2] = pivot[0] * axis[1] - pivot[1] * axis[0]
    screw[3], screw[4], screw[5] = axis[0], axis[1], axis[2]


@jit
def add_bones(chain, screws, hessians, forces, matrix, gradients):
    """Write the second derivatives (69, 69), their lower half, and the gradient and those by factors (69, 1 + F).

    They are by a place and a pose, whose twists are `screws` (69, 6), 0 for what stays as it is. The `hessians` and
    `forces` of bones are summed up.
    """
    parents = chain.parents
    for b in range(parents.size - 1, -1, -1):
        p = parents[b]
        for i in range(6):
            for j in range(6):
                hessians[p, i, j] += hessians[b + 1, i, j]
            for f in range(gradients.shape[1]):
                forces[p, i, f] += forces[b + 1, i, f]
    matrix[:], gradients[:] = 0.0, 0.0
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
                for f in range(gradients.shape[1]):
                    gradients[a, f] += screws[a, i] * forces[joint, i, f]
            other = joint
            while True:
                start, many = _numbers(chain, other)
                for c in range(start, min(start + many, a + 1)):
                    total = 0.0
                    for i in range(6):
                        total += screws[c, i] * force[i]
                    matrix[a, c] = total
                if other == 0:
                    break
                other = parents[other - 1]


@inlined
def _numbers(chain, joint):
    """Return the first of the numbers that turn or move a joint, and how many there are."""
    if joint == 0:
        return 0, 6
    a = chain.angles[joint - 1]
    return (3 + a, 3) if a >= 0 else (0, 0)


@jit
def add_frames(parents, radii, camera, frames, contours, reach, grown, sums):
    """Add the squares of one view of T frames, with joints (T, 27, 4, 3), to those of the bones, see `add_view`."""
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
            )
            grows = Growth(grown.joints[i], grown.radii, grown.squares)
            bones = BoneSquares(sums.hessians[i], sums.forces[i])
            add_view(parents, radii, camera, frames[i], contour, reach, grows, bones)


@jit
def fit_poses(chain, radii, views, free, aims, reaches, max_turn, poses, places):
    """Move poses (n, 66) and places (n, 3) to the contours of one frame, a step for each of `reaches`, metres.

    A step is Gauss and Newton's. Of the 69 numbers of a place and a pose those that are `free` (m,) change. `aims` are
    what they are pulled to (n, m), and how strongly (m,). No angle turns farther than `max_turn` in a step.
    """
    targets, weights = aims
    n = poses.shape[0]
    joints = chain.parents.size + 1
    many = free.size
    frames = np.empty((n, joints, 4, 3))
    sines = np.empty((n, ANGLES))
    cosines = np.empty((n, ANGLES))
    owners = np.full((n, len(views.points)), -1)
    hessians = np.empty((joints, 6, 6))
    forces = np.empty((joints, 6, 1))
    bones = BoneSquares(hessians, forces)
    grown = Growth(
        np.empty((0, joints, 3)), np.empty((0, radii.shape[0], 2)), np.zeros((1, 1))
    )
    all_screws = np.empty((NUMBERS, 6))
    screws = np.zeros((NUMBERS, 6))
    sums = np.empty((NUMBERS, NUMBERS))
    slopes = np.empty((NUMBERS, 1))
    matrix = np.empty((many, many))
    step = np.empty(many)
    for reach in reaches:
        place_frames(chain, poses, places, sines, cosines, frames)
        for i in range(n):
            hessians[:] = 0.0
            forces[:] = 0.0
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
                    )
                    _add_view(
                        chain.parents,
                        radii,
                        camera,
                        frames[i],
                        contour,
                        reach,
                        owners[i, first:stop],
                        grown,
                        bones,
                    )
            write_screws(chain, frames[i], sines[i], cosines[i], all_screws)
            for a in free:
                screws[a] = all_screws[a]
            add_bones(chain, screws, hessians, forces, sums, slopes)
            for a in range(many):
                number = free[a]
                value = places[i, number] if number < 3 else poses[i, number - 3]
                step[a] = slopes[number, 0] + weights[a] * (value - targets[i, a])
                for b in range(a + 1):
                    matrix[b, a] = sums[number, free[b]]
                matrix[a, a] += weights[a]
            solve_symmetric(matrix, step)
            for a in range(many):
                number = free[a]
                if number < 3:
                    places[i, number] -= step[a]
                else:
                    poses[i, number - 3] -= min(max(step[a], -max_turn), max_turn)


@jit
def solve_symmetric(matrix, right):
    """Solve for a vector (m,), in its place, by elimination in the upper half of a positive definite matrix (m, m)."""
    m = right.size
    for k in range(m):
        for i in range(k + 1, m):
            factor = matrix[k, i] / matrix[k, k]
            for j in range(i, m):
                matrix[i, j] -= factor * matrix[k, j]
            right[i] -= factor * right[k]
    for k in range(m - 1, -1, -1):
        total = right[k]
        for j in range(k + 1, m):
            total -= matrix[k, j] * right[j]
        right[k] = total / matrix[k, k]


@jit
def add_all_bones(chain, placed, bones, free, out):
    """Write what `add_bones` sums up in T frames, of those numbers of a frame, `free` (m,), that may change.

    `placed` are frames, sines and cosines of `place_frames`, and `bones` Hessians and forces. `out` are second
    derivatives (T, m, m) and gradients with derivatives by factors (T, m, 1 + F).
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
        add_bones(chain, screws, hessians[k], forces[k], matrix, gradient)
        for i in range(len(free)):
            gradients[k, i] = gradient[free[i]]
            for j in range(i + 1):
                matrices[k, i, j] = matrices[k, j, i] = matrix[free[i], free[j]]
