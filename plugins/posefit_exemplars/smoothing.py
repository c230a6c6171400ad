"""A zero-phase filter of poses over time: a Gaussian, equally far ahead and back."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.markov import windows

FILTER_REACH = 3.0  # standard deviations, to either side


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
        poses, places = (
            np.array([getattr(other, name) for other in near])
            for name in ("pose", "place")
        )
        pose, place = smoothed_pose(poses, places, len(before), spread)
        yield replace(
            estimate,
            pose=pose,
            place=place if estimate.frame_costs.root is None else estimate.place,
        )
        before.append(estimate)


def smoothed_pose(
    poses: Array, places: Array, k: int, spread: float
) -> tuple[Array, Array]:
    """Return the weighted mean pose (66,) and place (3,) around frame k.

    Equally many frames before and after it count; otherwise the mean would lag behind a
    steady movement, or run ahead of it.

    Args:
        poses: (n, 66) the poses of the frames.
        places: (n, 3) their places.
        k: The frame in the middle.
        spread: Standard deviation of the weights, frames. 0 or less: no smoothing.

    """
    if spread <= 0.0:
        return poses[k], places[k]
    reach = min(k, len(poses) - 1 - k)
    rows = np.arange(k - reach, k + reach + 1)
    weights = np.exp(-0.5 * ((rows - k) / spread) ** 2)
    weights /= weights.sum()
    return poses[k] + weights @ wrapped(poses[rows] - poses[k]), weights @ places[rows]
