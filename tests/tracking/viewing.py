"""Tracks to look at: a walk whose frames are right, and say what they are not sure of."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.skeleton import JOINTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.tracking import method
from posefit.tracking.outputs import OutputFolder
from posefit.tracking.pipeline import track_scene
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from tests.tracking.test_evaluation import frame_of

SPREAD = Recalibration(joint_spreads=np.full(len(JOINTS), 0.02))
SIZE = (320, 240)


@dataclass(frozen=True)
class Said:
    """A tracker that says what it was given."""

    frames: Sequence[Frame]

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        for k, _ in enumerate(observations):
            yield self.frames[k]


def walk(frames: int, views: Sequence[float] = (45.0,)) -> Scene:
    return synthetic(built_in.motion("walk", frames=frames), views, SIZE, [], (None, None))


def right(scene: Scene) -> list[Frame]:
    """Return frames that are right, and say nothing of how sure they are."""
    truth = scene.truth
    assert truth is not None
    seen = scene.observations
    return [frame_of(scene, truth.poses[k], truth.translations[k], seen[k]) for k in range(scene.count)]


def doubting(scene: Scene, mirrored: Sequence[float]) -> list[Frame]:
    """Return frames that are right, and say with such weights that they are mirrored."""
    frames = []
    for frame, weight in zip(right(scene), mirrored, strict=True):
        other = mirrored_poses(scene.body.skeleton, frame.pose[None])[0]
        places, weights = np.tile(frame.translation, (2, 1)), np.array([1.0 - weight, weight])
        posterior = Posterior(np.array([frame.pose, other]), places, weights, False, SPREAD)
        frames.append(replace(frame, posterior=posterior))
    return frames


def viewed(folder: Path, scene: Scene, frames: Sequence[Frame]) -> Path:
    """Return the viewer of a track that finds just these frames."""
    with pytest.MonkeyPatch.context() as patch, OutputFolder(folder, False, False, {}, print) as output:
        patch.setattr(method.Method, "tracker", lambda *_: Said(frames))
        track_scene(scene, [built_in.motion("walk-b", frames=20)], output=output)
    return folder / "track.html"
