"""Which way somebody faces all along, by what a segmenter says of each picture."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera

AROUND = 0.5  # seconds before and after a frame in which most of what is said counts
AGREED = 0.6  # how long the mean of unit vectors is at least: what is said may not contradict itself
GOING = 0.35  # of his longer side: whoever goes as far across the picture in twice `STAYING` is not on the spot
STAYING = 2.0  # seconds before and after a frame


def facings_on_the_spot(
    facings: Sequence[float], middles: Sequence[float], sides: Sequence[float], fps: float
) -> Array:
    """Return which way somebody faces in each frame (T,), nan where he goes across the picture, or nobody knows.

    `middles` and `sides` are those of his mask, in pixels. Who goes along tells the front from the back himself, by the
    clips that go on so; a network is no surer of him.
    """
    told, reach = np.array(facings, dtype=np.float64), max(round(STAYING * fps), 1)
    for k in range(len(told)):
        rows = slice(max(k - reach, 0), k + reach + 1)
        seen = np.isfinite(middles[rows])
        if seen.any() and np.ptp(np.asarray(middles[rows])[seen]) > GOING * np.median(np.asarray(sides[rows])[seen]):
            told[k] = np.nan
    return told


def yaws_of(facings: Array | Sequence[float], camera: Camera, fps: float) -> Array:
    """Return about which way a person faces in each frame (T,), radians about the vertical; nan where nobody knows.

    `facings` (T,) are what the segmenter says of a camera's frames, as `Segmenter.facing`. Each frame is told the mean
    direction of those in the second around it, so that a few wrong ones do not count.
    """
    here, reach = np.asarray(facings, dtype=np.float64), max(round(AROUND * fps), 1)
    towards = np.arctan2(-camera.rotation[2, 0], -camera.rotation[2, 2])
    known = np.isfinite(here)
    said = np.where(known, np.exp(1j * (np.nan_to_num(here) + towards)), 0.0)
    around = [slice(max(k - reach, 0), k + reach + 1) for k in range(len(here))]
    total, seen = (np.array([one[rows].sum() for rows in around]) for one in (said, known))
    return np.where(np.abs(total) >= np.maximum(AGREED * seen, 1e-9), np.angle(total), np.nan)
