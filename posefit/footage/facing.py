"""Which way the person faces, by what the segmenter reports."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera

# share of the longer side: a person who moves farther across the picture within
# `STAYING_SECONDS` is not on the spot
CROSSING_SHARE = 0.35
STAYING_SECONDS = 2.0  # seconds before and after a frame
MEAN_SECONDS = 0.5  # seconds before and after a frame over which facings are averaged
# least length of the mean of unit vectors: shorter means that facings contradict
MIN_AGREEMENT = 0.6


def facings_on_the_spot(
    facings: Array | Sequence[float],
    middles: Sequence[float],
    sides: Sequence[float],
    fps: float,
) -> Array:
    """Return which way a person faces in each frame (T,), if they are on the spot.

    A person who walks across the picture shows front and back by their motion, which is
    no less reliable than a network. Their facing becomes NaN.

    Args:
        facings: (T,) as `Segmenter.facing`, NaN if unknown.
        middles: (T,) the middle column of each mask, in pixels; NaN if it is empty.
        sides: (T,) the longer side of each mask, in pixels.
        fps: Frames per second.
    """
    result = np.array(facings, dtype=np.float64)
    reach = max(round(STAYING_SECONDS * fps), 1)
    for k in range(len(result)):
        rows = slice(max(k - reach, 0), k + reach + 1)
        known = np.isfinite(middles[rows])
        across = np.asarray(middles[rows])[known]
        side = np.asarray(sides[rows])[known]
        if known.any() and np.ptp(across) > CROSSING_SHARE * np.median(side):
            result[k] = np.nan
    return result


def yaws_of(facings: Array | Sequence[float], camera: Camera, fps: float) -> Array:
    """Return about which way a person faces in each frame (T,), NaN if unknown.

    Angles are radians about the vertical. Each is the mean direction over the second
    around its frame, so that a few wrong facings do not count.

    Args:
        facings: (T,) as `Segmenter.facing`.
        camera: The camera that they are relative to.
        fps: Frames per second.
    """
    values = np.asarray(facings, dtype=np.float64)
    reach = max(round(MEAN_SECONDS * fps), 1)
    towards = np.arctan2(-camera.rotation[2, 0], -camera.rotation[2, 2])
    known = np.isfinite(values)
    directions = np.where(known, np.exp(1j * (np.nan_to_num(values) + towards)), 0.0)
    around = [slice(max(k - reach, 0), k + reach + 1) for k in range(len(values))]
    total = np.array([directions[rows].sum() for rows in around])  # (T,) complex
    count = np.array([known[rows].sum() for rows in around])
    # the limit excludes frames without any facing, whose total is 0
    agrees = np.abs(total) >= np.maximum(MIN_AGREEMENT * count, 1e-9)
    return np.where(agrees, np.angle(total), np.nan)
