"""How steady a motion is: acceleration of joints, and sliding of feet on the ground.

Joints have shape (T, 27, 3).
"""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS

# rate in Hz at which places are compared: jitter counts the same at any frame rate
PACE = 30.0
# joints of the feet that stay where they are while a foot rolls off
BALLS = JOINTS.index("lfoot"), JOINTS.index("rfoot")
MAX_STANDING_HEIGHT = 0.05  # metres above the lowest place of either foot
MAX_STANDING_SPEED = 0.2  # metres per second
# time window for that lowest place: the ground may rise, and depth may drift
WINDOW_SECONDS = 2.0
MIN_STANDING_SECONDS = 0.1


def acceleration(joints: Array, fps: float) -> Array:
    """Return the mean acceleration of the joints (T,) in m/s2; NaN at both ends.

    It is the second difference of their places in the world, with steps of a thirtieth
    of a second.
    """
    step = max(round(fps / PACE), 1)
    accelerations = np.full(len(joints), np.nan)
    if len(joints) > 2 * step:
        change = joints[2 * step :] - 2.0 * joints[step:-step] + joints[: -2 * step]
        sizes = np.linalg.norm(change, axis=2).mean(axis=1)  # (T - 2 step,)
        accelerations[step:-step] = sizes * (fps / step) ** 2
    return accelerations


def standing(joints: Array, fps: float) -> NDArray[np.bool_]:
    """Return whether the left and the right foot are on the ground (T, 2).

    A foot stands if it is slow and low for at least a tenth of a second. It is low if
    it is less than 5 cm above the lowest place of both feet within a second. y is up.
    """
    feet = joints[:, BALLS]
    step = max(round(fps / PACE), 1)
    half = min(step, (len(feet) - 1) // 2)
    if half == 0:
        return np.zeros(feet.shape[:2], dtype=bool)
    around = np.arange(len(feet))
    before = np.maximum(around - half, 0)
    after = np.minimum(around + half, len(feet) - 1)
    distances = np.linalg.norm(feet[after] - feet[before], axis=2)  # (T, 2)
    speed = distances * fps / (after - before)[:, None]
    is_low = low(feet, fps, WINDOW_SECONDS, MAX_STANDING_HEIGHT)
    in_stance = (speed < MAX_STANDING_SPEED) & is_low
    for side in range(2):
        for start, stop in runs(in_stance[:, side]):
            # a foot that swings past is slow for a frame or two
            in_stance[start:stop, side] &= stop - start >= MIN_STANDING_SECONDS * fps
    return np.asarray(in_stance)


def low(feet: Array, fps: float, seconds: float, height: float) -> NDArray[np.bool_]:
    """Return whether feet (T, n, 3) are low (T, n).

    Args:
        feet: The feet's places.
        fps: Frames per second.
        seconds: Time window, half of it before and half after each frame.
        height: A foot is low if it is less than this above the lowest of all feet in
            the window, in metres.
    """
    reach = max(round(0.5 * seconds * fps), 1)
    lowest = np.empty(len(feet))
    for k in range(len(feet)):
        window = feet[max(k - reach, 0) : k + reach + 1]
        lowest[k] = window[:, :, 1].min()
    return np.asarray(feet[:, :, 1] < lowest[:, None] + height)


def slides(joints: Array, in_stance: NDArray[np.bool_]) -> Array:
    """Return how far a foot slides along the ground in each step (steps,), in metres.

    A slide is the greatest distance from where the foot first stood.

    Args:
        joints: The joints.
        in_stance: Whether the left and the right foot are on the ground (T, 2), by
            `standing`, maybe of another motion.
    """
    slides = []
    for side, ball in enumerate(BALLS):
        for start, stop in runs(in_stance[:, side]):
            places = joints[start:stop, ball][:, [0, 2]]
            slides.append(float(np.linalg.norm(places - places[0], axis=1).max()))
    return np.array(slides)


def runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return the start and stop of each run of true flags (T,)."""
    # so that a run at either end has two edges
    padded = np.concatenate([[False], flags, [False]]).astype(np.int8)
    edges = np.flatnonzero(np.diff(padded))
    return [(int(start), int(stop)) for start, stop in edges.reshape(-1, 2)]
