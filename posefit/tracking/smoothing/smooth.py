"""A track smoothed and fitted to the contours of the masks."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.bodies import ObservedFrames
from posefit.fitting.contours import ROBUST_SCALES
from posefit.fitting.shape import Shape
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.rotation import wrapped
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Areas
from posefit.tracking.smoothing.contours import fit_contours
from posefit.tracking.smoothing.path import Visibility, smooth_path
from posefit.tracking.trajectory import mean_cost

# standard deviation of the filter of angles that a single camera sees
STEADY_SECONDS = 1.0 / 30.0


class Smoothed(NamedTuple):
    """Smoothed frames, and the scene and the build that they fit, where that was fitted before: else it is known."""

    scene: Scene
    frames: list[Frame]
    shape: Shape | None


def smooth(
    scene: Scene, frames: Sequence[Frame], shape: Shape | None, beta: float
) -> Smoothed:
    """Return the frames of a scene, smoothed.

    Costs and areas are those of the smoothed frames, and their posteriors move as far as the pose and the root did.
    """
    visibility = Visibility.of(scene)
    scene, motion, shape = smoothed_motion(scene, scene.motion(frames), shape, beta)
    motion = smooth_path(motion, visibility)  # contours pull at standing feet
    seen = ObservedFrames.of(scene.observations)
    areas = seen.areas_of(scene.body, scene.cameras, motion.poses, motion.translations)
    costs = seen.costs(areas[:, None], beta)[0].tolist()
    smoothed = [
        _moved(frame, motion.poses[k], motion.translations[k], costs[k], areas[:, k])
        for k, frame in enumerate(frames)
    ]
    if shape is not None:
        shape = replace(shape, cost=mean_cost(smoothed, visibility.usable))
    return Smoothed(scene, smoothed, shape)


def smoothed_motion(
    scene: Scene,
    motion: Motion,
    shape: Shape | None,
    beta: float,
    scales: Sequence[float] = ROBUST_SCALES,
) -> tuple[Scene, Motion, Shape | None]:
    """Return a scene's motion, smoothed and fitted to the contours, with the scene and the build that it fits.

    `scales` has the reach of each step in metres.
    """
    visibility = Visibility.of(scene)
    return fit_contours(
        scene,
        smooth_path(steadied(motion, visibility), visibility),
        visibility,
        shape,
        beta,
        scales,
    )


def steadied(motion: Motion, visibility: Visibility) -> Motion:
    """Return a motion whose angles are filtered over time, by a Gaussian, in the frames that a single camera sees.

    Its silhouettes leave most open, and angles shake from one frame to the next.
    """
    from scipy.ndimage import gaussian_filter1d

    angles = gaussian_filter1d(
        np.unwrap(motion.poses, axis=0),
        STEADY_SECONDS * motion.fps,
        axis=0,
        mode="nearest",
    )
    return replace(
        motion,
        poses=np.where(np.isfinite(visibility.viewpoints[:, :1]), angles, motion.poses),
    )


def _moved(frame: Frame, pose: Array, place: Array, cost: float, areas: Areas) -> Frame:
    """Return a frame at another pose and place, with what it costs there."""
    posterior = frame.posterior
    if posterior is not None:
        poses = posterior.poses + wrapped(pose - frame.pose)
        places = posterior.translations + (place - frame.translation)
        posterior = replace(posterior, poses=poses, translations=places)
    return replace(
        frame,
        pose=pose,
        translation=place,
        cost=cost,
        areas=areas,
        posterior=posterior,
    )
