"""The frames that wait to be told, joined as the tracker joins them."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit_exemplars.beam import Beam
from posefit_exemplars.window import SIMILAR, FrameStates, frame_states, mean_near, state_weights, viterbi_state


def beam(count: int) -> Beam:
    return Beam(np.arange(count), np.zeros(count), np.full(count, -1), np.zeros(count), np.zeros((count, 3)))


def window(fits: list[list[float]], steps: list[Array]) -> list[FrameStates]:
    """Return frames of these costs, joined by these."""
    found = [frame_states(beam(len(fits[0])), np.array(fits[0]), None, None)]
    for fit, step in zip(fits[1:], steps, strict=True):
        found.append(frame_states(beam(len(fit)), np.array(fit), found[-1], step))
    return found


def test_a_first_frame_knows_only_what_it_saw() -> None:
    one = frame_states(beam(3), np.array([5.0, 5.0 + np.log(3.0), 5.0]), None, None)
    np.testing.assert_allclose(one.forward, [3 / 7, 1 / 7, 3 / 7])
    np.testing.assert_allclose(one.beam.totals, [0.0, np.log(3.0), 0.0])
    assert one.beam.parents.tolist() == [-1, -1, -1]
    assert one.kernel is None


def test_what_comes_later_decides_what_was() -> None:
    # two strides that look alike, until the second one's next pose is not seen: each costs 9 to change
    strides = np.array([[0.0, 9.0], [9.0, 0.0]])
    alike = window([[0.0, 0.1], [0.2, 0.0]], [strides])
    assert viterbi_state(alike[:1]) == 0
    told = window([[0.1, 0.0], [0.2, 0.0], [0.0, 5.0]], [strides, strides])
    assert viterbi_state(told[:1]) == viterbi_state(told[:2]) == 1
    assert viterbi_state(told) == 0
    assert state_weights(told)[0] > 0.9 > 0.5 > state_weights(told[:2])[0]


def test_weights_of_a_single_frame_are_what_it_saw() -> None:
    one = window([[0.0, np.log(4.0)]], [])
    np.testing.assert_allclose(state_weights(one), [0.8, 0.2])


def test_nothing_underflows_where_a_jump_costs_a_thousand() -> None:
    # as `jump` may be set: nobody may change, and silhouettes say that somebody did
    frames = window([[0.0, 2000.0], [2000.0, 0.0], [0.0, 2000.0]], [np.full((2, 2), 1000.0)] * 2)
    for count in (1, 2, 3):
        found = state_weights(frames[:count])
        assert np.isfinite(found).all()
        assert found.sum() == pytest.approx(1.0)


def test_the_mean_is_of_poses_that_are_like_the_path_and_of_no_others() -> None:
    poses = np.zeros((3, 66))
    poses[:, 5] = [0.0, 0.1, 2.0]
    places = np.array([[0.0, 1.0, 0.0], [0.3, 1.0, 0.0], [9.0, 9.0, 9.0]])
    codes = np.array([[0.0], [SIMILAR], [100.0]], dtype=np.float32)
    pose, place, code = mean_near(0, np.array([0.2, 0.4, 0.4]), codes, poses, places)
    share = 0.4 * np.exp(-0.5) / (0.2 + 0.4 * np.exp(-0.5))
    assert pose[5] == pytest.approx(0.1 * share)
    np.testing.assert_allclose(place, [0.3 * share, 1.0, 0.0])
    assert code[0] == pytest.approx(SIMILAR * share)


def test_a_mean_of_yaws_goes_the_short_way_round() -> None:
    poses = np.zeros((2, 66))
    poses[:, 0] = np.radians([179.0, -179.0])
    codes, places = np.zeros((2, 1), dtype=np.float32), np.zeros((2, 3))
    pose, _, _ = mean_near(0, np.array([0.5, 0.5]), codes, poses, places)
    # the other is two degrees away, a tenth of a standard deviation
    other = np.exp(-0.5 * 0.1**2)
    assert np.degrees(pose[0]) == pytest.approx(179.0 + 2.0 * other / (1.0 + other))


def test_a_path_that_has_no_weight_is_told_nevertheless() -> None:
    poses, places = np.eye(2, 66), np.eye(2, 3)
    codes = np.array([[0.0], [100.0]], dtype=np.float32)
    pose, place, _ = mean_near(0, np.array([0.0, 1.0]), codes, poses, places)
    np.testing.assert_allclose(pose, poses[0])
    np.testing.assert_allclose(place, places[0])
