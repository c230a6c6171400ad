"""The frames of the lag window, joined as the tracker joins them."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit_exemplars.beam import Beam
from posefit_exemplars.window import SIMILAR, FrameStates, SampledPaths, frame_states, mean_near, state_weights


def window(fits: list[list[float]], steps: list[Array]) -> list[FrameStates]:
    """Return frames with these costs of fit, joined by these costs of steps."""
    frames: list[FrameStates] = []
    for k, fit in enumerate(fits):
        many = len(fit)
        beam = Beam(np.arange(many), np.zeros(many), np.full(many, -1), np.zeros(many), np.zeros((many, 3)))
        frames.append(frame_states(beam, np.array(fit), frames[-1] if k else None, steps[k - 1] if k else None))
    return frames


def test_weights_are_finite_where_a_jump_costs_a_thousand() -> None:
    frames = window([[0.0, 2000.0], [2000.0, 0.0], [0.0, 2000.0]], [np.full((2, 2), 1000.0)] * 2)
    for count in (1, 2, 3):
        weights = state_weights(frames[:count])
        assert np.isfinite(weights).all()
        assert weights.sum() == pytest.approx(1.0)


def test_the_mean_is_of_states_similar_to_the_path() -> None:
    poses = np.zeros((3, 66))
    poses[:, 5] = [0.0, 0.1, 2.0]
    places = np.array([[0.0, 1.0, 0.0], [0.3, 1.0, 0.0], [9.0, 9.0, 9.0]])
    codes = np.array([[0.0], [SIMILAR], [100.0]], dtype=np.float32)
    pose, place, code = mean_near(0, np.array([0.2, 0.4, 0.4]), codes, poses, places)
    share = 0.4 * np.exp(-0.5) / (0.2 + 0.4 * np.exp(-0.5))
    assert pose[5] == pytest.approx(0.1 * share)
    np.testing.assert_allclose(place, [0.3 * share, 1.0, 0.0])
    assert code[0] == pytest.approx(SIMILAR * share)
    # a state on the path counts even where it has no weight
    pose, place, _ = mean_near(2, np.array([0.5, 0.5, 0.0]), codes, poses, places)
    np.testing.assert_allclose([*pose, *place], [*poses[2], *places[2]])


def test_a_mean_of_yaws_goes_the_short_way_round() -> None:
    poses = np.zeros((2, 66))
    poses[:, 0] = np.radians([179.0, -179.0])
    codes, places = np.zeros((2, 1), dtype=np.float32), np.zeros((2, 3))
    pose, _, _ = mean_near(0, np.array([0.5, 0.5]), codes, poses, places)
    other = np.exp(-0.5 * 0.1**2)  # two degrees away, a tenth of a standard deviation
    assert np.degrees(pose[0]) == pytest.approx(179.0 + 2.0 * other / (1.0 + other))


def test_sampled_paths_similar_to_the_likeliest_are_moved_to_the_reported_pose() -> None:
    poses, places = np.zeros((3, 66)), np.arange(9.0).reshape(3, 3)
    poses[:, 0] = [0.1, 0.3, 3.0]
    pose, place = np.full(66, 0.5), np.array([1.0, 1.0, 1.0])
    posterior = SampledPaths(poses, places, np.array([True, True, False])).about(pose, place)
    np.testing.assert_allclose(posterior.poses[:2].mean(axis=0), pose)
    assert posterior.poses[1, 0] - posterior.poses[0, 0] == pytest.approx(0.2)
    np.testing.assert_allclose(posterior.translations[:2], [[-0.5, -0.5, -0.5], [2.5, 2.5, 2.5]])
    np.testing.assert_array_equal(posterior.poses[2], poses[2])
    np.testing.assert_array_equal(posterior.translations[2], places[2])
    assert posterior.coherent
    far = SampledPaths(poses, places, np.zeros(3, dtype=bool)).about(pose, place)
    np.testing.assert_array_equal(far.poses, poses)
