"""One frame by itself: the poses that its search left open, moved until their contours are those of the masks.

A search moves a pose only as its prior can. Here every joint may give way, as it does in the smoothing of a track; what
the polished poses cost says which of them is reported, and how likely the others are.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import (
    POINT_SPACING,
    MaskContours,
    contour_race,
    precisions,
    race_count,
)
from posefit.fitting.prior import Latents
from posefit.fitting.start import posterior_of
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.skeleton import Skeleton
from posefit.geometry.symmetry import exchanged_limbs, facing, reflected_poses
from posefit.motion import built_in, recorded
from posefit.motion.clips import training_clips, training_motions
from posefit.motion.motion import Motion
from posefit.silhouette.cost import known_views, pose_costs
from posefit.tracking.initialise import guessed
from posefit.uncertainty.modes import APART, Posterior, poses_apart

SHARE = 0.5  # of a frame's evaluations: those of polishing
# standard deviations that a searched pose is off: radians, and metres
TURN = np.radians(8.0)
SHIFT = 0.05
# at least, of these: what a look-up leaves
LOOKED_SHARE = 0.9


def polish_evaluations(evaluations: int) -> int:
    """Return how many of a frame's evaluations are for polishing; none where they do not suffice for one pose."""
    share = int(SHARE * evaluations)
    return share if race_count(LOOKED_SHARE * share) else 0


@lru_cache(maxsize=1)
def _library(fps: float) -> list[Motion]:
    """Return all recorded motions at a rate."""
    return training_motions(training_clips([recorded.LIBRARY]), fps)


def looked_up(task: Task, observation: Observation) -> tuple[list[Posterior], int]:
    """Return modes of what a picture may show, the likeliest first, and the evaluations of the look-up.

    A built-in walk is all that a prior of built-in walks knows, but not all that people do: where nothing else is to be
    learned from, they are looked up in the library.
    """
    modes = task.modes
    used = 0
    if all(motion.name in built_in.names() for motion in task.training):
        everything = replace(task, training=_library(task.fps), modes=())
        modes, used = guessed(everything, observation)
    return [mode for _, mode in modes], used


def polished(
    task: Task, frame: Frame, observation: Observation, evaluations: int, beta: float
) -> Frame:
    """Return a frame whose poses, and their reflections, are fitted to the contours; the cheapest is its pose.

    Args:
        task: what the search of the frame knew, and what looks poses up.
        frame: its result, with a posterior where it left several poses open.
        observation: the masks.
        evaluations: the effort, see `polish_evaluations`.
        beta: that of the cost.

    Returns:
        The frame, with the evaluations of both.

    """
    scene = task.body, task.cameras, observation.silhouettes

    def cost(poses: Array, places: Array) -> Array:
        return pose_costs(*scene, poses, places, beta)[0]

    # of what is looked up, the poses as they are: the prior may not know them
    modes, looking = looked_up(task, observation)
    count = race_count(evaluations - looking)
    modes = modes[: count // 2]
    poses, places = _open_poses(task, frame, observation)
    poses = np.concatenate([*(mode.poses[:1] for mode in modes), poses])[:count]
    places = np.concatenate([*(mode.translations[:1] for mode in modes), places])
    places = places[:count]
    views = [
        MaskContours.of(
            camera, view, [observation], frame.translation[None], POINT_SPACING
        )
        for view, camera in enumerate(task.cameras)
    ]
    start = poses, places
    poses, places, used = contour_race(
        task.body, views, start, precisions(TURN, SHIFT), cost
    )
    costs, areas = pose_costs(*scene, poses, places, beta)
    best = int(costs.argmin())
    least = float(costs[best])
    total = frame.evaluations + looking + used + len(poses)
    return replace(
        frame,
        pose=poses[best],
        translation=places[best],
        cost=least,
        areas=areas[:, best],
        evaluations=total,
        trace=np.vstack([frame.trace, [total, least]]),
        posterior=posterior_of(poses, places, costs),
    )


def beyond_prior(prior: Latents, skeleton: Skeleton, pose: Array) -> str:
    """Return what a user should know of a pose (66,) that a prior does not know; "" where it does."""
    latents = np.clip(prior.transform(pose[None, 3:]), prior.low, prior.high)
    nearest = pose[None].copy()
    nearest[:, 3:] = prior.inverse_transform(latents)
    off = float(poses_apart(skeleton, pose[None], nearest)[0, 0])
    if off <= APART:
        return ""
    return (
        f"the prior does not know this pose: the nearest that it knows is {1e3 * off:.0f} mm off, "
        "so that the search had to leave it; --train names motions with such poses"
    )


def with_one_mode(frame: Frame) -> Frame:
    """Return a frame whose posterior is its pose alone: its search left nothing else open."""
    poses = frame.pose[None]
    posterior = posterior_of(poses, frame.translation[None], np.array([frame.cost]))
    return replace(frame, posterior=posterior)


def _open_poses(
    task: Task, frame: Frame, observation: Observation
) -> tuple[Array, Array]:
    """Return the poses (n, 66) and places (n, 3) that a search left open, and others with about such a silhouette.

    One camera hardly shows whether a person leans towards it or away, and which leg is in front. Each pose is followed
    by its reflections; poses whose legs or arms are exchanged come after all of these.
    """
    skeleton = task.body.skeleton
    poses = frame.pose[None]
    places = frame.translation[None]
    if frame.posterior is not None:
        poses = frame.posterior.poses
        places = frame.posterior.translations
    reflected = [
        reflected_poses(skeleton, poses, facing(camera, frame.translation))
        for camera in known_views(task.cameras, observation.silhouettes)
    ]
    exchanged = [
        exchanged_limbs(skeleton, poses, "legs"),
        exchanged_limbs(skeleton, poses, "arms"),
    ]
    groups = [
        np.stack([poses, *reflected], axis=1),  # (modes, 1 + views, 66)
        np.stack(exchanged, axis=1),
    ]
    every = [group.reshape(-1, group.shape[2]) for group in groups]
    repeated = [np.repeat(places, group.shape[1], axis=0) for group in groups]
    return np.concatenate(every), np.concatenate(repeated)
