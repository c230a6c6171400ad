"""The areas of proposals in every view: decoded and drawn on an NVIDIA GPU, as many at a time as it has room for.

Only proposals go there, and only areas come back. Not imported unless a problem's silhouettes lie on a device.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import cuda

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.cost import Areas
from posefit.silhouette.cuda.areas import drawing_on_device, launched
from posefit.silhouette.drawn import count_poses
from posefit.silhouette.mask import Silhouette

PART = 262_144  # proposals: 145 MB of poses
THREADS = 256  # of a block
_ANGLES = ANGLES


def decodes(space: SearchSpace) -> bool:
    """Return whether a device can decode proposals: the prior is affine, and yaw first; nothing has to be aligned."""
    affine = getattr(space.prior, "affine", None) is not None
    return affine and space.translation != "aligned" and space.root_order == "yaw_first"


def areas_of_proposals(
    body: Body, cameras: Sequence[Camera], silhouettes: Sequence[Silhouette], space: SearchSpace, proposals: Array
) -> list[Areas]:
    """Return R, B, Y (n, 3) of proposals (n, d) in each view. Raises ValueError where a proposal is not finite."""
    if not np.isfinite(proposals).all():
        raise InputError("proposals must be finite, got nan or infinity")
    views = list(zip(cameras, silhouettes, strict=True))
    counts = [np.empty((len(proposals), 3), dtype=np.int64) for _ in views]
    drawings = [drawing_on_device(body, *view) for view in views]
    first = space.dimensions - len(space.prior.low)
    box = tuple(map(on_device, (space.centre, space.half, space.anchor)))
    affine = tuple(map(on_device, space.prior.affine))  # type: ignore[attr-defined]
    decoding = first, box, on_device(space.tilt_mean), affine
    for silhouette in silhouettes:
        count_poses(len(proposals), silhouette)
    for start in range(0, len(proposals), PART):
        part = slice(start, start + PART)
        there = cuda.to_device(proposals[part])
        placed: list[Any] = [cuda.device_array((len(there), wide), np.float64) for wide in (ANGLES, 3)]
        decode_on_device[-(-len(there) * ANGLES // THREADS), THREADS](there, *decoding, *placed)
        launches = [launched(drawing, *placed) for drawing in drawings]
        for out, areas in zip(counts, launches, strict=True):
            out[part] = areas.copy_to_host()
    return counts


def on_device(array: Array) -> Any:
    """Return a copy of an array on the device."""
    return cuda.to_device(np.array(array, dtype=np.float64, order="C"))


@cuda.jit(device=True)
def coordinate(proposals, i, k, box):
    """Return coordinate k of proposal i."""
    return box[0][k] + box[1][k] * proposals[i, k]


@cuda.jit(device=True)
def sum_over_latents(proposals, i, box, first, weights, skipped, column, total):
    """Return `total` and the latents of proposal i, each times its weight in a column, below some rows skipped."""
    for k in range(first, box[0].size):
        total += coordinate(proposals, i, k, box) * weights[skipped + k - first, column]
    return total


@cuda.jit
def decode_on_device(proposals, first, box, tilt, affine, poses, translations):
    """Write poses (n, 66) and translations (n, 3) of proposals (n, d), a thread an angle.

    Latents begin at coordinate `first`; `box` are its centre and half (d,), and the anchor (3,). Joint angles are the
    offset (63,) of `affine` and the latents by its weights (m, 63); the mean tilt is the rows least, most and base of
    `tilt` (3 + m, 2) and the latents by the others.
    """
    weights, offset = affine
    at = cuda.grid(1)
    i, j = at // _ANGLES, at % _ANGLES
    if i >= poses.shape[0]:
        return
    if j >= 3:
        poses[i, j] = sum_over_latents(proposals, i, box, first, weights, 0, j - 3, offset[j - 3])
        return
    angle = coordinate(proposals, i, j, box)
    if j > 0:
        mean = sum_over_latents(proposals, i, box, first, tilt, 3, j - 1, tilt[2, j - 1])
        angle += min(max(mean, tilt[0, j - 1]), tilt[1, j - 1])
    poses[i, j] = angle
    translations[i, j] = coordinate(proposals, i, 3 + j, box) if first > 3 else box[2][j]
