"""What a tracker found, steadied, and what it then costs."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.fitting.problem import over_views
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.motion.motion import Motion
from posefit.silhouette.cost import areas
from posefit.steadying.path import SeenFrames, steadied


def steadied_frames(scene: Scene, found: Sequence[Frame], beta: float) -> list[Frame]:
    """Return what was found in the frames of a scene, steadied; costs and areas are those of what is told then."""
    poses = np.array([frame.pose for frame in found])
    motion = Motion(scene.name, scene.body.skeleton, poses, np.array([frame.translation for frame in found]), scene.fps)
    usable = np.array([observation.usable for observation in scene.observations])
    eye = scene.cameras[0].position if len(scene.cameras) == 1 else None
    told = steadied(motion, SeenFrames(usable, eye))
    return [_told(scene, k, frame, told, beta) for k, frame in enumerate(found)]


def _told(scene: Scene, k: int, frame: Frame, motion: Motion, beta: float) -> Frame:
    pose, place, silhouettes = motion.poses[k], motion.translations[k], scene.observations[k].silhouettes
    counts = [
        areas(scene.body, camera, silhouette, pose[None], place[None])
        for camera, silhouette in zip(scene.cameras, silhouettes, strict=True)
    ]
    cost = float(over_views(counts, silhouettes, beta)[0])
    return replace(frame, pose=pose, translation=place, cost=cost, areas=np.concatenate(counts), coordinates=None)
