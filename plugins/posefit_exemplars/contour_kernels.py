"""Poses moved so that their contours are those of masks, in numba: the steps of Gauss and Newton of one frame.

The contour of a drawn body depends on two joints and two radii of each bone. What moves them is a twist: an angle
turns everything beyond its joint. So the squares of a bone's distances are a 6 x 6 matrix over twists, and an angle
meets the sum of those of the bones that it moves. Shapes are checked by the callers.
"""

import math

import numpy as np

from posefit.arrays import inlined, jit
from posefit.geometry.kernels import Chain, empty_frames, place_frames
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.rasteriser import NEAR
from posefit.tracking.smoothing.contours import (
    BORDER_DEVIATION,
    CORRELATION_LENGTH,
    MIN_ROBUST_SCALE,
    PIXEL_DEVIATION,
)
from posefit.tracking.smoothing.kernels import COVERED, TINY, cone_distance

NUMBERS = ANGLES + 3  # of a pose and a place

CAP = 2  # points of a quarter, about, of the disc at a bone's end


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
def _nearest_bone(x, y, parents, centres, radii, discs):
    least, bone, share, nx, ny = np.inf, 0, 0.0, 0.0, 0.0
    for b in range(parents.size):
        reach = least + discs[b, 2]
        if (x - discs[b, 0]) ** 2 + (y - discs[b, 1]) ** 2 >= reach * reach:
            continue
        p = parents[b]
        off, at, ox, oy = cone_distance(
            x, y, centres[p, 0], centres[p, 1], radii[b, 0], centres[b + 1, 0], centres[b + 1, 1], radii[b, 1]
        )
        if off < least:
            least, bone, share, nx, ny = off, b, at, ox, oy
    return least, bone, share, nx, ny


@jit
def _covered(x, y, bone, parents, centres, radii, discs):
    for b in range(parents.size):
        if b == bone or (x - discs[b, 0]) ** 2 + (y - discs[b, 1]) ** 2 >= discs[b, 2] * discs[b, 2]:
            continue
        p = parents[b]
        off = cone_distance(
            x, y, centres[p, 0], centres[p, 1], radii[b, 0], centres[b + 1, 0], centres[b + 1, 1], radii[b, 1]
        )[0]
        if off < -COVERED:
            return True
    return False


@jit
def _pull(drawn, field, corner, size, points, step, scale, blocks, slopes):
    """Add the squares of what points (n, 2) of the mask's border are off the body's, and the body's off the mask's."""
    parents, centres, radii, discs = drawn
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        off, bone, share, nx, ny = _nearest_bone(x, y, parents, centres, radii, discs)
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
        tilt = math.acos((r0 - r1) / length)  # from the axis to the normal of the cone's side
        sides = max(int(length / spacing) + 1, 2)
        for k in range(2 * (sides + 1 + 2 * CAP)):
            side, i = (1.0 if k % 2 == 0 else -1.0), k // 2
            if i <= sides:
                share, angle = i / sides, tilt
                stands = length * math.sin(tilt) / sides * (0.5 if i in (0, sides) else 1.0)
            elif i <= sides + CAP:
                share, angle = 1.0, tilt * (i - sides - 0.5) / CAP
                stands = r1 * tilt / CAP
            else:
                share, angle = 0.0, tilt + (math.pi - tilt) * (i - sides - CAP - 0.5) / CAP
                stands = r0 * (math.pi - tilt) / CAP
            nx = math.cos(angle) * dx - side * math.sin(angle) * dy
            ny = math.cos(angle) * dy + side * math.sin(angle) * dx
            radius = r0 + share * (r1 - r0)
            x = centres[p, 0] + share * length * dx + radius * nx
            y = centres[p, 1] + share * length * dy + radius * ny
            column, row = x - corner[0] - 0.5, y - corner[1] - 0.5
            left, top = math.floor(column), math.floor(row)
            if not (0 <= left < size[1] - 1 and 0 <= top < size[0] - 1):
                continue
            if _covered(x, y, b, parents, centres, radii, discs):
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
def _add_view(chain, radii, camera, frames, contour, reach, curves, forces):
    """Add the squares of one view to those of the bones: curves (27, 6, 6) and forces (27, 6), over twists."""
    rotation, translation, focal, centre = camera
    field, corner, size, points, step = contour
    parents = chain.parents
    bones = parents.size
    centres, depth, wide = np.empty((bones + 1, 2)), np.empty(bones + 1), np.empty((bones, 2))
    ways = np.empty((bones + 1, 3, 3))  # of each joint: how its pixel and its size change with its place
    for j in range(bones + 1):
        x, y, z = frames[j, 3, 0], frames[j, 3, 1], frames[j, 3, 2]
        a = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]
        b = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]
        c = max(rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2], NEAR)
        centres[j, 0], centres[j, 1] = a / c * focal[0] + centre[0], b / c * focal[1] + centre[1]
        depth[j] = math.sqrt(focal[0] * focal[1]) / c
        for i in range(3):
            ways[j, 0, i] = focal[0] / c * (rotation[0, i] - a / c * rotation[2, i])
            ways[j, 1, i] = focal[1] / c * (rotation[1, i] - b / c * rotation[2, i])
            ways[j, 2, i] = -depth[j] / c * rotation[2, i]
    metres = depth[0]  # pixels of one, where the root is
    discs = np.empty((bones, 3))
    for b in range(bones):
        p = parents[b]
        wide[b, 0], wide[b, 1] = depth[p] * radii[b, 0], depth[b + 1] * radii[b, 1]
        discs[b, 0], discs[b, 1] = 0.5 * (centres[p, 0] + centres[b + 1, 0]), 0.5 * (centres[p, 1] + centres[b + 1, 1])
        half = 0.5 * math.sqrt((centres[p, 0] - centres[b + 1, 0]) ** 2 + (centres[p, 1] - centres[b + 1, 1]) ** 2)
        discs[b, 2] = half + max(wide[b, 0], wide[b, 1])
    blocks, slopes = np.zeros((bones, 6, 6)), np.zeros((bones, 6))
    drawn = parents, centres, wide, discs
    _pull(drawn, field, corner, size, points, step, max(reach * metres, MIN_ROBUST_SCALE), blocks, slopes)
    deviation = BORDER_DEVIATION**2 + (PIXEL_DEVIATION / metres) ** 2
    worth = 1.0 / (metres**3 * CORRELATION_LENGTH * deviation)
    rows, mixed = np.empty((6, 6)), np.empty((6, 6))
    for b in range(bones):
        p = parents[b]
        for k in range(6):  # how each of the six numbers changes with a twist: velocity, then rotation
            j = p if k in (0, 1, 4) else b + 1
            size = radii[b, 0] if k == 4 else radii[b, 1]
            which = k % 2 if k < 4 else 2
            factor = 1.0 if k < 4 else size
            mx, my, mz = factor * ways[j, which, 0], factor * ways[j, which, 1], factor * ways[j, which, 2]
            x, y, z = frames[j, 3, 0], frames[j, 3, 1], frames[j, 3, 2]
            rows[k, 0], rows[k, 1], rows[k, 2] = mx, my, mz
            rows[k, 3], rows[k, 4], rows[k, 5] = y * mz - z * my, z * mx - x * mz, x * my - y * mx
        for i in range(6):
            for j in range(6):
                total = 0.0
                for k in range(6):
                    total += blocks[b, i, k] * rows[k, j]
                mixed[i, j] = total
        for i in range(6):
            total = 0.0
            for k in range(6):
                total += rows[k, i] * slopes[b, k]
            forces[b + 1, i] += worth * total
            for j in range(6):
                total = 0.0
                for k in range(6):
                    total += rows[k, i] * mixed[k, j]
                curves[b + 1, i, j] += worth * total


@jit
def _write_screws(chain, frames, sines, cosines, screws):
    """Write the twist (69, 6) of each angle, velocity then rotation, and of the place's axes."""
    screws[:] = 0.0
    root = frames[0, 3]
    axes = np.empty((3, 3))
    axes[0, 0], axes[0, 1], axes[0, 2] = 0.0, 1.0, 0.0
    axes[1, 0], axes[1, 1], axes[1, 2] = cosines[0], 0.0, -sines[0]
    axes[2, 0], axes[2, 1], axes[2, 2] = frames[0, 2, 0], frames[0, 2, 1], frames[0, 2, 2]
    for k in range(3):
        _screw(screws[k], axes[k], root)
        screws[66 + k, k] = 1.0
    for b in range(chain.parents.size):
        a = chain.angles[b]
        if a < 0:
            continue
        pivot, frame = frames[chain.parents[b], 3], frames[b + 1]
        for i in range(3):
            u, v, w = frame[0, i], frame[1, i], frame[2, i]
            axes[0, i] = u
            axes[1, i] = v * cosines[a] - w * sines[a]
            before = w * cosines[a] + v * sines[a]
            axes[2, i] = before * cosines[a + 1] - u * sines[a + 1]
        for k in range(3):
            _screw(screws[a + k], axes[k], pivot)


@inlined
def _screw(screw, axis, pivot):
    screw[0] = pivot[1] * axis[2] - pivot[2] * axis[1]
    screw[1] = pivot[2] * axis[0] - pivot[0] * axis[2]
    screw[2] = pivot[0] * axis[1] - pivot[1] * axis[0]
    screw[3], screw[4], screw[5] = axis[0], axis[1], axis[2]


@jit
def _add_up(chain, screws, curves, forces, matrix, slopes):
    """Write the second derivatives (69, 69) and the gradient (69,), from those of bones, which are summed up."""
    parents = chain.parents
    for b in range(parents.size - 1, -1, -1):
        p = parents[b]
        for i in range(6):
            forces[p, i] += forces[b + 1, i]
            for j in range(6):
                curves[p, i, j] += curves[b + 1, i, j]
    matrix[:] = 0.0
    force = np.empty(6)
    for joint in range(parents.size + 1):
        if joint == 0:
            first = 0
        else:
            first = chain.angles[joint - 1]
            if first < 0:
                continue
        for number in range(6 if joint == 0 else 3):
            a = first + number if number < 3 else 63 + number
            slope = 0.0
            for i in range(6):
                total = 0.0
                for j in range(6):
                    total += curves[joint, i, j] * screws[a, j]
                force[i] = total
                slope += screws[a, i] * forces[joint, i]
            slopes[a] = slope
            other = joint
            while True:
                start = 0 if other == 0 else chain.angles[other - 1]
                if start >= 0:
                    for k in range(6 if other == 0 else 3):
                        c = start + k if k < 3 else 63 + k
                        total = 0.0
                        for i in range(6):
                            total += screws[c, i] * force[i]
                        matrix[a, c] = total
                        matrix[c, a] = total
                if other == 0:
                    break
                other = parents[other - 1]


@jit
def _solve(matrix, vector):
    """Solve a positive definite system in place, by Cholesky's decomposition."""
    n = vector.size
    for j in range(n):
        row = matrix[j]
        for k in range(j):
            total = row[k]
            other = matrix[k]
            for i in range(k):
                total -= row[i] * other[i]
            row[k] = total / other[k]
        total = row[j]
        for i in range(j):
            total -= row[i] * row[i]
        row[j] = math.sqrt(max(total, 1e-12))
        total = vector[j]
        for i in range(j):
            total -= row[i] * vector[i]
        vector[j] = total / row[j]
    for j in range(n - 1, -1, -1):
        vector[j] /= matrix[j, j]
        for i in range(j):
            vector[i] -= matrix[j, i] * vector[j]


@jit
def fit_poses(
    parents,
    angles,
    turns,
    turned,
    offsets,
    radii,
    rotations,
    translations,
    focals,
    centres,
    fields,
    corners,
    sizes,
    points,
    starts,
    steps,
    means,
    precisions,
    most,
    reaches,
    poses,
    places,
):
    """Move poses (n, 66) at `places` (n, 3) by a step for each of `reaches`, metres, towards the contours of all views.

    First come the fields of `Chain`, then radii, cameras, and the fields of `FrameContours`. Angles are pulled to
    `means` (n, 66), and places to where they were, with `precisions` (69,); no angle turns by more than `most` a step.
    """
    chain = Chain(parents, angles, turns, turned, offsets)
    frames = empty_frames(parents.size + 1)
    sines, cosines = np.empty(ANGLES), np.empty(ANGLES)
    screws, forces, curves = np.empty((NUMBERS, 6)), np.empty((parents.size + 1, 6)), np.empty((parents.size + 1, 6, 6))
    matrix, slopes = np.empty((NUMBERS, NUMBERS)), np.empty(NUMBERS)
    for n in range(poses.shape[0]):
        start = places[n].copy()
        for reach in reaches:
            place_frames(chain, poses[n], places[n], sines, cosines, frames)
            forces[:] = 0.0
            curves[:] = 0.0
            for v in range(len(steps)):
                if starts[v] < starts[v + 1]:
                    camera = rotations[v], translations[v], focals[v], centres[v]
                    contour = fields[v], corners[v], sizes[v], points[starts[v] : starts[v + 1]], steps[v]
                    _add_view(chain, radii, camera, frames, contour, reach, curves, forces)
            _write_screws(chain, frames, sines, cosines, screws)
            _add_up(chain, screws, curves, forces, matrix, slopes)
            for a in range(NUMBERS):
                off = poses[n, a] - means[n, a] if a < ANGLES else places[n, a - ANGLES] - start[a - ANGLES]
                matrix[a, a] += precisions[a]
                slopes[a] += precisions[a] * off
            _solve(matrix, slopes)
            for a in range(ANGLES):
                poses[n, a] -= min(max(slopes[a], -most), most)
            for a in range(3):
                places[n, a] -= slopes[ANGLES + a]
