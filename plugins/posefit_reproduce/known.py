"""Tracks of built-in motions, whose truth is known: their scene, the task of following them, and their errors."""

from collections.abc import Sequence

import numpy as np

from posefit.fitting import metrics
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.body import Body
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions

SIZE = (320, 240)  # pixels
FRAMES = 60  # at 30 a second


def known_scene(motion: str, views_degrees: Sequence[float]) -> Scene:
    """Return the scene of a built-in motion, seen by one camera a view."""
    return synthetic(built_in.motion(motion, frames=FRAMES), views_degrees, SIZE, [], (None, None))


def known_task(scene: Scene, options: TrackOptions, body: Body, translation: Translation = "known") -> Task:
    """Return the task of following a scene with a body that need not be the true one."""
    training = [built_in.motion(style) for style in built_in.other_styles(scene.name)]
    return Task(body, scene.cameras, options.budget, scene.yaw, scene.anchor, translation, training=training)


def follow_known(task: Task, options: TrackOptions, observations: Sequence[Observation], seed: int) -> list[Frame]:
    """Return the frames of a track."""
    return list(prepare(options, task).tracker(task).track(observations, np.random.default_rng(seed)))


def known_errors(scene: Scene, frames: Sequence[Frame]) -> dict[str, float]:
    """Return figures of a track under their names in `posefit.tracking.measures`, but of the error the mean alone."""
    truth = _truth(scene)
    poses = np.array([frame.pose for frame in frames])
    joints = [scene.body.skeleton.joints(p) for p in (truth.poses, poses)]
    mpjpe = metrics.mpjpe_mm(*joints)
    return {
        "error_degrees": float(metrics.pose_error_degrees(truth.poses, poses).mean()),
        "mpjpe_mm": float(mpjpe.mean()),
        "lost_rate": float(metrics.lost_rate(mpjpe)),
        "swap_rate": float(metrics.swap_rate(*joints)),
    }


def mean_pose_degrees(scene: Scene, task: Task) -> float:
    """Return the error in degrees of the mean training pose, given the true root: what anybody reaches."""
    truth = _truth(scene)
    poses = np.column_stack([truth.poses[:, :3], np.tile(task.angles.mean(axis=0), (len(truth), 1))])
    return float(metrics.pose_error_degrees(truth.poses, poses).mean())


def _truth(scene: Scene) -> Motion:
    if scene.truth is None:
        raise ValueError(f"a scene must be of a known motion, got {scene.name}, whose truth nobody knows")
    return scene.truth
