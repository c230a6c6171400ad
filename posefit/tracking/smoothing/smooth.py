"""A track smoothed and fitted to the contours of the masks."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.bodies import ObservedFrames
from posefit.fitting.contours import ROBUST_SCALES
from posefit.fitting.shape import Shape
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.rotation import wrapped
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Areas
from posefit.tracking.smoothing.contours import Borders, fit_contours
from posefit.tracking.smoothing.path import Visibility, smooth_path
from posefit.tracking.trajectory import mean_cost

# Standard deviation of the filter of angles in frames that a single camera sees.
STEADY_SECONDS = 1.0 / 30.0
COMPARED_FRAMES = 300  # frames whose masks are unpacked together


class Smoothed(NamedTuple):
    """Smoothed frames, with the scene and the build that they fit."""

    scene: Scene
    frames: list[Frame]
    shape: Shape | None  # None if the build is known, not fitted


def smooth(
    scene: Scene,
    frames: Sequence[Frame],
    shape: Shape | None,
    beta: float,
    borders: Borders | None = None,
) -> Smoothed:
    """Return the frames of a scene, smoothed.

    Costs and areas are computed again. Posteriors move as far as the pose and the root
    did.

    Args:
        scene: The scene.
        frames: Its tracked frames.
        shape: The person's build if it was fitted, or None if it is known.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        borders: The borders of the scene's masks, if other fits share them.
    """
    visibility = Visibility.of(scene)
    scene, motion, shape = smoothed_motion(
        scene, scene.motion(frames), shape, beta, borders=borders
    )
    # once more, because the contours pull at standing feet
    motion = smooth_path(motion, visibility)
    areas, costs = areas_and_costs(scene, motion, np.arange(len(motion)), beta)
    smoothed = [
        moved(frame, motion.poses[k], motion.translations[k], cost, areas[:, k])
        for k, (frame, cost) in enumerate(zip(frames, costs.tolist(), strict=True))
    ]
    if shape is not None:
        shape = replace(shape, cost=mean_cost(smoothed, visibility.usable))
    return Smoothed(scene, smoothed, shape)


def areas_and_costs(
    scene: Scene, motion: Motion, rows: NDArray[np.int64], beta: float
) -> tuple[Areas, Array]:
    """Return the areas (views, n, 3) and the costs (n,) of some frames of a motion.

    Frames are compared in parts, so that the masks of a long film are not in memory at
    once.

    Args:
        scene: The scene.
        motion: The motion of its body.
        rows: (n,) the frames.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
    """
    areas = list[Areas]()
    costs = list[Array]()
    for start in range(0, len(rows), COMPARED_FRAMES):
        part = rows[start : start + COMPARED_FRAMES]
        observed = ObservedFrames.of(scene.observations[k] for k in part.tolist())
        areas.append(
            observed.areas_of(
                scene.body,
                scene.cameras,
                motion.poses[part],
                motion.translations[part],
            )
        )
        costs.append(observed.costs(areas[-1][:, None], beta)[0])
    return np.concatenate(areas, axis=1), np.concatenate(costs)


def smoothed_motion(
    scene: Scene,
    motion: Motion,
    shape: Shape | None,
    beta: float,
    scales: Sequence[float] = ROBUST_SCALES,
    borders: Borders | None = None,
) -> tuple[Scene, Motion, Shape | None]:
    """Return a motion smoothed and fitted to the contours, with its scene and build.

    Args:
        scene: The scene.
        motion: Its tracked motion.
        shape: The person's build if it was fitted, or None if it is known.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        scales: The reach of each step of the fit, metres.
        borders: The borders of the scene's masks, if other fits share them.
    """
    visibility = Visibility.of(scene)
    return fit_contours(
        scene,
        smooth_path(steadied(motion, visibility), visibility),
        visibility,
        shape,
        beta,
        scales,
        borders,
    )


def steadied(motion: Motion, visibility: Visibility) -> Motion:
    """Return a motion with filtered angles in the frames that a single camera sees.

    The silhouettes of a single camera do not determine the angles, which therefore
    jitter from one frame to the next. The filter is a Gaussian over time.
    """
    from scipy.ndimage import gaussian_filter1d

    angles = gaussian_filter1d(
        np.unwrap(motion.poses, axis=0),
        STEADY_SECONDS * motion.fps,
        axis=0,
        mode="nearest",
    )
    alone = np.isfinite(visibility.viewpoints[:, :1])  # (T, 1)
    return replace(motion, poses=np.where(alone, angles, motion.poses))


def moved(frame: Frame, pose: Array, place: Array, cost: float, areas: Areas) -> Frame:
    """Return a frame at another pose and place, with its cost and areas there."""
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
