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
def cone_distance(x, y, cone):
    """Return how far a point is outside a cone, below 0 within, the share of the bone it is at, and its normal."""
    x0 = cone[0]
    y0 = cone[1]
    r0 = cone[2]
    dx = cone[3]
    dy = cone[4]
    dr = cone[5]
    length = cone[6]
    side = cone[7]
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
def _add(block, gradient, share, across, down, radius_change, off, weight):
    """Add the square of one distance, which moves by (across, down) with its axis and by `radius_change`."""
    rest = 1.0 - share
    values = (
        across * rest,
        down * rest,
        across * share,
        down * share,
        radius_change * rest,
        radius_change * share,
    )
    for i in range(6):
        gradient[i] += weight * off * values[i]
        for j in range(6):
            block[i, j] += weight * values[i] * values[j]


@jit
def _nearest_bone(x, y, first, cones, discs):
    """Return the bone whose border is nearest to a point; begin with `first`."""
    least = np.inf
    bone = first
    for k in range(-1, discs.shape[0]):
        b = first if k < 0 else k
        reach = least + discs[b, 2]
        if (x - discs[b, 0]) ** 2 + (y - discs[b, 1]) ** 2 >= reach * reach:
            continue
        off = cone_distance(x, y, cones[b])[0]
        if off < least:
            least = off
            bone = b
    return bone


@jit
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


@jit
def _covered(x, y, neighbours, cones, discs):
    for b in neighbours:
        near = (x - discs[b, 0]) ** 2 + (y - discs[b, 1]) ** 2 < discs[b, 2] * discs[
            b, 2
        ]
        if near and cone_distance(x, y, cones[b])[0] < -COVERED:
            return True
    return False


@jit
def add_pulls(parents, centres, radii, contour, scale, blocks, gradients):
    """Add the squares of the distances of the mask's border from the body's, and of the body's from the mask's.

    Those of a bone go to its half of a second derivative, 6 x 6, and half of a gradient: by the column and row of its
    two joints, and by both radii.
    """
    cones = np.empty((parents.size, 8))
    discs = np.empty((parents.size, 3))
    write_cones(parents, centres, radii, cones, discs)
    _add_mask_border(contour, scale, cones, discs, blocks, gradients)
    neighbours = np.empty(parents.size, np.int64)
    for b in range(parents.size):
        # else one of its discs covers the other
        if cones[b, 6] > abs(cones[b, 5]) + TINY:
            others = neighbours[: _write_neighbours(b, discs, neighbours)]
            start = centres[parents[b]]
            end = centres[b + 1]
            _add_bone_border(
                start,
                end,
                radii[b],
                contour,
                scale,
                (others, cones, discs),
                (blocks[b], gradients[b]),
            )


@inlined
def _add_mask_border(contour, scale, cones, discs, blocks, gradients):
    """Add the squares of the distances of the mask's border from the nearest bones."""
    bone = 0
    for i in range(contour.points.shape[0]):
        x = contour.points[i, 0]
        y = contour.points[i, 1]
        bone = _nearest_bone(x, y, bone, cones, discs)
        off, share, nx, ny = cone_distance(x, y, cones[bone])
        weight = contour.step / (1.0 + (off / scale) ** 2)
        _add(blocks[bone], gradients[bone], share, -nx, -ny, -1.0, off, weight)


@inlined
def _add_bone_border(start, end, ends, contour, scale, others, square):
    """Add the squares of the distances of a bone's visible border, both sides and both ends, from the mask's."""
    neighbours, cones, discs = others
    block, gradient = square
    dx = end[0] - start[0]
    dy = end[1] - start[1]
    r0 = ends[0]
    r1 = ends[1]
    length = math.sqrt(dx * dx + dy * dy)
    dx = dx / length
    dy = dy / length
    cosine = (r0 - r1) / length
    sine = math.sqrt(1.0 - cosine * cosine)
    tilt = math.acos(cosine)  # from the axis to the normal of the cone's side
    sides = max(int(length / (2.0 * contour.step)) + 1, 2)
    for k in range(2 * (sides + 1 + 2 * CAP)):
        i = k // 2
        side = 1.0 - 2.0 * (k % 2)
        if i <= sides:
            share = i / sides
            along = cosine
            aside = sine
            stands = length * sine / sides * (0.5 if i in (0, sides) else 1.0)
        elif side > 0.0:
            share = 1.0 if i <= sides + CAP else 0.0
            if share > 0.0:
                angle = tilt * (i - sides - 0.5) / CAP
                stands = r1 * tilt / CAP
            else:
                rest = math.pi - tilt
                angle = tilt + rest * (i - sides - CAP - 0.5) / CAP
                stands = r0 * rest / CAP
            along = math.cos(angle)
            aside = math.sin(angle)
        nx = along * dx - side * aside * dy
        ny = along * dy + side * aside * dx
        radius = r0 + share * (r1 - r0)
        x = start[0] + share * length * dx + radius * nx
        y = start[1] + share * length * dy + radius * ny
        known, off, across, down = _mask_distance(x, y, contour)
        if known and not _covered(x, y, neighbours, cones, discs):
            weight = stands / (1.0 + (off / scale) ** 2)
            _add(
                block,
                gradient,
                share,
                across,
                down,
                across * nx + down * ny,
                off,
                weight,
            )


@inlined
def _mask_distance(x, y, contour):
    """Return whether a point lies in the field, how far it is from the mask's border there, and the slope of that."""
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
        upper = contour.field[top]
        lower = contour.field[top + 1]
        f00 = upper[left]
        f01 = upper[left + 1]
        f10 = lower[left]
        f11 = lower[left + 1]
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
                total = 0.0
                for k in range(6):
                    total += blocks[b, i, k] * rows[k, j]
                turned[i, j] = total
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
