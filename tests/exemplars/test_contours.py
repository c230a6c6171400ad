"""Poses fitted to the contours of one frame's masks, against a slow twin and by law."""

from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import fitted, precisions
from posefit.motion import built_in
from posefit_exemplars.frame_costs import FrameCosts
from tests.cases import each
from tests.exemplars.conftest import EMPTY, Walk, walk_of

REACHES = (0.09, 0.065, 0.045, 0.045, 0.033, 0.033)
LOOSE = precisions(np.radians(8.0), 0.003)


def off(walk: Walk, k: int, radians: float, seed: int = 0) -> tuple[Array, Array]:
    """Return some poses about the true one of a frame, and the true place for each."""
    poses = np.repeat(walk.motion.poses[k : k + 1], 5, axis=0)
    poses += np.random.default_rng(seed).normal(0.0, radians, poses.shape) * walk.motion.skeleton.free
    return poses, np.repeat(walk.motion.translations[k : k + 1], 5, axis=0)


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
