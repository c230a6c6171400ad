"""Poses moved so that their contours are those of masks, in numba: a step of Gauss and Newton in one frame.

Shapes are checked by the callers. The argument `contours` is a `contours.FrameContours`.
"""

import math
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, jit
from posefit.geometry.kernels import place_frames
from posefit.geometry.skeleton import ANGLES
from posefit.tracking.smoothing.kernels import NUMBERS, add_bones, add_view, write_screws

MAX_STEP_TURN = math.radians(20.0)  # of an angle in a step
RIGID = 1e9  # precision of an angle that the person does not have


class Pull(NamedTuple):
    """Where angles and places are pulled to, and how strongly."""

    poses: Array  # (n, 66)
    places: Array  # (n, 3)
    precisions: Array  # (69,) of a place, then of a pose


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
def step_poses(kinematics, chain, radii, contours, pull, reach, poses, places):
    """Move poses (n, 66) at `places` (n, 3) by one step towards the contours of all views.

    Distances beyond `reach`, metres, count less. First comes the address of `place_lanes`.
    """
    joints = chain.parents.size + 1
    frames, sines, cosines = np.empty((joints, 4, 3)), np.empty(ANGLES), np.empty(ANGLES)
    curves, forces = np.empty((joints, 6, 6)), np.empty((joints, 6, 1))
    screws, matrix, slopes = np.empty((NUMBERS, 6)), np.empty((NUMBERS, NUMBERS)), np.empty((NUMBERS, 1))
    grown = np.empty((0, joints, 3)), np.empty((0, joints - 1, 2)), np.zeros((1, 1))
    starts = contours.starts
    for n in range(poses.shape[0]):
        place_frames(kinematics, chain, poses[n : n + 1], places[n : n + 1], sines, cosines, frames)
        forces[:] = 0.0
        curves[:] = 0.0
        for v in range(len(contours.steps)):
            if starts[v] < starts[v + 1]:
                camera = contours.rotations[v], contours.translations[v], contours.focals[v], contours.centres[v]
                points = contours.points[starts[v] : starts[v + 1]]
                contour = contours.fields[v], contours.corners[v], contours.sizes[v], points, contours.steps[v]
                add_view(chain.parents, radii, camera, frames, contour, reach, grown, curves, forces)
        write_screws(chain, frames, sines, cosines, screws)
        screws[pull.precisions >= RIGID] = 0.0
        add_bones(chain, screws, curves, forces, matrix, slopes)
        for a in range(NUMBERS):
            off = places[n, a] - pull.places[n, a] if a < 3 else poses[n, a - 3] - pull.poses[n, a - 3]
            matrix[a, a] += pull.precisions[a]
            slopes[a, 0] += pull.precisions[a] * off
        _solve(matrix, slopes[:, 0])
        for a in range(3):
            places[n, a] -= slopes[a, 0]
        for a in range(ANGLES):
            poses[n, a] -= min(max(slopes[3 + a, 0], -MAX_STEP_TURN), MAX_STEP_TURN)
