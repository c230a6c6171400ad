"""Even times for the frames of a video, whose own times may be uneven or rounded."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array

Order = NDArray[np.int64]  # (T,) numbers of frames
# share of the distance between frames: if a frame comes this much too early or too
# late, the frames are not at even times
UNEVEN_SHARE = 0.75
# seconds: many files round the times of frames to milliseconds
STAMP_SECONDS = 1e-3
# share by which a film's length may differ from the length by its stated rate
SAME_LENGTH = 5e-3
# times the mean rate: the highest rate at which uneven frames are sampled, because a
# few frames close together say nothing about the rest
MAX_DENSITY = 4.0


def even(times: Array, fps: float) -> tuple[Order, NDArray[np.bool_], float]:
    """Return frames at even times.

    If the frames are evenly spaced, these are all of them. Otherwise moments are spaced
    at the frames' usual distance, and each one gets the nearest frame.

    Args:
        times: (T,) when each frame is shown, in seconds.
        fps: The rate that the file states.

    Returns:
        For each moment its frame, whether that frame was filmed then and is not a
        repetition, and the number of moments per second.
    """
    numbers = np.arange(len(times))
    all_filmed = numbers >= 0
    apart = np.diff(times)
    # a file without usable times
    if len(times) < 3 or not (apart > 0.0).all():
        return numbers, all_filmed, fps
    mean = float(apart.mean())
    largest_miss = float(np.abs(times - times[0] - mean * numbers).max())
    if largest_miss <= UNEVEN_SHARE * mean:
        return numbers, all_filmed, rate_of(times, largest_miss, fps)
    usual = max(float(np.median(apart)), mean / MAX_DENSITY)
    # times are rounded, so the median is inexact: the mean over all steps is better
    steps = np.maximum(np.round(apart / usual), 1.0)
    usual = float(apart.sum() / steps.sum())
    count = round((times[-1] - times[0]) / usual) + 1
    moments = times[0] + usual * np.arange(count)
    later = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    is_earlier_nearer = moments - times[later - 1] <= times[later] - moments
    order = np.where(is_earlier_nearer, later - 1, later)
    # of several moments that show one frame, it was filmed at the nearest
    miss = np.abs(times[order] - moments)
    least = np.full(len(times), np.inf)
    np.minimum.at(least, order, miss)
    return order, miss == least[order], 1.0 / usual


def rate_of(times: Array, off: float, stated: float) -> float:
    """Return the rate of frames at almost even times.

    This is the stated rate if the times allow it. Otherwise it is the nearest usual
    rate that they allow: a whole number, or 1000 / 1001 of one as in NTSC.

    Args:
        times: (T,) when each frame is shown, in seconds.
        off: By how many seconds a time differs at most from even ones.
        stated: The rate that the file states.
    """
    intervals = len(times) - 1
    lasted = float(times[-1] - times[0])
    rate = intervals / lasted
    # both the first and the last time may be wrong by `off`
    slack = max(STAMP_SECONDS + 2.0 * off, SAME_LENGTH * lasted)

    def miss(likely: float) -> float:
        return abs(intervals / likely - lasted)

    if stated > 0.0 and miss(stated) <= slack:
        return stated
    usual = [each for each in (float(round(rate)), round(rate * 1.001) / 1.001) if each]
    nearest = min(usual, key=miss, default=rate)
    return nearest if miss(nearest) <= slack else rate
