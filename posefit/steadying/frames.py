"""What a tracker found, steadied, and what it then costs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.problem import only_camera, over_views
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.motion.motion import Motion
from posefit.silhouette.cost import areas
from posefit.steadying.path import SeenFrames, steadied


def steadied_frames(scene: Scene, found: Sequence[Frame], beta: float) -> list[Frame]:
    """Return what was found in the frames of a scene, steadied; costs and areas are those of what is told then."""
    poses = np.array([frame.pose for frame in found])
    motion = Motion(scene.name, scene.body.skeleton, poses, np.array([frame.translation for frame in found]), scene.fps)
    usable = np.array([observation.usable for observation in scene.observations])
    eyes = np.array([_eye(scene, observation) for observation in scene.observations])
    told = steadied(motion, SeenFrames(usable, eyes))
    return [_told(scene, k, frame, told, beta) for k, frame in enumerate(found)]


def _eye(scene: Scene, observation: Observation) -> Array:
    """Return where the only camera stands (3,) that sees anything; NaN where several do, or none."""
    only = only_camera(scene.cameras, observation.silhouettes)
    return np.full(3, np.nan) if only is None else only.position


def _told(scene: Scene, k: int, frame: Frame, motion: Motion, beta: float) -> Frame:
    pose, place, silhouettes = motion.poses[k], motion.translations[k], scene.observations[k].silhouettes
    counts = [
        areas(scene.body, camera, silhouette, pose[None], place[None])
        for camera, silhouette in zip(scene.cameras, silhouettes, strict=True)
    ]
    cost = float(over_views(counts, silhouettes, beta)[0])
    return replace(frame, pose=pose, translation=place, cost=cost, areas=np.concatenate(counts), coordinates=None)
