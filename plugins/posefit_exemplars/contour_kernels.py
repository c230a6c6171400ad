"""Poses moved so that their contours are those of masks, in numba: the steps of Gauss and Newton of one frame.

Shapes are checked by the callers.
"""

import math

import numpy as np

from posefit.arrays import jit
from posefit.geometry.kernels import Chain, place_frames
from posefit.geometry.skeleton import ANGLES
from posefit.tracking.smoothing.kernels import NUMBERS, add_bones, add_view, write_screws

RIGID = 1e9  # precision of an angle that the person has not


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
    parents,
    angles,
    turns,
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

    First come the fields of `Chain`, then radii, cameras, and the fields of
    `FrameContours`. Angles are pulled to `means` (n, 66), and places to where they were, with `precisions` (69,), of a
    place and a pose; no angle turns by more than `most` a step.
    """
    chain = Chain(parents, angles, turns, offsets)
    frames = np.empty((1, parents.size + 1, 4, 3))
    sines, cosines = np.empty((1, ANGLES)), np.empty((1, ANGLES))
    curves, forces = np.empty((parents.size + 1, 6, 6)), np.empty((parents.size + 1, 6, 1))
    screws, matrix, slopes = np.empty((NUMBERS, 6)), np.empty((NUMBERS, NUMBERS)), np.empty((NUMBERS, 1))
    grown = np.empty((0, parents.size + 1, 3)), np.empty((0, parents.size, 2)), np.zeros((1, 1))
    for n in range(poses.shape[0]):
        start = places[n].copy()
        for reach in reaches:
            place_frames(chain, poses[n : n + 1], places[n : n + 1], sines, cosines, frames)
            forces[:] = 0.0
            curves[:] = 0.0
            for v in range(len(steps)):
                if starts[v] < starts[v + 1]:
                    camera = rotations[v], translations[v], focals[v], centres[v]
                    contour = fields[v], corners[v], sizes[v], points[starts[v] : starts[v + 1]], steps[v]
                    add_view(chain.parents, radii, camera, frames[0], contour, reach, grown, (curves, forces))
            write_screws(chain, frames[0], sines[0], cosines[0], screws)
            screws[precisions >= RIGID] = 0.0
            add_bones(chain, screws, curves, forces, matrix, slopes)
            for a in range(NUMBERS):
                off = places[n, a] - start[a] if a < 3 else poses[n, a - 3] - means[n, a - 3]
                matrix[a, a] += precisions[a]
                slopes[a, 0] += precisions[a] * off
            _solve(matrix, slopes[:, 0])
            for a in range(3):
                places[n, a] -= slopes[a, 0]
            for a in range(ANGLES):
                poses[n, a] -= min(max(slopes[3 + a, 0], -most), most)
