"""Baselines that anybody can reach, and errors where the body that is told is not the person's."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene, synthetic
from posefit.footage.training import training_clips
from posefit.geometry.body import varied
from posefit.motion import built_in
from posefit.silhouette.cost import areas
from posefit.tracking import evaluation
from posefit.tracking.evaluation import Evaluation, nearest

FRAMES = 4


def walk(size: tuple[int, int] = (320, 240)) -> Scene:
    return synthetic(built_in.motion("walk", frames=FRAMES), [45.0, 135.0], size, [], (None, None))


def found(scene: Scene, pose: Array, translation: Array, observation: Observation) -> Frame:
    """Return the frame of a tracker that says a pose."""
    seen = zip(scene.cameras, observation.silhouettes, strict=True)
    counted = np.array([areas(scene.body, one, mask, pose[None], translation[None])[0] for one, mask in seen])
    return Frame(pose, translation, 0.0, counted, 1, 1.0, np.zeros(1))


@pytest.mark.parametrize("size", [(320, 240), (64, 48)])
def test_of_many_poses_the_nearest_is_the_one_that_looking_at_all_finds(
    size: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    training = np.concatenate([clip(30.0).poses[:, 3:] for clip in training_clips(["library:02,16"])])
    monkeypatch.setattr(evaluation, "MANY", len(training) - 1)
    scene = walk(size)
    narrowed = [nearest(scene, training, k, scene.observations[k]) for k in range(FRAMES)]
    monkeypatch.setattr(evaluation, "MANY", len(training))
    assert np.array_equal(narrowed, [nearest(scene, training, k, scene.observations[k]) for k in range(FRAMES)])


def test_baselines_are_told_in_millimetres_too() -> None:
    scene = walk()
    truth = scene.truth
    assert truth is not None
    training = np.concatenate([truth.poses[:1, 3:], truth.poses[:1, 3:]])
    collected = Evaluation(scene, None, training, 0.5)
    for k in range(FRAMES):
        seen = scene.observations[k]
        collected.add(found(scene, truth.poses[k], truth.translations[k], seen), seen)
    _, measures = collected.close()
    told = measures.baselines_mm
    assert told is not None
    joints = [scene.body.skeleton.joints(poses) for poses in (truth.poses, np.tile(truth.poses[0], (FRAMES, 1)))]
    assert told["persistence"] == pytest.approx(metrics.mpjpe_mm(*joints).mean(), abs=1e-6)
    assert told["mean_pose"] == told["nearest"]  # of two poses that are one
    assert told["nearest"] > 0.0
    assert measures.mpjpe_mm == 0.0


def test_the_truth_has_its_own_bones_whatever_body_was_told() -> None:
    exact = walk()
    scene = replace(exact, body=varied(exact.body, 10.0, np.random.default_rng(1)))
    truth = exact.truth
    assert truth is not None
    collected = Evaluation(scene, None, truth.poses[:, 3:], 0.5)
    for k in range(FRAMES):
        seen = scene.observations[k]
        collected.add(found(scene, truth.poses[k], truth.translations[k], seen), seen)
    _, measures = collected.close()
    joints = [body.skeleton.joints(truth.poses) for body in (exact.body, scene.body)]
    assert measures.mpjpe_mm == pytest.approx(metrics.mpjpe_mm(*joints).mean(), abs=1e-6)
    assert measures.mpjpe_mm > 1.0
    assert measures.error_degrees is not None
    assert measures.error_degrees.mean == 0.0
