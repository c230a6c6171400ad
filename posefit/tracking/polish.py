"""One frame by itself: the poses that its search left open, moved until their contours are those of the masks.

A search moves a pose only as its prior can. Here every joint may give way, as it does in the smoothing of a track; what
the polished poses cost says which of them is reported, and how likely the others are.
"""

from dataclasses import replace

import numpy as np

from posefit.fitting.contours import ROBUST_SCALES, STEP_EVALUATIONS, contour_fit
from posefit.fitting.start import posterior_of
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.silhouette.cost import pose_costs

SHARE = 0.4  # of a frame's evaluations: those of polishing, at most
MAX_POSES = 3
# standard deviations that a searched pose is off: radians, and metres
TURN = np.radians(8.0)
SHIFT = 0.05


def polish_evaluations(evaluations: int) -> int:
    """Return how many of a frame's evaluations are for polishing: for whole steps, if there are any."""
    most = MAX_POSES * (len(ROBUST_SCALES) * STEP_EVALUATIONS + 1.0)
    share = min(SHARE * evaluations, most)
    return int(share) if share > STEP_EVALUATIONS else 0


def polished(
    task: Task, frame: Frame, observation: Observation, evaluations: int, beta: float
) -> Frame:
    """Return a frame whose likeliest poses are fitted to the contours, the cheapest of them being its pose.

    Args:
        task: what the search of the frame knew.
        frame: its result, with a posterior where it left several poses open.
        observation: the masks.
        evaluations: the effort, see `polish_evaluations`.
        beta: that of the cost.

    Returns:
        The frame with the evaluations of both.

    """
    poses = frame.pose[None]
    places = frame.translation[None]
    if frame.posterior is not None:
        poses = frame.posterior.poses.copy()
        places = frame.posterior.translations.copy()
    scene = task.body, task.cameras, observation.silhouettes
    full = len(ROBUST_SCALES) * STEP_EVALUATIONS + 1.0
    count = min(max(int(evaluations / full), 1), len(poses))
    share = int(min(evaluations / count, full)) - 1
    costs = np.empty(len(poses))
    # the search gives its poses by their costs, the cheapest first
    used = 0
    for k in range(count):
        poses[k], places[k], steps = contour_fit(
            task, observation, (poses[k], places[k]), (TURN, SHIFT), share
        )
        used += steps
    costs, areas = pose_costs(*scene, poses, places, beta)
    used += len(poses)
    best = int(costs.argmin())
    posterior = frame.posterior and posterior_of(poses, places, costs)
    total = frame.evaluations + used
    cost = float(costs[best])
    return replace(
        frame,
        pose=poses[best],
        translation=places[best],
        cost=cost,
        areas=areas[:, best],
        evaluations=total,
        trace=np.vstack([frame.trace, [total, cost]]),
        posterior=posterior,
    )
