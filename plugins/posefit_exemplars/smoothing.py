"""A zero-phase filter of poses over time: a Gaussian that looks as far ahead as back."""

import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.geometry.rotation import wrapped
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.lost_model import recalibrated
from posefit_exemplars.window import SampledPaths

SMOOTHED = 3.0  # standard deviations that the filter reaches to either side


@dataclass(frozen=True, eq=False)
class Estimate:
    """The pose estimated in a frame, before it is smoothed."""

    pose: Array  # (66,)
    place: Array  # (3,)
    look: FrameCosts = field(repr=False)
    evaluations: float
    seconds: float
    cpu_seconds: float
    paths: SampledPaths | None = None
    others: tuple[Array, Array] | None = field(default=None, repr=False)  # poses (n, 66) and places: other hypotheses

    def longer(self, evaluations: float, seconds: float, cpu_seconds: float) -> Self:
        """Return the estimate, which took so much more."""
        more = self.evaluations + evaluations, self.seconds + seconds, self.cpu_seconds + cpu_seconds
        return replace(self, evaluations=more[0], seconds=more[1], cpu_seconds=more[2])


def smoothed(frames: Iterable[Estimate], spread: float, ahead: int) -> Iterator[Frame]:
    """Yield each frame as the weighted mean of those up to `ahead` before and after it, `ahead` frames later.

    `spread` is the standard deviation of the weights, in frames; 0 leaves everything as it is.
    """
    recent: deque[Estimate] = deque()
    here = 0  # where in `recent` the next frame to yield is
    for estimate in frames:
        recent.append(estimate)
        if len(recent) - here > ahead:
            yield _frame(recent, here, spread)
            here += 1
            if here > ahead:
                recent.popleft()
                here -= 1
    while here < len(recent):
        yield _frame(recent, here, spread)
        here += 1


def smoothed_pose(poses: Array, places: Array, here: int, spread: float) -> tuple[Array, Array]:
    """Return the weighted mean pose (66,) and place (3,) of frames (n, 66), (n, 3) about one of them.

    As many frames before as after it count, so that the mean of a steady movement is where it is.
    """
    if spread <= 0.0:
        return poses[here], places[here]
    reach = min(here, len(poses) - 1 - here)
    rows = np.arange(here - reach, here + reach + 1)
    share = np.exp(-0.5 * ((rows - here) / spread) ** 2)
    share /= share.sum()
    return poses[here] + share @ wrapped(poses[rows] - poses[here]), share @ places[rows]


def _frame(recent: Sequence[Estimate], here: int, spread: float) -> Frame:
    estimate, look = recent[here], recent[here].look
    poses, places = np.array([near.pose for near in recent]), np.array([near.place for near in recent])
    pose, place = smoothed_pose(poses, places, here, spread)
    if look.root is not None:
        place = estimate.place
    cost, areas = look.measured(pose, place)
    start, cpu_start = time.perf_counter(), time.process_time()
    details: dict[str, Any] = {"usable": look.usable}
    posterior, used = None, int(np.ceil(estimate.evaluations)) + 1
    if estimate.paths is not None:
        details["sides"] = look.side_odds(pose, place)
        details["twins"] = look.twins(pose, place) if look.usable else np.empty(0)
        used += len(details["twins"])
        posterior = recalibrated(estimate.paths.about(pose, place), pose, cost, look)
    return Frame(
        pose,
        place,
        cost,
        areas,
        used,
        estimate.seconds + time.perf_counter() - start,
        np.array([cost]),
        details=details,
        cpu_seconds=estimate.cpu_seconds + time.process_time() - cpu_start,
        posterior=posterior,
    )
