"""What tracks cost, and what several of one clip took together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from posefit.fitting.tracker import Frame


def mean_cost(frames: Sequence[Frame], usable: NDArray[np.bool_]) -> float:
    """Return the mean cost of the frames that show enough of the person; of all frames where none does."""
    costs = np.array([frame.cost for frame in frames])
    return float(costs[usable].mean() if usable.any() else costs.mean())


def spent_by_all(tracks: Sequence[Sequence[Frame]], kept: int) -> list[Frame]:
    """Return the frames of the track that is kept, with the evaluations and the time of all tracks.

    The course of a search is told as if all tracks went on abreast: its evaluations are stretched to those of all.
    """
    return [_spent(together, together[kept]) for together in zip(*tracks, strict=True)]


def _spent(together: Sequence[Frame], frame: Frame) -> Frame:
    total, taken = sum(one.evaluations for one in together), [one.cpu_seconds for one in together]
    known = [one for one in taken if one is not None]
    return replace(
        frame,
        evaluations=total,
        seconds=sum(one.seconds for one in together),
        cpu_seconds=sum(known) if len(known) == len(taken) else None,
        spent=None if frame.spent is None else frame.spent * total // max(frame.evaluations, 1),
    )
