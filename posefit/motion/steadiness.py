"""How steady a motion is: how its joints accelerate, and how far feet slide while they stand. Joints are (T, 27, 3)."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS

# a second: the rate at which places are compared, so that jitter counts the same at any
# frame rate
PACE = 30.0
# of the feet, which stay where they are while a foot rolls off
BALLS = JOINTS.index("lfoot"), JOINTS.index("rfoot")
MAX_STANDING_HEIGHT = 0.05  # metres above the lowest place of either foot
MAX_STANDING_SPEED = 0.2  # metres a second
# about a frame, for that lowest place: the ground may rise, and depth may drift
WINDOW_SECONDS = 2.0
MIN_STANDING_SECONDS = 0.1


def acceleration(joints: Array, fps: float) -> Array:
    """Return how fast joints accelerate (T,), the mean over them, in m/s2; NaN at both ends.

    It is the second difference of their places in the world, over a thirtieth of a second each.
    """
    step = max(round(fps / PACE), 1)
    accelerations = np.full(len(joints), np.nan)
    if len(joints) > 2 * step:
        change = joints[2 * step :] - 2.0 * joints[step:-step] + joints[: -2 * step]
        accelerations[step:-step] = (
            np.linalg.norm(change, axis=2).mean(axis=1) * (fps / step) ** 2
        )
    return accelerations


def standing(joints: Array, fps: float) -> NDArray[np.bool_]:
    """Return whether the left and the right foot stand (T, 2): low and slow, for a tenth of a second at least.

    y is up. A foot is as low as 5 cm above the lowest place of the two within a second.
    """
    feet = joints[:, BALLS]
    step = max(round(fps / PACE), 1)
    half = min(step, (len(feet) - 1) // 2)
    if half == 0:
        return np.zeros(feet.shape[:2], dtype=bool)
    around = np.arange(len(feet))
    before = np.maximum(around - half, 0)
    after = np.minimum(around + half, len(feet) - 1)
    speed = (
        np.linalg.norm(feet[after] - feet[before], axis=2)
        * fps
        / (after - before)[:, None]
    )
    stands = (speed < MAX_STANDING_SPEED) & low(
        feet, fps, WINDOW_SECONDS, MAX_STANDING_HEIGHT
    )
    for side in range(2):
        for start, stop in runs(stands[:, side]):
            stands[start:stop, side] &= stop - start >= MIN_STANDING_SECONDS * fps
    return np.asarray(stands)


def low(feet: Array, fps: float, seconds: float, height: float) -> NDArray[np.bool_]:
    """Return whether feet (T, n, 3) are less than `height` above the lowest of all (T, n) in so many seconds around."""
    reach = max(round(0.5 * seconds * fps), 1)
    lowest = np.array(
        [feet[max(k - reach, 0) : k + reach + 1, :, 1].min() for k in range(len(feet))]
    )
    return np.asarray(feet[:, :, 1] < lowest[:, None] + height)


def slides(joints: Array, stands: NDArray[np.bool_]) -> Array:
    """Return how far a foot slides along the ground from where it first stood (steps,), in metres, step by step.

    `stands` (T, 2) is whether the left and the right foot stand: those of `standing`, or of another motion.
    """
    slides = []
    for side, ball in enumerate(BALLS):
        for start, stop in runs(stands[:, side]):
            places = joints[start:stop, ball][:, [0, 2]]
            slides.append(float(np.linalg.norm(places - places[0], axis=1).max()))
    return np.array(slides)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the first frame of each run of true flags (T,), and the frame after its last."""
    edges = np.flatnonzero(
        np.diff(np.concatenate([[False], flags, [False]]).astype(np.int8))
    )
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
