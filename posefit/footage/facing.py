"""Which way a person faces in each frame, by what a segmenter reports of each picture."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera

AROUND = 0.5  # seconds before and after a frame whose reports are averaged
AGREEMENT = 0.6  # the mean of unit vectors is at least so long: reports may not contradict each other
CROSSING = 0.35  # of the longer side: a person who goes as far across the picture within `STAYING` is not on the spot
STAYING = 2.0  # seconds before and after a frame


def facings_on_the_spot(
    facings: Sequence[float], middles: Sequence[float], sides: Sequence[float], fps: float
) -> Array:
    """Return which way a person faces in each frame (T,), NaN where they go across the picture or it is unknown.

    `middles` and `sides` are those of the mask, in pixels. For a person who goes along, the frames themselves show
    front and back, and a network is no surer.
    """
    result, reach = np.array(facings, dtype=np.float64), max(round(STAYING * fps), 1)
    for k in range(len(result)):
        rows = slice(max(k - reach, 0), k + reach + 1)
        known = np.isfinite(middles[rows])
        if known.any() and np.ptp(np.asarray(middles[rows])[known]) > CROSSING * np.median(
            np.asarray(sides[rows])[known]
        ):
            result[k] = np.nan
    return result


def yaws_of(facings: Array | Sequence[float], camera: Camera, fps: float) -> Array:
    """Return about which way a person faces in each frame (T,), radians about the vertical; NaN where unknown.

    `facings` (T,) are a segmenter's, as `Segmenter.facing`. Each frame gets the mean direction of the second around it,
    so that a few wrong ones do not count.
    """
    values, reach = np.asarray(facings, dtype=np.float64), max(round(AROUND * fps), 1)
    towards = np.arctan2(-camera.rotation[2, 0], -camera.rotation[2, 2])
    known = np.isfinite(values)
    directions = np.where(known, np.exp(1j * (np.nan_to_num(values) + towards)), 0.0)
    around = [slice(max(k - reach, 0), k + reach + 1) for k in range(len(values))]
    total, count = (np.array([each[rows].sum() for rows in around]) for each in (directions, known))
    return np.where(np.abs(total) >= np.maximum(AGREEMENT * count, 1e-9), np.angle(total), np.nan)
