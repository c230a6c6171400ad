"""Turns that are too fast for a person, and which way the person faces all along if they make none.

A silhouette hardly distinguishes a body that faces the camera from its reflection, which faces away. A track that takes
one for the other and back spins; each of its frames then votes for one of the two.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.symmetry import facing
from posefit.motion.steadiness import runs

MAX_TURN_RATE = np.radians(450.0)  # a second: the fastest that a person turns on the spot
SPIN_SECONDS = 0.1
SPIN_ANGLE = np.radians(60.0)  # within that time: more is no turn of a person, even in a smoothed track
VOTES_PER_SECOND = 30.0
EXCESS_TURN_VOTES = 30.0  # that a radian costs which is turned faster than a person can


def spin_mask(yaws: Array, usable: NDArray[np.bool_], fps: float) -> NDArray[np.bool_]:
    """Return in which frames (T,) a body spins, by its yaws (T,) in radians, where it is visible."""
    spins = np.zeros(len(yaws), dtype=bool)
    reach = max(round(SPIN_SECONDS * fps), 1)
    turned = np.abs(wrapped(yaws[reach:] - yaws[:-reach]))
    for k in np.flatnonzero((turned > SPIN_ANGLE) & usable[reach:] & usable[:-reach]):
        spins[k : k + reach + 1] = True
    return spins


def facing_consensus(
    frames: Sequence[Frame], cameras: Sequence[Camera], usable: NDArray[np.bool_], fps: float
) -> NDArray[np.bool_]:
    """Return which frames (T,) face where the whole track does, by the likeliest sequence of yaws without spins.

    A frame may face where it was estimated, or where its reflection does; the latter goes against its votes, one for
    each camera that sees the person. Frames that spin have no votes, nor those that show too little. Viterbi.
    """
    yaws = np.array([frame.pose[0] for frame in frames])
    steady = ~spin_mask(yaws, usable, fps)
    rows, clock = np.flatnonzero(usable & steady), steady.cumsum()  # no turn has time during a spin
    agrees = np.zeros(len(frames), dtype=bool)
    if not len(rows):
        return agrees
    voters = [frames[k] for k in rows.tolist()]
    views = np.array([frame.areas.any(axis=1) for frame in voters])
    towards = [
        facing(cameras[int(seeing.argmax())], frame.translation) for frame, seeing in zip(voters, views, strict=True)
    ]
    both = np.column_stack([yaws[rows], 2.0 * np.array(towards) + np.pi - yaws[rows]])
    against = np.column_stack([np.zeros(len(rows)), views.sum(axis=1) * VOTES_PER_SECOND / fps])
    totals, parents = against[0], np.zeros((len(rows), 2), dtype=np.int64)
    for k in range(1, len(rows)):
        turned = np.abs(wrapped(both[k] - both[k - 1][:, None]))
        excess = np.maximum(turned - MAX_TURN_RATE * (clock[rows[k]] - clock[rows[k - 1]]) / fps, 0.0)
        paths = totals[:, None] + EXCESS_TURN_VOTES * excess
        parents[k] = paths.argmin(axis=0)
        totals = paths.min(axis=0) + against[k]
    chosen = int(totals.argmin())
    for k in range(len(rows) - 1, -1, -1):
        agrees[rows[k]] = chosen == 0
        chosen = int(parents[k, chosen])
    return agrees


def anchor_frame(frames: Sequence[Frame], agrees: NDArray[np.bool_]) -> int | None:
    """Return the frame from which to track again: in the longest run of flags, the best one that most cameras see.

    None where no flag is true.
    """
    every = runs(agrees)
    if not every:
        return None
    start, stop = max(every, key=lambda run: run[1] - run[0])
    inner = range(start, stop) if stop - start < 3 else range(start + 1, stop - 1)
    return min(inner, key=lambda k: (-int(frames[k].areas.any(axis=1).sum()), frames[k].cost))
