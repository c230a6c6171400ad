"""Which foot stands in which frame, told from a motion that shakes."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.motion.steadiness import BALLS, runs

SLOW = 0.25  # metres a second that a standing foot may seem to move
SHARE = 0.45  # of the root's speed, which it may seem to move where that is more
LOW = 0.07  # metres above the lowest place of either foot, within `AROUND`, up to which a foot may stand
AROUND = 1.2  # seconds: a stride
SHORTEST = 0.12  # seconds that a foot stands at least
GAP = 0.07  # seconds that it may seem not to, in between


def stances(joints: Array, fps: float, eyes: Array) -> NDArray[np.bool_]:
    """Return whether the left and the right foot stand (T, 2), of joints (T, 27, 3) whose root moves smoothly.

    A foot that stands is low, and slow beside the root: who walks leaves it behind. y is up. A single camera, at
    `eyes` (T, 3), sees how slow it is across the line of sight alone; these are NaN where several see it.
    """
    count = len(joints)
    if count < 3:
        return np.zeros((count, 2), dtype=bool)
    feet, sights = joints[:, BALLS], (joints[:, 0] - eyes)[:, [0, 2]]
    speed, root = (_speeds(places, sights, fps) for places in (feet, joints[:, :1]))
    reach = max(round(0.5 * AROUND * fps), 1)
    heights = feet[..., 1].min(axis=1)
    lowest = np.array([heights[max(k - reach, 0) : k + reach + 1].min() for k in range(count)])
    stands = (speed < np.maximum(SLOW, SHARE * root)) & (feet[..., 1] < lowest[:, None] + LOW)
    for side in range(2):
        stands[:, side] = _without_short(~_without_short(~stands[:, side], GAP * fps), SHORTEST * fps)
    return np.asarray(stands)


def _speeds(places: Array, sights: Array, fps: float) -> Array:
    """Return how fast places (T, n, 3) go along the ground (T, n), but for what is along the lines of sight (T, 2).

    A line of NaN takes nothing away.
    """
    ways = np.gradient(places[..., [0, 2]], 1.0 / fps, axis=0)
    sights = np.nan_to_num(sights / np.maximum(np.linalg.norm(sights, axis=1, keepdims=True), 1e-9))
    ways = ways - np.einsum("tni,ti->tn", ways, sights)[..., None] * sights[:, None]
    return np.asarray(np.linalg.norm(ways, axis=2))


def _without_short(flags: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Return flags (T,) of which runs shorter than `least` frames are taken back; those at an end stay."""
    kept = flags.copy()
    for start, stop in runs(flags):
        if stop - start < least and start > 0 and stop < len(flags):
            kept[start:stop] = False
    return kept
