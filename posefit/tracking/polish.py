"""Polishing of a single frame: its likely poses fitted to the masks' contours.

A search moves a pose only as its prior allows. Here every joint may move, as in the
smoothing of a track. The cheapest polished pose is reported, and the costs of the
others say how likely they are.
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
from posefit.tracking.restarts import guessed
from posefit.uncertainty.modes import APART, Posterior, poses_apart

POLISH_SHARE = 0.5  # the share of a frame's evaluations that is for polishing
# standard deviations of the errors of a search, in radians and in metres
SEARCH_TURN = np.radians(8.0)
SEARCH_SHIFT = 0.05
# a look-up leaves at least this share of the evaluations for polishing
AFTER_LOOKUP_SHARE = 0.9


def polish_evaluations(evaluations: int) -> int:
    """Return the number of a frame's evaluations for polishing.

    It is 0 if they do not suffice for one pose.
    """
    share = int(POLISH_SHARE * evaluations)
    return share if race_count(AFTER_LOOKUP_SHARE * share) else 0


@lru_cache(maxsize=1)
def _library(fps: float) -> list[Motion]:
    """Return all recorded motions at a rate."""
    return training_motions(training_clips([recorded.LIBRARY]), fps)


def looked_up(task: Task, observation: Observation) -> tuple[list[Posterior], int]:
    """Return likely poses of a picture, and the evaluations of the look-up.

    The likeliest pose is first. A prior of built-in walks represents only walks, but
    people do more than walk. So if all training motions are built-in, poses are looked
    up in the library.
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
    """Return a frame after its poses and their reflections were fitted to the contours.

    The cheapest of them becomes the frame's pose.

    Args:
        task: The task of the search.
        frame: The result of the search, with a posterior if several poses are likely.
        observation: The masks.
        evaluations: The number of evaluations, from `polish_evaluations`.
        beta: The weight `beta` of the cost.

    Returns:
        The frame, with the evaluations of the search and of polishing.
    """
    scene = task.body, task.cameras, observation.silhouettes

    def cost(poses: Array, places: Array) -> Array:
        return pose_costs(*scene, poses, places, beta)[0]

    # poses of the library are not projected: the prior may be unable to represent them
    modes, looking = looked_up(task, observation)
    count = race_count(evaluations - looking)
    modes = modes[: count // 2]
    poses, places = _likely_poses(task, frame, observation)
    poses = np.concatenate([*(mode.poses[:1] for mode in modes), poses])[:count]
    places = np.concatenate([*(mode.translations[:1] for mode in modes), places])
    places = places[:count]
    place = frame.translation[None]
    views = [
        MaskContours.of(camera, view, [observation], place, POINT_SPACING)
        for view, camera in enumerate(task.cameras)
    ]
    start = poses, places
    poses, places, used = contour_race(
        task.body,
        views,
        start,
        precisions(SEARCH_TURN, SEARCH_SHIFT),
        cost,
        task.threads,
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
    """Return a warning if a prior cannot represent a pose (66,), or ""."""
    latents = np.clip(prior.transform(pose[None, 3:]), prior.low, prior.high)
    nearest = pose[None].copy()
    nearest[:, 3:] = prior.inverse_transform(latents)
    off = float(poses_apart(skeleton, pose[None], nearest)[0, 0])
    if off <= APART:
        return ""
    return (
        "the prior cannot represent this pose: the nearest that it can represent is "
        f"{1e3 * off:.0f} mm off, so the search had to leave the prior; "
        "--train adds motions with such poses"
    )


def with_one_mode(frame: Frame) -> Frame:
    """Return a frame with its pose as the only mode of its posterior."""
    poses = frame.pose[None]
    posterior = posterior_of(poses, frame.translation[None], np.array([frame.cost]))
    return replace(frame, posterior=posterior)


def _likely_poses(
    task: Task, frame: Frame, observation: Observation
) -> tuple[Array, Array]:
    """Return the likely poses of a search, and others with nearly the same silhouette.

    One camera hardly shows whether a person leans towards it or away, and which leg is
    in front.

    Returns:
        Poses (n, 66) and places (n, 3). Each pose is followed by its reflections; poses
        with exchanged legs or arms come last.
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
