"""A zero-phase filter of poses over time: a Gaussian that reaches as far ahead as back."""

from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.geometry.rotation import wrapped
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.lost_model import recalibrated
from posefit_exemplars.markov import SampledPaths, windows

FILTER_REACH = 3.0  # standard deviations, to either side


@dataclass(frozen=True, eq=False)
class Estimate:
    """The pose estimated in a frame, before it is smoothed."""

    pose: Array  # (66,)
    place: Array  # (3,)
    frame_costs: FrameCosts = field(repr=False)
    evaluations: float
    paths: SampledPaths | None = None
    alternatives: tuple[Array, Array] | None = field(default=None, repr=False)  # poses (n, 66) and places: other states


def smoothed(estimates: Iterable[Estimate], spread: float, ahead: int) -> Iterator[Frame]:
    """Yield each frame as a mean of those up to `ahead` before and after it; the weights `spread` over some frames."""
    before: deque[Estimate] = deque(maxlen=ahead)
    for window in windows(estimates, ahead):
        yield _frame([*before, *window], len(before), spread)
        before.append(window[0])


def smoothed_pose(poses: Array, places: Array, k: int, spread: float) -> tuple[Array, Array]:
    """Return the weighted mean pose (66,) and place (3,) of frames (n, 66), (n, 3) about frame k.

    As many frames before as after it count, so that the mean of a steady movement is where it is.
    """
    if spread <= 0.0:
        return poses[k], places[k]
    reach = min(k, len(poses) - 1 - k)
    rows = np.arange(k - reach, k + reach + 1)
    weights = np.exp(-0.5 * ((rows - k) / spread) ** 2)
    weights /= weights.sum()
    return poses[k] + weights @ wrapped(poses[rows] - poses[k]), weights @ places[rows]


def _frame(estimates: Sequence[Estimate], k: int, spread: float) -> Frame:
    estimate, frame_costs = estimates[k], estimates[k].frame_costs
    poses, places = (np.array([getattr(frame, name) for frame in estimates]) for name in ("pose", "place"))
    pose, place = smoothed_pose(poses, places, k, spread)
    if frame_costs.root is not None:
        place = estimate.place
    cost, areas = frame_costs.cost_and_areas(pose, place)
    posterior, evaluations = None, int(np.ceil(estimate.evaluations)) + 1
    details: dict[str, Any] = {"usable": frame_costs.usable}
    if estimate.paths is not None:
        details["sides"] = frame_costs.side_odds(pose, place)
        details["mirror_costs"] = frame_costs.mirror_costs(pose, place) if frame_costs.usable else np.empty(0)
        evaluations += len(details["mirror_costs"])
        posterior = recalibrated(estimate.paths.about(pose, place), pose, cost, frame_costs)
    trace = np.array([[evaluations, cost]])
    return Frame(pose, place, cost, areas, evaluations, trace, posterior, details=details)
