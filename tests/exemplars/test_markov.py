"""The frames of the lag window, joined as the tracker joins them, and the filter of estimates over time."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from posefit.arrays import Array
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.markov import (
    SampledPaths,
    frame_states,
    mean_near,
    state_weights,
)
from posefit_exemplars.smoothing import smoothed, smoothed_pose
from tests.cases import each


def test_weights_are_finite_where_a_jump_costs_a_thousand() -> None:
    frames = [frame_states(np.array([0.0, 2000.0]))]
    jumps = np.full((2, 2), 1000.0)
    for costs in ([2000.0, 0.0], [0.0, 2000.0]):
        frames.append(frame_states(np.array(costs), frames[-1], jumps))
    for count in (1, 2, 3):
        weights = state_weights(frames[:count])
        assert np.isfinite(weights).all()
        assert weights.sum() == pytest.approx(1.0)


def test_sampled_paths_similar_to_the_likeliest_are_moved_to_the_reported_pose() -> (
    None
):
    poses = np.zeros((3, 66))
    places = np.arange(9.0).reshape(3, 3)
    poses[:, 0] = [0.1, 0.3, 3.0]
    pose = np.full(66, 0.5)
    place = np.array([1.0, 1.0, 1.0])
    posterior = SampledPaths(poses, places, np.array([True, True, False])).about(
        pose, place
    )
    np.testing.assert_allclose(posterior.poses[:2].mean(axis=0), pose)
    assert posterior.poses[1, 0] - posterior.poses[0, 0] == pytest.approx(0.2)
    np.testing.assert_allclose(
        posterior.translations[:2], [[-0.5, -0.5, -0.5], [2.5, 2.5, 2.5]]
    )
    np.testing.assert_array_equal(posterior.poses[2], poses[2])
    np.testing.assert_array_equal(posterior.translations[2], places[2])
    assert posterior.coherent
    far = SampledPaths(poses, places, np.zeros(3, dtype=bool)).about(pose, place)
    np.testing.assert_array_equal(far.poses, poses)


def estimate(pose: Array, place: Array, root: Array | None = None) -> Estimate:
    costs: Any = SimpleNamespace(root=root)
    return Estimate(pose, place, costs, 0.0, (pose[None], place[None]))


def steady(k: float) -> Estimate:
    """Return frame k of a steady movement."""
    return estimate(np.full(66, 0.05 * k), np.array([0.1 * k, 1.0, -k]))


@each("ahead", [0, 1, 3, 6])
def test_a_steady_movement_stays_in_its_order(ahead: int) -> None:
    frames = list(smoothed((steady(k) for k in range(15)), 2.0, ahead))
    assert len(frames) == 15
    for k, frame in enumerate(frames):
        np.testing.assert_allclose(frame.pose, steady(k).pose, atol=1e-12)
        np.testing.assert_allclose(frame.place, steady(k).place, atol=1e-12)


def test_means_of_yaws_go_the_short_way_round() -> None:
    poses = np.zeros((2, 66))
    places = np.zeros((2, 3))
    poses[:, 0] = np.radians([179.0, -179.0])
    # the other one is a tenth of a standard deviation away
    squares = np.array([0.0, 0.1**2])
    pose, _ = mean_near(0, np.array([0.5, 0.5]), squares, poses, places)
    other = np.exp(-0.5 * 0.1**2)
    assert np.degrees(pose[0]) == pytest.approx(179.0 + 2.0 * other / (1.0 + other))
    poses = np.insert(poses, 1, np.pi * np.eye(66)[0], axis=0)
    assert np.cos(
        smoothed_pose(poses, np.zeros((3, 3)), 1, 1.5)[0][0]
    ) == pytest.approx(-1.0)


def test_estimates_stay_unchanged_without_smoothing_and_with_a_known_root() -> None:
    rng = np.random.default_rng(0)
    rough = [
        estimate(rng.normal(size=66), rng.normal(size=3), np.zeros(3)) for _ in range(6)
    ]
    for spread, ahead in ((2.0, 0), (0.0, 3), (2.0, 2)):
        for before, frame in zip(rough, smoothed(rough, spread, ahead), strict=True):
            np.testing.assert_array_equal(frame.place, before.place)
            if spread * ahead == 0.0:
                np.testing.assert_array_equal(frame.pose, before.pose)
