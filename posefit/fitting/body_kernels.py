"""Many bodies in many frames, one pair per lane, compiled by Numba.

The functions take plain arrays and rely on the callers for their shapes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits, jit
from posefit.fitting.kernels import move_to_borders
from posefit.geometry.kernels import (
    LANES,
    empty_lanes,
    place_lanes,
    read_joints,
    set_offsets,
)
from posefit.silhouette.kernels import count
from posefit.silhouette.rasteriser import (
    fill_pose,
    outline_poses,
    set_scene,
    work_arrays,
)


class Bodies(NamedTuple):
    """The bodies (m) that are tried, as arrays for the kernels."""

    offsets: Array  # (m, 26, 3) bones in their own frames
    radii: Array  # (m, 26, 2)


class Observed(NamedTuple):
    """The silhouettes (f) of one camera, as `silhouette.kernels.Observed` has one."""

    person: Bits  # (f, strips, words)
    valid: Bits  # (f, strips, words)
    pixels: NDArray[np.int64]  # (f,)


@jit
def place_bodies(chain, offsets, poses, joints):
    """Write the joints (m, f, 27, 3) of m bodies in f poses, roots at the origin."""
    frames = poses.shape[0]
    total = offsets.shape[0] * frames
    origins = np.zeros((frames, 3))
    rows = np.empty(LANES, np.int64)
    lanes = empty_lanes()
    for first in range(0, total, LANES):
        for lane in range(LANES):
            pair = min(first + lane, total - 1)
            rows[lane] = pair % frames
            set_offsets(lanes, lane, lane + 1, offsets[pair // frames])
        place_lanes(chain, poses, origins, rows, lanes)
        for lane in range(min(LANES, total - first)):
            pair = first + lane
            read_joints(lanes, lane, joints[pair // frames, pair % frames])


@jit
def align_bodies(joints, joint_radii, cameras, borders, places):
    """Move places (m, f, 3) to where joints (m, f, 27, 3) fill the borders.

    The borders are (f, views, 4). Interpretation S4.
    """
    rotations, translations, focals, centres = cameras
    for i in range(joints.shape[0]):
        for k in range(joints.shape[1]):
            move_to_borders(
                joints[i, k : k + 1],
                joint_radii[i],
                rotations,
                translations,
                focals,
                centres,
                borders[k],
                places[i, k : k + 1],
            )


@jit
def count_pairs(chain, bodies, view, observed, poses, places, pairs, areas):
    """Write the areas (m, f, 3) R, B, Y of the pairs from `pairs[0]` to `pairs[1]`.

    Pair i f + k is body i in pose k of `poses` (f, 66), with the root at `places`
    (m, f, 3).
    """
    frames = poses.shape[0]
    strips, words = observed.person.shape[1:]
    work = work_arrays(strips, words)
    # a lane takes its pose and its place from one row: both are copied to its own
    block = np.arange(LANES)
    lane_poses = np.empty((LANES, poses.shape[1]))
    lane_places = np.empty((LANES, 3))
    drawn = np.full(LANES, -1)
    for first in range(pairs[0], pairs[1], LANES):
        for lane in range(LANES):
            pair = min(first + lane, pairs[1] - 1)
            i = pair // frames
            k = pair % frames
            lane_poses[lane] = poses[k]
            lane_places[lane] = places[i, k]
            if drawn[lane] != i:
                set_scene(
                    work, lane, lane + 1, bodies.offsets[i], bodies.radii[i], view
                )
                drawn[lane] = i
        stride = outline_poses(
            chain, lane_poses, lane_places, block, view.width, view.height, work
        )
        for lane in range(min(LANES, pairs[1] - first)):
            i = (first + lane) // frames
            k = (first + lane) % frames
            image, box = fill_pose(lane, stride, work)
            body, overlap = count(image, observed.person[k], observed.valid[k], box)
            areas[i, k, 0] = np.uint64(observed.pixels[k]) - overlap
            areas[i, k, 1] = body - overlap
            areas[i, k, 2] = overlap
