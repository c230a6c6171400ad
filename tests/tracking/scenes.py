"""A walk, a tracker whose frames are given, and the track and the page that it leads to."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.skeleton import JOINTS
from posefit.geometry.symmetry import mirrored_poses, turned_poses
from posefit.motion import built_in
from posefit.output.folder import OutputFolder, Recorder
from posefit.progress import Progress
from posefit.silhouette.cost import areas
from posefit.tracking import method
from posefit.tracking.defaults import completed
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.tracking.result import Track
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior

SPREAD = Recalibration(joint_spreads=np.full(len(JOINTS), 0.02))
# quantiles of the distance of points that a unit normal scatters
MAXWELL = {"50": 1.5382, "80": 2.1544, "95": 2.7955}
SIZE = (320, 240)


def walk(
    frames: int, views: Sequence[float] = (45.0,), size: tuple[int, int] = SIZE
) -> Scene:
    return synthetic(
        built_in.motion("walk", frames=frames), views, size, [], (None, None)
    )


def masks_of(scene: Scene, view: int = 0) -> list[Array]:
    """Return the masks of a view of a scene."""
    return [observation.silhouettes[view].mask for observation in scene.observations]


def rows_of(
    some: Iterable[Observation], observations: Sequence[Observation]
) -> list[int]:
    """Return the numbers that some of the observations have."""
    return [
        next(k for k, other in enumerate(observations) if other is one) for one in some
    ]


def frame_of(
    scene: Scene, pose: Array, translation: Array, observation: Observation
) -> Frame:
    """Return the frame of a tracker that estimates a pose."""
    views = zip(scene.cameras, observation.silhouettes, strict=True)
    counts = [
        areas(scene.body, camera, mask, pose[None], translation[None])[0]
        for camera, mask in views
    ]
    return Frame(pose, translation, 0.0, np.array(counts), 1)


def exact_frames(scene: Scene, **values: Any) -> list[Frame]:
    """Return frames of the true poses, without posteriors."""
    truth = scene.truth
    each = zip(truth.poses, truth.translations, scene.observations, strict=False)
    return [replace(frame_of(scene, *estimate), **values) for estimate in each]


def uncertain_frames(
    scene: Scene, mirrored: Sequence[float], turned: float = 0.0, coherent: bool = False
) -> list[Frame]:
    """Return frames of the true poses, that may be mirrored or turned with such weights."""
    frames = []
    for frame, weight in zip(exact_frames(scene), mirrored, strict=True):
        pose = frame.pose[None]
        poses = np.concatenate(
            [pose, mirrored_poses(scene.body.skeleton, pose), turned_poses(pose)]
        )
        weights = np.array([1.0 - weight - turned, weight, turned])
        posterior = Posterior(
            poses, np.tile(frame.translation, (3, 1)), weights, coherent, SPREAD
        )
        frames.append(replace(frame, posterior=posterior))
    return frames


def tracked(
    scene: Scene, frames: Sequence[Frame], recorder: Recorder | None = None
) -> Track:
    """Return the track of a scene whose tracker yields just these frames, with its files where there is a folder."""

    def follow(
        make: object,
        audit: object,
        task: Task,
        observations: Iterable[Observation],
        rng: np.random.Generator,
    ) -> Iterator[Frame]:
        # a single one is what a track is begun with
        resumed = len(task.before) if len(task.before) > 1 else 0
        for k, _ in enumerate(observations, resumed):
            yield frames[k]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(method, "drive", follow)
        options = completed(TrackOptions(method="annealed@pca"), scene.truth)
        track = track_scene(
            scene, [built_in.motion("walk-b", frames=20)], options, recorder=recorder
        )
    if recorder is not None:
        recorder.finish(track.content)
    return track


def viewed(folder: Path, scene: Scene, frames: Sequence[Frame]) -> Path:
    """Return the page of a track that consists of just these frames."""
    with OutputFolder(folder, False, False, {}, print) as output:
        tracked(scene, frames, output)
    return folder / "track.html"


def stopping(after: int) -> Progress:
    """Return a progress that ends the program after some frames, of all tracks together."""
    left = iter(range(after))

    def steps(frames: Iterator[Any], _count: int) -> Iterator[Any]:
        for frame in frames:
            if next(left, None) is None:
                raise KeyboardInterrupt
            yield frame

    return Progress(steps=steps)
