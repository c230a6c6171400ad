"""Numba loops over many scenes at once: arrays are stacked, one row per scene.

A row runs through the same inner functions as a single scene, so its bits do not depend
on its neighbours. Callers check the shapes.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, Bits, jit
from posefit.fitting.kernels import move_to_borders, unpack_proposals
from posefit.geometry.kernels import (
    LANES,
    empty_lanes,
    place_lanes,
    read_joints,
    set_offsets,
    set_rows,
)
from posefit.silhouette.kernels import count, paint_bits
from posefit.silhouette.rasteriser import (
    View,
    fill_pose,
    outline_poses,
    set_scene,
    work_arrays,
)


class Scenes(NamedTuple):
    """The properties in which the scenes (n) differ: bodies, cameras, silhouettes."""

    offsets: Array  # (n, 26, 3) bones in their own frames
    radii: Array  # (n, 26, 2)
    rotations: Array  # (n, views, 3, 3) camera_from_world
    places: Array  # (n, views, 3) the cameras' translations
    focals: Array  # (n, views, 2) pixels
    centres: Array  # (n, views, 2) pixels
    observed: Bits  # (n, views, ...) bit images
    valid: Bits  # (n, views, ...) bit images
    totals: NDArray[np.int64]  # (n, views) pixels of the silhouettes


@jit
def unpack_scenes(proposals, centres, halves, anchors, poses, translations, latents):
    """Write root angles, translations and latents of proposals (n, k, d).

    Return whether all of them are finite.
    """
    finite = True
    upright = np.zeros((3 + latents.shape[2], 2))
    for i in range(proposals.shape[0]):
        finite &= unpack_proposals(
            proposals[i],
            centres[i],
            halves[i],
            anchors[i],
            upright,
            poses[i],
            translations[i],
            latents[i],
        )
    return finite


@jit
def align_scenes(chain, scenes, joint_radii, borders, rows, poses, translations):
    """Align translations (n, k, 3) so that poses (n, k, 66) fill borders (n, views, 4).

    Only the scenes in `rows` are aligned.
    """
    many = poses.shape[1]
    block = np.empty(LANES, np.int64)
    lanes = empty_lanes()
    # joints are placed about a root at the origin, which is then moved
    joints = np.empty((many, joint_radii.shape[1], 3))
    origins = np.zeros((many, 3))
    for i in rows:
        set_offsets(lanes, 0, LANES, scenes.offsets[i])
        for first in range(0, many, LANES):
            set_rows(block, first, many)
            place_lanes(chain, poses[i], origins, block, lanes)
            for lane in range(min(LANES, many - first)):
                read_joints(lanes, lane, joints[first + lane])
        move_to_borders(
            joints,
            joint_radii[i],
            scenes.rotations[i],
            scenes.places[i],
            scenes.focals[i],
            scenes.centres[i],
            borders[i],
            translations[i],
        )


@jit
def draw_scenes(chain, scenes, rows, poses, translations, areas, value, pictures):
    """Write the areas R, B, Y (views, n, k, 3) of poses (n, k, 66) in some rows.

    Each pose is rasterised in its row's scene. Each pixel of a body is set to `value`
    in `pictures` (n, height, width, views), unless that array is empty.
    """
    views = scenes.places.shape[1]
    many = poses.shape[1]
    total = rows.size * poses.shape[1]
    height, width = pictures.shape[1:3]
    flat = poses.reshape(-1, poses.shape[2])
    places = translations.reshape(-1, 3)
    work = work_arrays(scenes.observed.shape[2], scenes.observed.shape[3])
    block = np.empty(LANES, np.int64)
    drawn = np.empty(LANES, np.int64)
    for v in range(views):
        # the scene that each lane is set up for; -1 for none
        drawn[:] = -1
        for first in range(0, total, LANES):
            # the last block may be short: its spare lanes repeat the last pose
            for lane in range(LANES):
                at = min(first + lane, total - 1)
                i = rows[at // many]
                block[lane] = many * i + at % many
                if i != drawn[lane]:
                    rotation = scenes.rotations[i, v]
                    place = scenes.places[i, v]
                    view = View(
                        rotation,
                        place,
                        scenes.focals[i, v],
                        scenes.centres[i, v],
                        width,
                        height,
                    )
                    set_scene(
                        work, lane, lane + 1, scenes.offsets[i], scenes.radii[i], view
                    )
                    drawn[lane] = i
            stride = outline_poses(chain, flat, places, block, width, height, work)
            for lane in range(min(LANES, total - first)):
                i = block[lane] // many
                k = block[lane] % many
                image, box = fill_pose(lane, stride, work)
                if pictures.size:
                    paint_bits(image, box, value, pictures[i, :, :, v])
                body, overlap = count(
                    image, scenes.observed[i, v], scenes.valid[i, v], box
                )
                areas[v, i, k, 0] = np.uint64(scenes.totals[i, v]) - overlap
                areas[v, i, k, 1] = body - overlap
                areas[v, i, k, 2] = overlap
