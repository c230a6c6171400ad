"""Scores of the niching task by hand: peak ratio, Brier score, log score."""

import numpy as np
import pytest

from posefit.niching import brier_score, log_score, peak_ratio, shares

DISTANCES = np.array([[10.0, 90.0, 200.0], [20.0, 80.0, 200.0], [70.0, 50.0, 200.0]])  # three reported, three known


def test_the_peak_ratio_is_the_share_of_known_poses_that_were_found() -> None:  # CEC2013 (peak ratio)
    assert peak_ratio(DISTANCES, 15.0) == pytest.approx(1 / 3)
    assert peak_ratio(DISTANCES, 49.0) == pytest.approx(1 / 3)
    assert peak_ratio(DISTANCES, 50.0) == pytest.approx(2 / 3)
    assert peak_ratio(DISTANCES, 200.0) == pytest.approx(2 / 3)  # no reported pose has the third as its nearest
    assert peak_ratio(np.empty((0, 3)), 60.0) == 0.0
    assert peak_ratio(np.array([[30.0, 40.0]]), 60.0) == 0.5  # a reported pose speaks for its nearest one alone


def test_weights_near_a_known_pose_are_added_up() -> None:
    assert shares(DISTANCES, np.array([0.5, 0.2, 0.3]), 60.0) == pytest.approx([0.7, 0.3, 0.0])
    assert shares(DISTANCES, np.array([0.5, 0.2, 0.3]), 15.0) == pytest.approx([0.5, 0.0, 0.0])


def test_the_brier_score_counts_what_is_near_none_of_them() -> None:  # BRIER1950 (score)
    assert brier_score(np.array([1.0, 0.0]), 0) == 0.0
    assert brier_score(np.array([0.0, 1.0]), 0) == 2.0
    assert brier_score(np.array([0.0, 0.0]), 0) == 2.0
    assert brier_score(np.array([0.5, 0.5]), 1) == pytest.approx(0.5)
    assert brier_score(np.array([0.6, 0.1]), 0) == pytest.approx(0.16 + 0.01 + 0.09)


def test_the_log_score_is_bounded_where_the_true_pose_was_not_found() -> None:
    assert log_score(np.array([0.25, 0.5]), 0) == pytest.approx(np.log(4.0))
    assert log_score(np.array([0.0, 1.0]), 0) == pytest.approx(np.log(1000.0))
    assert log_score(np.array([0.0, 1.0]), 1) == 0.0
