"""Which way somebody faces all along, by what a segmenter says of each picture."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.geometry.camera import Camera

AROUND = 0.5  # seconds before and after a frame in which most of what is said counts
AGREED = 0.6  # how long the mean of unit vectors is at least: what is said may not contradict itself

GOING = 0.35  # of his longer side: whoever goes as far across the picture in that time is no longer on the spot


def facings_on_the_spot(
    facings: Sequence[float], middles: Sequence[float], sides: Sequence[float], fps: float
) -> Array:
    """Return which way somebody faces in each frame (T,), nan where he goes across the picture, or nobody knows.

    `middles` and `sides` are those of his mask, in pixels. Who goes along tells the front from the back himself, by the
    clips that go on so; a network is no surer of him.
    """
    told, reach = np.array(facings, dtype=np.float64), max(round(AROUND * fps), 1)
    for k in range(len(told)):
        rows = slice(max(k - reach, 0), k + reach + 1)
        seen = np.isfinite(middles[rows])
        if seen.any() and np.ptp(np.asarray(middles[rows])[seen]) > GOING * np.median(np.asarray(sides[rows])[seen]):
            told[k] = np.nan
    return told


def yaws_of(facings: Sequence[Array | Sequence[float]], cameras: Sequence[Camera], fps: float) -> Array:
    """Return about which way a person faces in each frame (T,), radians about the vertical; nan where nobody knows.

    `facings` are what the segmenter says of each camera's frames, as `Segmenter.facing`, none where it says nothing.
    Each frame is told the mean direction of all cameras in the second around it, so that a few wrong ones do not count.
    """
    count = min((len(one) for one in facings if len(one)), default=0)
    said = np.zeros(count, dtype=np.complex128)
    known = np.zeros(count)
    for one, camera in zip(facings, cameras, strict=True):
        if len(one):
            here = np.asarray(one, dtype=np.float64)[:count]
            towards = np.arctan2(-camera.rotation[2, 0], -camera.rotation[2, 2])
            said += np.where(np.isfinite(here), np.exp(1j * (np.nan_to_num(here) + towards)), 0.0)
            known += np.isfinite(here)
    reach = max(round(AROUND * fps), 1)
    around = [slice(max(k - reach, 0), k + reach + 1) for k in range(count)]
    total, seen = (np.array([one[rows].sum() for rows in around]) for one in (said, known))
    clear = np.abs(total) >= np.maximum(AGREED * seen, 1e-9)
    return np.where(clear, np.angle(total), np.nan)
