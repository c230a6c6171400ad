"""Poses moved so that their contours are those of masks, in numba: the steps of Gauss and Newton of one frame.

The contour of a drawn body depends on two joints and two radii of each bone. What moves them is a twist: an angle
turns everything beyond its joint. So the squares of a bone's distances are a 6 x 6 matrix over twists, and an angle
meets the sum of those of the bones that it moves. Shapes are checked by the callers.
"""

import math

import numpy as np

from posefit.arrays import inlined, jit
from posefit.geometry.kernels import Chain, place_frames
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.rasteriser import NEAR
from posefit.tracking.smoothing.contours import (
    BORDER_DEVIATION,
    CORRELATION_LENGTH,
    MIN_ROBUST_SCALE,
    PIXEL_DEVIATION,
)
from posefit.tracking.smoothing.kernels import pull

NUMBERS = 3 + ANGLES  # of a place and a pose


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
    for b in range(bones):
        wide[b, 0], wide[b, 1] = depth[parents[b]] * radii[b, 0], depth[b + 1] * radii[b, 1]
    blocks, slopes = np.zeros((bones, 6, 6)), np.zeros((bones, 6))
    pull(
        parents, centres, wide, field, corner, size, points, step, max(reach * metres, MIN_ROBUST_SCALE), blocks, slopes
    )
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
    """Write the twist (69, 6) of the place's axes, velocity then rotation, and of each angle."""
    screws[:] = 0.0
    root = frames[0, 3]
    axes = np.empty((3, 3))
    axes[0, 0], axes[0, 1], axes[0, 2] = 0.0, 1.0, 0.0
    axes[1, 0], axes[1, 1], axes[1, 2] = cosines[0], 0.0, -sines[0]
    axes[2, 0], axes[2, 1], axes[2, 2] = frames[0, 2, 0], frames[0, 2, 1], frames[0, 2, 2]
    for k in range(3):
        screws[k, k] = 1.0
        _screw(screws[3 + k], axes[k], root)
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
            _screw(screws[3 + a + k], axes[k], pivot)


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
        first, count = _numbers(chain, joint)
        for a in range(first, first + count):
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
def _solve(matrix, vector):
    """Solve a positive definite system in place, of which the lower half is given.

    The last number goes first: what turns a hand has to do with what turns its arm, and with no other limb.
    """
    n = vector.size
    for j in range(n - 1, -1, -1):
        row = matrix[j]
        pivot = 1.0 / math.sqrt(max(row[j], 1e-12))
        for k in range(j + 1):
            row[k] *= pivot
        vector[j] *= pivot
        for i in range(j):
            factor = row[i]
            if factor != 0.0:
                vector[i] -= factor * vector[j]
                other = matrix[i]
                for k in range(i + 1):
                    other[k] -= factor * row[k]
    for j in range(n):
        total = vector[j]
        row = matrix[j]
        for i in range(j):
            total -= row[i] * vector[i]
        vector[j] = total / row[j]


@jit
def fit_poses(
    kinematics,
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

    First come the address of `place_lanes` and the fields of `Chain`, then radii, cameras, and the fields of
    `FrameContours`. Angles are pulled to `means` (n, 66), and places to where they were, with `precisions` (69,), of a
    place and a pose; no angle turns by more than `most` a step.
    """
    chain = Chain(parents, angles, turns, turned, offsets)
    frames = np.empty((parents.size + 1, 4, 3))
    sines, cosines = np.empty(ANGLES), np.empty(ANGLES)
    screws, forces, curves = np.empty((NUMBERS, 6)), np.empty((parents.size + 1, 6)), np.empty((parents.size + 1, 6, 6))
    matrix, slopes = np.empty((NUMBERS, NUMBERS)), np.empty(NUMBERS)
    for n in range(poses.shape[0]):
        start = places[n].copy()
        for reach in reaches:
            place_frames(kinematics, chain, poses[n : n + 1], places[n : n + 1], sines, cosines, frames)
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
                off = places[n, a] - start[a] if a < 3 else poses[n, a - 3] - means[n, a - 3]
                matrix[a, a] += precisions[a]
                slopes[a] += precisions[a] * off
            _solve(matrix, slopes)
            for a in range(3):
                places[n, a] -= slopes[a]
            for a in range(ANGLES):
                poses[n, a] -= min(max(slopes[3 + a], -most), most)
