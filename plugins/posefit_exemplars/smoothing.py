"""A zero-phase filter of poses over time: a Gaussian that looks as far ahead as back."""

import time
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.geometry.rotation import wrapped
from posefit_exemplars.calibration import recalibrated
from posefit_exemplars.frame_costs import FrameCosts
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
    drawn: SampledPaths | None = None  # where the sampled paths are


def smoothed(frames: Iterable[Estimate], spread: float, ahead: int) -> Iterator[Frame]:
    """Yield each frame as the weighted mean of those up to `ahead` before and after it, `ahead` frames later.

    `spread` is the standard deviation of the weights, in frames; 0 leaves everything as it is.
    """
    recent: deque[Estimate] = deque()
    here = 0  # where in `recent` the next frame to yield is
    for one in frames:
        recent.append(one)
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
    one = recent[here]
    poses, places = (np.array([getattr(each, name) for each in recent]) for name in ("pose", "place"))
    pose, place = smoothed_pose(poses, places, here, spread)
    if one.look.root is not None:
        place = one.place
    cost, areas = one.look.measured(pose, place)
    used, history = int(np.ceil(one.evaluations)) + 1, np.array([cost])
    details: dict[str, Any] = {"usable": one.look.usable}
    posterior, seconds, cpu_seconds = None, one.seconds, one.cpu_seconds
    if one.drawn is not None:
        began, begun = time.perf_counter(), time.process_time()
        details["twins"] = one.look.twins(pose, place) if one.look.usable else np.empty(0)
        used += len(details["twins"])
        posterior = recalibrated(one.drawn.about(pose, place), pose, cost, one.look)
        seconds, cpu_seconds = seconds + time.perf_counter() - began, cpu_seconds + time.process_time() - begun
    more: dict[str, Any] = {"details": details, "cpu_seconds": cpu_seconds, "posterior": posterior}
    return Frame(pose, place, cost, areas, used, seconds, history, **more)
