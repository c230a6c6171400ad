"""Smaller pictures of the same scene: every second pixel of every second row, or every fourth of every fourth."""

from dataclasses import replace

import numpy as np

from posefit.errors import InputError
from posefit.geometry.camera import Camera
from posefit.reading import quoted
from posefit.silhouette.mask import Silhouette


def coarser_camera(camera: Camera, factor: int) -> Camera:
    """Return the camera whose pixels are every `factor`th of every `factor`th row: their centres see the same rays.

    So a body drawn by it is the same body drawn at full size and looked at there, pixel for pixel. The first one is
    number `factor // 2`. Raises ValueError where that is no pixel.
    """
    first = _first(factor, (camera.width, camera.height))
    width, height = (len(range(first, side, factor)) for side in (camera.width, camera.height))
    centre = (camera.centre - first - 0.5) / factor + 0.5
    return replace(camera, width=width, height=height, focal=camera.focal / factor, centre=centre)


def coarser_silhouette(silhouette: Silhouette, factor: int) -> Silhouette:
    """Return what `coarser_camera` saw of a silhouette, with the borders of the full-size one.

    Areas times the square of `factor` are estimates of the full ones, and a pose that fits perfectly costs 0. The
    majority of each block, the other way to make a mask smaller, is no picture that such a camera takes of a body.
    """
    first = _first(factor, silhouette.size)
    mask, valid = (pixels[first::factor, first::factor] for pixels in (silhouette.mask, silhouette.valid))
    coarse = replace(Silhouette.of(mask, valid), scale=silhouette.scale * factor, device=silhouette.device)
    # the full-size borders, so that poses aligned to them stand where they stand at full size
    vars(coarse)["extent"] = tuple((np.array(silhouette.extent) - first - 0.5) / factor + 0.5)
    return coarse


def _first(factor: int, size: tuple[int, int]) -> int:
    if isinstance(factor, bool) or not isinstance(factor, int | np.integer) or not 1 <= factor <= min(size):
        raise InputError(f"factor must be a whole number from 1 to the smaller side {min(size)}, got {quoted(factor)}")
    return int(factor) // 2
