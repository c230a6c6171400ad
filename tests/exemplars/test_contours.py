"""Poses fitted to the contours of one frame's masks, against a slow twin and by law."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.fitting.contours import POINT_SPACING, MaskContours, fitted, precisions
from posefit.geometry.skeleton import ANGLES
from posefit.motion import built_in
from posefit_exemplars.frame_costs import FrameCosts
from tests.cases import each
from tests.exemplars.conftest import EMPTY, Walk, walk_of
from tests.tracking.contour_twin import moved_bodies, pull_of_view

REACHES = (0.09, 0.065, 0.045, 0.045, 0.033, 0.033)
LOOSE = precisions(np.radians(8.0), 0.003)


def off(walk: Walk, k: int, radians: float, seed: int = 0) -> tuple[Array, Array]:
    """Return some poses about the true one of a frame, and the true place for each."""
    poses = np.repeat(walk.motion.poses[k : k + 1], 5, axis=0)
    poses += np.random.default_rng(seed).normal(0.0, radians, poses.shape) * walk.motion.skeleton.free
    return poses, np.repeat(walk.motion.translations[k : k + 1], 5, axis=0)


def step_of_twin(walk: Walk, k: int, pose: Array, place: Array, mean: Array, reach: float) -> Array:
    """Return the step of Gauss and Newton (69,) by the derivatives of a drawn body, number by number."""
    curve, slope = np.diag(LOOSE), LOOSE * np.append(np.zeros(3), pose - mean)
    for number, camera in enumerate(walk.task.cameras):
        view = MaskContours.of(camera, number, [walk.observations[k]], place[None], POINT_SPACING)
        curves, slopes = pull_of_view(view, 0, *moved_bodies(walk.task.body, view.camera, pose, place), reach)
        curve += curves
        slope += slopes
    free = np.append([True] * 3, walk.motion.skeleton.free)
    steps = np.zeros(ANGLES + 3)
    steps[free] = np.linalg.solve(curve[np.ix_(free, free)], slope[free])
    return steps


@pytest.mark.pure
@each("views", [(45.0,), (20.0, 110.0)])
def test_a_step_is_that_of_a_slow_twin(views: tuple[float, ...]) -> None:
    walk = walk_of(built_in.motion("walk-a", frames=2), views)
    poses, places = off(walk, 1, 0.05)
    contours = FrameCosts(walk.task, walk.observations[1]).contours(places[0])
    moved, shifted = fitted(walk.task.body, contours, (poses[:1], places[:1]), poses[1:2], LOOSE, (0.09,))
    expected = step_of_twin(walk, 1, poses[0], places[0], poses[1], 0.09)
    np.testing.assert_allclose(poses[0] - moved[0], expected[3:], atol=2e-4)
    np.testing.assert_allclose(places[0] - shifted[0], expected[:3], atol=2e-5)


@each("views", [(45.0,), (0.0, 45.0, 90.0, 135.0)])
def test_fitted_poses_cost_less_and_the_true_one_stays(views: tuple[float, ...]) -> None:
    walk = walk_of(built_in.motion("walk-a", frames=3), views)
    frame_costs = FrameCosts(walk.task, walk.observations[2])
    poses, places = off(walk, 2, 0.1)
    poses[0] = walk.motion.poses[2]
    moved, _ = fitted(walk.task.body, frame_costs.contours(places[0]), (poses, places), poses, LOOSE, REACHES)
    before, after = frame_costs.full(poses, places), frame_costs.full(moved, places)
    assert after[1:].sum() < 0.6 * before[1:].sum()
    joints = walk.motion.skeleton.joints
    assert np.linalg.norm(joints(moved[0]) - joints(poses[0]), axis=1).mean() < 0.01
    np.testing.assert_array_equal(moved[:, ~walk.motion.skeleton.free], poses[:, ~walk.motion.skeleton.free])


def test_without_a_contour_a_pose_goes_to_its_mean(walker: Walk) -> None:
    poses, places = off(walker, 0, 0.03)
    contours = FrameCosts(walker.task, replace(walker.observations[0], silhouettes=EMPTY)).contours(places[0])
    moved, shifted = fitted(walker.task.body, contours, (poses, places), poses[::-1], LOOSE, (0.09,))
    np.testing.assert_allclose(moved, poses[::-1], atol=1e-9)
    np.testing.assert_allclose(shifted, places, atol=1e-12)
