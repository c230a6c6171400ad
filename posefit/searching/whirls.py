"""Turns that nobody makes, and which way somebody faces all along if he makes none.

A silhouette hardly tells a body that faces the camera from its reflection, which faces away. A track that takes the one
for the other and back whirls round; each of its frames then votes for one of the two.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.geometry.alike import facing
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.motion.steadiness import runs

FASTEST = np.radians(450.0)  # a second: nobody turns faster without walking
MOMENT = 0.1  # seconds
WHIRL = np.radians(60.0)  # in a moment: more is none of his turns; what is told is smooth, and takes so long
PACE = 30.0  # a second: how often frames vote
BEYOND = 30.0  # votes that a radian costs which is turned faster than anybody turns


def whirling(yaws: Array, usable: NDArray[np.bool_], fps: float) -> NDArray[np.bool_]:
    """Return in which frames (T,) a body turns as nobody does, by its yaws (T,) in radians, where it is seen."""
    found = np.zeros(len(yaws), dtype=bool)
    reach = max(round(MOMENT * fps), 1)
    turned = np.abs(wrapped(yaws[reach:] - yaws[:-reach]))
    for k in np.flatnonzero((turned > WHIRL) & usable[reach:] & usable[:-reach]):
        found[k : k + reach + 1] = True
    return found


def agreeing(
    frames: Sequence[Frame], cameras: Sequence[Camera], usable: NDArray[np.bool_], fps: float
) -> NDArray[np.bool_]:
    """Return which frames (T,) face where the whole track does, as true flags, by the likeliest way without whirls.

    A frame may face where it was found, or where its reflection does; the latter goes against its votes, of which it
    has one for each camera that sees it. Frames in which the body whirls have none, nor those that show too little.
    """
    yaws = np.array([frame.pose[0] for frame in frames])
    steady = ~whirling(yaws, usable, fps)
    rows, clock = np.flatnonzero(usable & steady), steady.cumsum()  # in a whirl nobody has time to turn
    agrees = np.zeros(len(frames), dtype=bool)
    if not len(rows):
        return agrees
    seen = [frames[k] for k in rows.tolist()]
    seeing = np.array([frame.areas.any(axis=1) for frame in seen])
    towards = [
        facing(cameras[int(views.argmax())], frame.translation) for frame, views in zip(seen, seeing, strict=True)
    ]
    found = np.column_stack([yaws[rows], 2.0 * np.array(towards) + np.pi - yaws[rows]])
    against = np.column_stack([np.zeros(len(rows)), seeing.sum(axis=1) * PACE / fps])
    totals, parents = against[0], np.zeros((len(rows), 2), dtype=np.int64)
    for k in range(1, len(rows)):
        turned = np.abs(wrapped(found[k] - found[k - 1][:, None]))
        beyond = np.maximum(turned - FASTEST * (clock[rows[k]] - clock[rows[k - 1]]) / fps, 0.0)
        ways = totals[:, None] + BEYOND * beyond
        parents[k] = ways.argmin(axis=0)
        totals = ways.min(axis=0) + against[k]
    chosen = int(totals.argmin())
    for k in range(len(rows) - 1, -1, -1):
        agrees[rows[k]] = chosen == 0
        chosen = int(parents[k, chosen])
    return agrees


def surest(frames: Sequence[Frame], agrees: NDArray[np.bool_]) -> int | None:
    """Return the frame from which to follow again: in the longest run of flags, the best one that most cameras see.

    None where no flag is true.
    """
    every = runs(agrees)
    if not every:
        return None
    start, stop = max(every, key=lambda run: run[1] - run[0])
    inner = range(start, stop) if stop - start < 3 else range(start + 1, stop - 1)
    return min(inner, key=lambda k: (-int(frames[k].areas.any(axis=1).sum()), frames[k].cost))
