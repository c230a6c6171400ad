"""Tracks of synthetic people whose truth is known, spoilt or seen as a study asks."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.body import Body
from posefit.motion import library
from posefit.silhouette.corruption import corrupted
from posefit.silhouette.mask import Silhouette
from posefit.tracking.method import Choice, prepare

SIZE = (320, 240)
SALT = 2010  # part of every seed that spoils something


@dataclass(frozen=True, eq=False)
class Spoilt(Sequence[Observation]):
    """Observations with corruptions of some strength, and a share of the frames dropped; the same each time."""

    observations: Sequence[Observation] = field(repr=False)
    noise: dict[str, float]
    dropped: float
    seed: int

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        seen = self.observations[k]
        rng = np.random.default_rng([SALT, self.seed, k])
        lost = k > 0 and rng.random() < self.dropped
        masks = [corrupted(silhouette.mask, self.noise, rng) for silhouette in seen.silhouettes]
        return replace(seen, silhouettes=[Silhouette.of(mask) for mask in masks], usable=not lost)

    def __iter__(self) -> Iterator[Observation]:
        return (self[k] for k in range(len(self)))


def scene_of(motion: str, views_degrees: Sequence[float], frames: int = 60) -> Scene:
    """Return the scene of a built-in motion, seen by one camera a view."""
    return synthetic(library.built_in(motion, frames=frames), views_degrees, SIZE, [], (None, None))


def task_of(scene: Scene, choice: Choice, body: Body, **changes: Any) -> Task:
    """Return the task of following a scene with a body that need not be the true one."""
    assert scene.truth is not None
    training = [library.built_in(style) for style in library.other_styles(scene.name)]
    made = Task(body, scene.cameras, choice.budget(), scene.yaw, scene.anchor, training=training)
    return replace(made, **changes)


def measured(scene: Scene, frames: Sequence[Frame]) -> dict[str, float]:
    """Return the error in degrees, the MPJPE in millimetres and the share of lost frames of a track."""
    truth = scene.truth
    assert truth is not None
    poses = np.array([frame.pose for frame in frames])
    joints = [scene.body.skeleton.joints(p) for p in (truth.poses, poses)]
    mpjpe = metrics.mpjpe_mm(*joints)
    return {
        "error_degrees": float(metrics.pose_error_degrees(truth.poses, poses).mean()),
        "mpjpe_mm": float(mpjpe.mean()),
        "lost": float(metrics.lost_rate(mpjpe)),
        "swapped": float(metrics.swap_rate(*joints)),
    }


def followed(task: Task, choice: Choice, observations: Sequence[Observation], seed: int) -> list[Frame]:
    """Return the frames of a track."""
    return list(prepare(choice, task).tracker(task).track(observations, np.random.default_rng(seed)))


def mean_error(scene: Scene, task: Task) -> float:
    """Return the error in degrees of the mean training pose, given the true root: what anybody reaches."""
    truth = scene.truth
    assert truth is not None
    angles = np.concatenate([motion.poses[:, 3:] for motion in task.training]).mean(axis=0)
    poses = np.column_stack([truth.poses[:, :3], np.tile(angles, (len(truth), 1))])
    return float(metrics.pose_error_degrees(truth.poses, poses).mean())
