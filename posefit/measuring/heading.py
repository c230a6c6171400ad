"""In which frames the person walks backwards: the pelvis faces away from the direction of travel."""

from collections.abc import Collection

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from posefit.motion.motion import Motion

TRAVEL_SECONDS = 0.5  # ours: over which the direction is measured
MIN_TRAVEL_SPEED = 0.3  # metres a second, ours: below it a person goes nowhere
WARNING_SHARE = 0.05  # ours: of frames, from which it is worth a warning


def backwards(motion: Motion, unknown: Collection[int] = ()) -> NDArray[np.bool_]:
    """Return in which frames (T,) the root faces away from its way; `unknown` frames count for nothing.

    The way of a frame is that of the half second about it, over the ground, as far as all of it is known. A person who
    moves slower than 0.3 m/s has none. A heading is away from the way where it lies more than 90 degrees from it.
    """
    count, half = len(motion), max(round(0.5 * TRAVEL_SECONDS * motion.fps), 1)
    back = np.zeros(count, dtype=bool)
    if count <= 2 * half:
        return back
    yaws, ground = motion.poses[half : count - half, 0], motion.translations[:, [0, 2]]
    way = ground[2 * half :] - ground[: -2 * half]
    away = np.asarray((way * np.column_stack([np.sin(yaws), np.cos(yaws)])).sum(axis=1) < 0.0)
    frame_known = np.isin(np.arange(count), [*unknown], invert=True)
    known = np.asarray(sliding_window_view(frame_known, 2 * half + 1).all(axis=1))
    fast = np.linalg.norm(way, axis=1) > MIN_TRAVEL_SPEED * 2 * half / motion.fps
    back[half : count - half] = away & fast & known
    return back


def backwards_warning(back: NDArray[np.bool_]) -> str:
    """Return a warning about frames in which the person walks backwards; empty where they are few."""
    if back.mean() < WARNING_SHARE:
        return ""
    return (
        f"the person seems to walk backwards in {back.sum()} of {len(back)} frames: expected to face the direction "
        "of travel; if they do, the track faces the wrong way there"
    )
