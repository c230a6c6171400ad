"""What a track that nobody knows the truth of shows by itself: its size, its depth and where its feet stand."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.motion.steadiness import BALLS, acceleration, runs, standing
from posefit.silhouette.mask import Mask

AROUND = 0.5  # seconds before and after a frame, which say where a steady way passes
LEAST = 5  # frames within them below which they do not
USUAL = 0.9  # the share of frames that lie as near to that way as is told


def longer_side(mask: Mask) -> int:
    """Return the longer side in pixels of a mask's bounding box, 0 where it is empty or cut by the picture's edge."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows) or rows[0] == 0 or columns[0] == 0 or rows[-1] + 1 == len(mask) or columns[-1] + 1 == len(mask[0]):
        return 0
    return int(max(rows[-1] - rows[0], columns[-1] - columns[0])) + 1


def size_ratio(seen: NDArray[np.int64], fitted: NDArray[np.int64]) -> float | None:
    """Return how large the person looks beside the fitted body, the median; None where nothing can be compared.

    Both are longer sides (n,) in pixels, 0 where they are not known.
    """
    both = (seen > 0) & (fitted > 0)
    return float(np.median(seen[both] / fitted[both])) if both.any() else None


def depth_scatter(depths: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how far depths (T,) as they were found lie off a steady way, as a share of the depth; None of too few.

    Nine in ten usable frames lie nearer. The steady way is the parabola through the frames within half a second.
    """
    known = np.flatnonzero(usable & (depths > 0.0))
    away = []
    for k in known:
        near = known[np.abs(known - k) <= AROUND * fps]
        if len(near) < LEAST:
            continue
        way = np.polynomial.Polynomial.fit(near - k, depths[near], 2)
        away.append(abs(depths[k] - way(0.0)) / depths[k])
    return float(np.quantile(away, USUAL)) if away else None


def held_share(usable: NDArray[np.bool_]) -> float:
    """Return the share of frames that are not usable (T,) between the first and the last that are; 1 where none is.

    Before somebody comes and after he has gone nothing is to be seen, which says nothing against a track.
    """
    known = np.flatnonzero(usable)
    return 1.0 - len(known) / float(known[-1] + 1 - known[0]) if len(known) else 1.0


def jerks(joints: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how fast joints (T, 27, 3) accelerate, the mean over usable frames, in m/s2; None where none tells."""
    found = acceleration(joints, fps)[usable]
    found = found[np.isfinite(found)]
    return float(found.mean()) if len(found) else None


def foot_share(joints: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return the share of usable frames in which a foot stands, of joints (T, 27, 3); None where no frame is usable."""
    one = standing(joints, fps)
    return float((one[:, 0] | one[:, 1])[usable].mean()) if usable.any() else None


def stance_spread(joints: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how far apart in metres the heights are at which feet stand (T, 27, 3); None where none stands twice.

    It is the standard deviation over stances of the ball's height, y being up.
    """
    stands = standing(joints, fps) & usable[:, None]
    heights = []
    for side, ball in enumerate(BALLS):
        heights += [float(joints[start:stop, ball, 1].mean()) for start, stop in runs(stands[:, side])]
    return float(np.std(heights)) if len(heights) > 1 else None
