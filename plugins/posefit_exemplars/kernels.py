"""Distances between codes of poses, and steps of poses towards contours, in numba.

Plain functions over arrays, shapes checked by the callers. The codes of `LANES` poses lie side by side in a tile, so
that loops over lanes run in vector registers. `tiles` are `exemplars.Tiles`, `contours` `contours.FrameContours`.
"""

import math
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array, inlined, jit
from posefit.geometry.kernels import place_frames
from posefit.geometry.skeleton import ANGLES
from posefit.tracking.smoothing.kernels import NUMBERS, add_bones, add_view, write_screws

DIMENSIONS = 24  # of a code: what it leaves out of the joints is below 5 mm
LANES = 32
MAX_STEP_TURN = math.radians(20.0)  # of an angle in a step
RIGID = 1e9  # precision of an angle that the person does not have


@inlined
def lower_distances(distances, start, code, tile):
    """Lower `distances` (LANES,) to `start` and the squared distances of the codes of a tile (DIMENSIONS, LANES)."""
    for lane in range(LANES):
        total = start
        for d in range(DIMENSIONS):
            difference = tile[d, lane] - code[d]
            total += difference * difference
        distances[lane] = min(distances[lane], total)


@jit
def frames_apart(codes, min_square):
    """Return the first frame of a clip with codes (T, D), those far from the latest returned one, and the last."""
    frames = np.zeros(len(codes), np.int64)
    count, last = 1, len(codes) - 1
    for k in range(1, len(codes)):
        square = np.float32(0.0)
        for d in range(codes.shape[1]):
            difference = codes[k, d] - codes[frames[count - 1], d]
            square += difference * difference
        if k == last or square > min_square:
            frames[count] = k
            count += 1
    return frames[:count]


@jit
def nearest_codes(codes, groups, tiles, count):
    """Return the states in `groups` (n, g) nearest to codes (n, D), and squared distances (or inf), both (n, count)."""
    squares = np.full((len(codes), count), np.inf, np.float32)
    states = np.zeros((len(codes), count), np.int64)
    distances = np.empty(LANES, np.float32)
    for i in range(len(codes)):
        for group in groups[i]:
            for t in range(tiles.starts[group], tiles.starts[group + 1]):
                distances[:] = np.inf
                lower_distances(distances, np.float32(0.0), codes[i], tiles.codes[t])
                for lane in range(LANES):
                    rank = count - 1
                    if distances[lane] < squares[i, rank]:
                        while rank > 0 and distances[lane] < squares[i, rank - 1]:
                            squares[i, rank], states[i, rank] = squares[i, rank - 1], states[i, rank - 1]
                            rank -= 1
                        squares[i, rank], states[i, rank] = distances[lane], tiles.states[LANES * t + lane]
    return states, squares


@jit
def cheapest_steps(codes, start_costs, totals, rows, groups, tiles, scale, limit):
    """Return the states that some `rows` of a beam continue to, the row of each one's cheapest step, and its total.

    Row i continues at `codes` (speeds, n, D), which cost `start_costs` (speeds, n); a step to a state in its `groups`
    (n, g) costs the squared distance times `scale`, at the cheapest speed. Totals (n,) with a step are below `limit`.
    """
    best = np.full(len(tiles.states), np.inf)
    parents, reached = np.empty(len(best), np.int64), np.empty(len(best), np.int64)
    distances = np.empty(LANES, np.float32)
    count = 0
    for row in rows:
        if totals[row] >= limit:
            continue
        farthest = np.float32((limit - totals[row]) / scale)
        for group in groups[row]:
            for t in range(tiles.starts[group], tiles.starts[group + 1]):
                distances[:] = farthest
                for speed in range(len(codes)):
                    start = np.float32(start_costs[speed, row] / scale)
                    lower_distances(distances, start, codes[speed, row], tiles.codes[t])
                for lane in range(LANES):
                    if distances[lane] < farthest:
                        total, place = totals[row] + scale * distances[lane], LANES * t + lane
                        if total < best[place]:
                            if best[place] == np.inf:
                                reached[count] = place
                                count += 1
                            best[place], parents[place] = total, row
    reached = reached[:count]
    return tiles.states[reached], parents[reached], best[reached]


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
    """Move poses (n, 66) at `places` (n, 3) by a step to the contours; distances beyond `reach`, metres, count less."""
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
