"""In which frames the person walks backwards: the pelvis faces away from the direction of travel."""

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from posefit.motion.motion import Motion

SECONDS = 0.5  # ours: over which the direction is measured
SPEED = 0.3  # metres a second, ours: who goes slower goes nowhere
SHARE = 0.05  # ours: of frames, from which it is worth a warning


def backwards(motion: Motion, unknown: Collection[int] = ()) -> NDArray[np.bool_]:
    """Return in which frames (T,) the root faces away from its way; `unknown` frames count for nothing.

    The way of a frame is that of the half second about it, over the ground, as far as all of it is known. A person who
    moves slower than 0.3 m/s has none. A heading is away from the way where it lies more than 90 degrees from it.
    """
    count = len(motion)
    back = np.zeros(count, dtype=bool)
    half = max(round(0.5 * SECONDS * motion.fps), 1)
    yaws = motion.poses[:, 0]
    heading = np.stack([np.sin(yaws), np.cos(yaws)], axis=1)
    ground = motion.translations[:, [0, 2]]
    known = np.ones(count, dtype=bool)
    known[sorted(unknown)] = False
    for k in range(half, count - half):
        way = ground[k + half] - ground[k - half]
        fast = np.linalg.norm(way) > SPEED * 2 * half / motion.fps
        back[k] = fast and way @ heading[k] < 0.0 and known[k - half : k + half + 1].all()
    return back


def warned(back: NDArray[np.bool_]) -> str:
    """Return a warning about frames in which the person walks backwards; empty where they are few."""
    if back.mean() < SHARE:
        return ""
    return (
        f"the person seems to walk backwards in {back.sum()} of {len(back)} frames: expected to face the direction "
        "of travel; if they do, the track faces the wrong way there"
    )
