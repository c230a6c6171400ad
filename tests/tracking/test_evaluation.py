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
from posefit.tracking.measures import Measures

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


def tracked(scene: Scene, shaken_mm: float = 0.0) -> Measures:
    """Return what the true track of a walk is worth, whose root goes up and down by so much from frame to frame."""
    truth = scene.truth
    assert truth is not None
    collected = Evaluation(scene, None, truth.poses[:, 3:], 0.5)
    for k in range(len(truth)):
        place = truth.translations[k] + [0.0, 0.5e-3 * shaken_mm * (-1) ** k, 0.0]
        collected.add(found(scene, truth.poses[k], place, scene.observations[k]), scene.observations[k])
    return collected.close()[1]


def test_a_track_tells_how_joints_accelerate_and_feet_slide_beside_the_truths_own() -> None:
    scene = synthetic(built_in.motion("walk", frames=40), [45.0], (64, 48), [], (None, None))
    exact, shaken = tracked(scene), tracked(scene, shaken_mm=10.0)
    assert exact.acceleration_ratio == 1.0
    assert exact.acceleration is not None
    assert shaken.acceleration is not None
    # to go up and down by 10 mm thirty times a second is a second difference of 20 mm
    assert shaken.acceleration == pytest.approx(0.02 * 900.0, rel=0.2)
    assert shaken.acceleration_ratio == pytest.approx(shaken.acceleration / exact.acceleration)
    assert exact.foot_slide_mm is not None
    assert shaken.foot_slide_mm == pytest.approx(exact.foot_slide_mm)  # up and down is along no ground


def test_a_track_of_one_frame_has_neither_acceleration_nor_step() -> None:
    scene = synthetic(built_in.motion("walk", frames=1), [45.0], (64, 48), [], (None, None))
    told = tracked(scene)
    assert told.acceleration is None
    assert told.acceleration_ratio is None
    assert told.foot_slide_mm is None
