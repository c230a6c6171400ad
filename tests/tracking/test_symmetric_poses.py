"""Twins of a pose: proposals whose silhouettes are about the same."""

from dataclasses import replace

import numpy as np

from posefit.fitting.prior import Tilt
from posefit.geometry.symmetry import facing
from posefit.motion import built_in
from posefit.testing.problem import pose_problem
from posefit.tracking.modes import proposals_of, symmetric_proposals
from tests.tracking.test_modes import side_view


def test_proposals_of_decoded_poses_are_those_that_were_decoded() -> None:
    problem = pose_problem()
    motions = [built_in.motion(name) for name in built_in.other_styles("walk")]
    tilt = Tilt.of(problem.space.prior, motions, 0.99, 0.1)
    for space in (
        problem.space,
        replace(problem.space, translation="searched"),
        replace(problem.space, tilt=tilt),
    ):
        some = 0.9 * np.random.default_rng(0).uniform(-1.0, 1.0, (5, space.dimensions))
        np.testing.assert_allclose(proposals_of(space, *space.decode(some)), some, atol=1e-9)


def test_a_twin_seen_from_the_side_is_the_other_stride_and_fits_as_well() -> None:
    problem, truth, other = side_view()
    mine = proposals_of(problem.space, truth[None], problem.space.anchor[None])
    found = symmetric_proposals(problem, mine[0])
    assert len(found) == 1  # whoever is turned faces out of the box
    joints = problem.body.skeleton.joints(np.stack([truth, other, problem.decode(found)[0][0]]))
    joints -= joints[:, :1]
    away = np.linalg.norm(joints[:2] - joints[2], axis=2).mean(axis=1)
    assert away[1] < 0.3 * away[0]
    costs = problem.evaluate(np.concatenate([mine, found]))
    assert costs[1] < costs[0] + 10.0


def test_all_round_somebody_is_turned_and_reflected() -> None:
    problem, truth, _ = side_view()
    camera = problem.cameras[0]
    space = replace(problem.space, root_range=np.array([np.pi, 0.3, 0.3]))
    yaw = facing(camera, space.anchor) + 0.3
    pose = np.concatenate([[yaw], truth[1:]])
    found = symmetric_proposals(replace(problem, space=space), proposals_of(space, pose[None], space.anchor[None])[0])
    yaws = space.coordinates(found)[:, 0]
    # who comes, turned by 0.3 to one side, goes by as much to the same side; or has turned round
    expected = np.array([2.0 * facing(camera, space.anchor) + np.pi - yaw, yaw + np.pi])
    np.testing.assert_allclose(np.cos(yaws - expected), 1.0, atol=1e-9)
