"""The costs of a frame, the posterior and mirror costs that it reports, and poses fitted to its contours."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posefit import Observation, Silhouette, facing, mirrored_poses, reflected_poses
from posefit.fitting.contours import fitted, precisions
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from posefit_exemplars.calibration import recalibrated, stored_calibration
from posefit_exemplars.frame_costs import FrameCosts
from tests.cases import each
from tests.exemplars.conftest import EMPTY, Walk, walk_of


def recalibration(cost: float, usable: bool = True) -> Recalibration:
    frame_costs: Any = SimpleNamespace(
        skeleton=average_skeleton(), camera_count=1, usable=usable
    )
    samples = Posterior(
        0.1 * np.random.default_rng(0).standard_normal((24, 66)),
        np.zeros((24, 3)),
        np.ones(24),
    )
    return recalibrated(samples, np.zeros(66), cost, frame_costs).recalibration


def test_expected_errors_grow_with_the_cost_and_are_largest_for_hidden_joints() -> None:
    good = recalibration(2.0)
    bad = recalibration(20.0)
    assert (bad.joint_spreads[1:] > good.joint_spreads[1:]).all()
    greatest = (
        math.exp(stored_calibration().range[1]) * stored_calibration().joint_spreads
    )
    for cost in (0.0, 5.0):
        np.testing.assert_allclose(
            recalibration(cost, usable=False).joint_spreads, greatest
        )


@each("views", [(45.0,), (45.0, 135.0)])
def test_mirror_costs_are_the_costs_of_the_mirrored_and_reflected_poses(
    views: tuple[float, ...],
) -> None:
    walk = walk_of(built_in.motion("walk-a", frames=1), views)
    frame_costs = FrameCosts(walk.task, walk.observations[0])
    skeleton = walk.motion.skeleton
    pose = walk.motion.poses[0]
    place = walk.motion.translations[0]
    reflected = [
        reflected_poses(skeleton, pose[None], facing(camera, place))
        for camera in walk.task.cameras
    ]
    images = [mirrored_poses(skeleton, pose[None]), *reflected]
    expected = [frame_costs.cost_and_areas(image[0], place)[0] for image in images]
    np.testing.assert_allclose(frame_costs.mirror_costs(pose, place), expected)


def test_a_mirror_image_of_an_aligned_pose_is_aligned_too() -> None:
    walk = walk_of(built_in.motion("walk-a", frames=1)).aligned()
    frame_costs = FrameCosts(walk.task, walk.observations[0])
    pose = walk.motion.poses[0]
    # as if smoothing had moved it
    place = walk.motion.translations[0] + [0.02, -0.01, 0.0]
    poses = np.concatenate(
        [pose[None], mirrored_poses(walk.motion.skeleton, pose[None])]
    )
    placed = frame_costs.aligned(poses, np.repeat(place[None], 2, axis=0))
    moved = placed[1] + place - placed[0]
    assert frame_costs.mirror_costs(pose, place)[0] == pytest.approx(
        frame_costs.cost_and_areas(poses[1], moved)[0]
    )


def test_frames_report_their_mirror_costs_and_recalibration_and_count_the_evaluations(
    walker: Walk,
) -> None:
    observations = [*walker.observations[:2], Observation(EMPTY, None, usable=False)]
    walk = replace(walker, observations=observations)
    sampled = walk.track(samples=4)
    others = walk.track(samples=5)
    for frame, other, observation in zip(
        sampled[:2], others, observations, strict=False
    ):
        np.testing.assert_array_equal(frame.pose, other.pose)
        assert len(frame.posterior) == 4
        assert frame.posterior.coherent
        expected = FrameCosts(walk.task, observation).mirror_costs(
            frame.pose, frame.translation
        )
        np.testing.assert_allclose(frame.details["mirror_costs"], expected, atol=1e-9)
    assert len(sampled[2].details["mirror_costs"]) == 0
    assert sampled[2].evaluations == 1
    for frame in sampled:
        assert frame.posterior.recalibration.sharpness == stored_calibration().sharpness


def test_the_depth_is_unknown_where_one_camera_alone_shows_the_person() -> None:
    walk = walk_of(built_in.motion("walk", frames=3), (0.0, 90.0))
    (first, second), shown = walk.task.cameras, walk.observations[0].silhouettes
    unknown = Silhouette.of(
        np.zeros((120, 160), dtype=bool), np.zeros((120, 160), dtype=bool)
    )
    for cameras, silhouettes, position in (
        ((first, second), shown, None),
        ((first, second), [unknown, unknown], None),
        ((first, second), [unknown, shown[1]], second.position),
        ((first,), shown[:1], first.position),
    ):
        task = replace(walk.task, cameras=cameras)
        observation = replace(walk.observations[0], silhouettes=silhouettes)
        np.testing.assert_array_equal(
            FrameCosts(task, observation).camera_position, position
        )


def test_without_a_contour_a_pose_goes_to_its_mean(walker: Walk) -> None:
    poses = walker.motion.poses[:5]
    places = walker.motion.translations[:5]
    means = poses + 0.1 * walker.motion.skeleton.free
    contours = FrameCosts(
        walker.task, replace(walker.observations[0], silhouettes=EMPTY)
    ).contours(places[0])
    precision = precisions(np.radians(8.0), 0.003)
    moved, shifted = fitted(
        walker.task.body, contours, (poses, places), means, precision, (0.09,)
    )
    np.testing.assert_allclose(moved, means, atol=1e-9)
    np.testing.assert_allclose(shifted, places, atol=1e-12)
