"""A zero-phase filter of poses over time: a Gaussian, equally far ahead and back."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.markov import windows


def smoothed(
    estimates: Iterable[Estimate], spread: float, ahead: int
) -> Iterator[Estimate]:
    """Yield each estimate as a weighted mean of the estimates around it.

    A known root stays where it is.

    Args:
        estimates: The estimates of the frames, in order.
        spread: Standard deviation of the Gaussian weights, frames.
        ahead: How many frames before and after each one count.
    """
    before: deque[Estimate] = deque(maxlen=ahead)
    for window in windows(estimates, ahead):
        near = [*before, *window]
        estimate = window[0]
        poses = np.array([other.pose for other in near])
        places = np.array([other.place for other in near])
        pose, place = smoothed_pose(poses, places, len(before), spread)
        if estimate.frame_costs.root is not None:
            place = estimate.place
        yield replace(estimate, pose=pose, place=place)
        before.append(estimate)


def smoothed_pose(
    poses: Array, places: Array, middle: int, spread: float
) -> tuple[Array, Array]:
    """Return the weighted mean pose (66,) and place (3,) around a frame.

    Equally many frames before and after it count; otherwise the mean would lag behind a
    steady movement, or run ahead of it.

    Args:
        poses: (n, 66) the poses of the frames.
        places: (n, 3) their places.
        middle: The frame, as a row of `poses`.
        spread: Standard deviation of the weights, frames. 0 or less: no smoothing.
    """
    if spread <= 0.0:
        return poses[middle], places[middle]
    reach = min(middle, len(poses) - 1 - middle)
    rows = np.arange(middle - reach, middle + reach + 1)
    weights = np.exp(-0.5 * ((rows - middle) / spread) ** 2)
    weights /= weights.sum()
    differences = wrapped(poses[rows] - poses[middle])
    return poses[middle] + weights @ differences, weights @ places[rows]
