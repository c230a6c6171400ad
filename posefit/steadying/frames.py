"""What a tracker found, steadied and fitted to the borders of the masks, and what it then costs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.shape import Shape
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.rotation import wrapped
from posefit.motion.motion import Motion
from posefit.searching.spent import mean_cost
from posefit.silhouette.cost import only_camera, pose_costs
from posefit.steadying.outlines import outlined
from posefit.steadying.path import SeenFrames, steadied
from posefit.uncertainty.modes import Posterior


def steadied_frames(
    scene: Scene, found: Sequence[Frame], beta: float, shape: Shape | None = None
) -> tuple[list[Frame], Shape | None]:
    """Return what was found in the frames of a scene, steadied, and the build fitted with it.

    The build stays the scene's where it was not fitted before (`shape` is None). Costs and areas are those of what is
    told then, and what else a frame may be goes with it as far as the pose and the root went.
    """
    poses = np.array([frame.pose for frame in found])
    motion = Motion(scene.name, scene.body.skeleton, poses, np.array([frame.translation for frame in found]), scene.fps)
    usable = np.array([observation.usable for observation in scene.observations])
    seen = SeenFrames(usable, np.array([_eye(scene, observation) for observation in scene.observations]))
    told, shape = outlined(scene, steadied(motion, seen), seen, shape, beta)
    told = steadied(told, seen)  # borders pull at feet that stand
    scene = scene if shape is None else replace(scene, body=shape.body)
    frames = [_told(scene, k, frame, told, beta) for k, frame in enumerate(found)]
    if shape is not None:
        shape = replace(shape, cost=mean_cost(frames, usable))
    return frames, shape


def _eye(scene: Scene, observation: Observation) -> Array:
    """Return where the only camera stands (3,) that sees anything; NaN where several do, or none."""
    only = only_camera(scene.cameras, observation.silhouettes)
    return np.full(3, np.nan) if only is None else only.position


def _told(scene: Scene, k: int, frame: Frame, motion: Motion, beta: float) -> Frame:
    pose, place, silhouettes = motion.poses[k], motion.translations[k], scene.observations[k].silhouettes
    costs, counts = pose_costs(scene.body, scene.cameras, silhouettes, pose[None], place[None], beta)
    posterior = frame.posterior
    if posterior is not None:
        posterior = _moved(posterior, wrapped(pose - frame.pose), place - frame.translation)
    told = replace(frame, pose=pose, translation=place, cost=float(costs[0]), areas=counts[:, 0])
    return replace(told, coordinates=None, posterior=posterior)


def _moved(posterior: Posterior, turn: Array, way: Array) -> Posterior:
    return replace(posterior, poses=posterior.poses + turn, translations=posterior.translations + way)
