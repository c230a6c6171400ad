"""The areas of proposals in every view: decoded and drawn on a device, as many at a time as it has room for."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import cuda

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.cuda.decoding import THREADS, decode_on_device
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.cost import Areas
from posefit.silhouette.cuda.areas import drawing_on_device, launched
from posefit.silhouette.drawn import count_poses
from posefit.silhouette.mask import Silhouette

PART = 262_144  # proposals: 145 MB of poses


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
    counts = [np.empty((len(proposals), 3), dtype=np.int64) for _ in silhouettes]
    drawings = [
        drawing_on_device(body, camera, silhouette) for camera, silhouette in zip(cameras, silhouettes, strict=True)
    ]
    box = [cuda.to_device(array) for array in box_of(space)]
    for silhouette in silhouettes:
        count_poses(len(proposals), silhouette)
    for first in range(0, len(proposals), PART):
        part = slice(first, first + PART)
        placed = decoded_on_device(space, box, proposals[part])
        launches = [launched(drawing, *placed) for drawing in drawings]
        for out, areas in zip(counts, launches, strict=True):
            out[part] = areas.copy_to_host()[:, 0]
    return counts


def box_of(space: SearchSpace) -> Sequence[Array]:
    """Return the arrays that describe a space: middle, half sides, anchor, tilt, slopes, weights and offset."""
    weights, offset = space.prior.affine  # type: ignore[attr-defined]
    tilt = np.zeros((3 + len(weights), 2)) if space.tilt is None else space.tilt.mean
    arrays = (space.centre, space.half, space.anchor, tilt[:3], tilt[3:], weights, offset)
    return [np.array(array, dtype=np.float64, order="C") for array in arrays]


def decoded_on_device(space: SearchSpace, box: Sequence[Any], proposals: Array) -> tuple[Any, Any]:
    """Return the poses (n, 66) and translations (n, 3) of proposals (n, d), all of them on the device."""
    centre, half, anchor, *learned = box
    n, first = len(proposals), space.dimensions - len(space.prior.low)
    poses, translations = (cuda.device_array((n, wide), np.float64) for wide in (ANGLES, 3))
    if n:
        blocks = -(-n * ANGLES // THREADS)
        given = cuda.to_device(proposals)
        decode_on_device[blocks, THREADS](given, centre, half, anchor, first, *learned, poses, translations)
    return poses, translations
