"""Scores of detectors, by hand."""

import numpy as np
import pytest

from scores import auroc, calibration_error, conformal_factor, false_alarms, kept_errors

SCORES = np.array([0.9, 0.8, 0.8, 0.4, 0.1])
LOST = np.array([True, False, True, False, False])


def test_auroc_is_the_share_of_pairs_in_order() -> None:
    # 0.9 is above all three; 0.8 above two, and level with one
    assert auroc(SCORES, LOST) == pytest.approx(5.5 / 6)
    assert auroc(np.array([1.0, 1.0]), np.array([True, False])) == 0.5
    assert auroc(SCORES, np.zeros(5, dtype=bool)) is None
    assert auroc(SCORES, np.ones(5, dtype=bool)) is None


def test_false_alarms_are_negatives_at_the_score_of_a_recall() -> None:
    assert false_alarms(SCORES, LOST, 0.5) == 0.0  # one of two at 0.9
    assert false_alarms(SCORES, LOST, 0.51) == pytest.approx(1 / 3)  # both at 0.8, as one of three negatives
    assert false_alarms(SCORES, np.zeros(5, dtype=bool), 0.95) is None


def test_kept_errors_are_means_of_the_frames_with_the_least_scores() -> None:
    errors, scores = np.array([4.0, 1.0, 2.0, 9.0]), np.array([0.3, 0.1, 0.2, 0.4])
    means = kept_errors(errors, scores, [0.01, 0.25, 0.5, 0.75, 1.0])
    np.testing.assert_allclose(means, [1.0, 1.0, 1.5, 7 / 3, 4.0])


def test_clips_count_alike_and_the_one_to_come_as_infinitely_far() -> None:
    # three clips: 1, 2 | 3 | 4. Each weighs a quarter, shared by its scores; the last quarter is the new clip's
    scores = [np.array([2.0, 1.0]), np.array([3.0]), np.array([4.0])]
    assert conformal_factor(scores, 0.125) == 1.0
    assert conformal_factor(scores, 0.2) == 2.0
    assert conformal_factor(scores, 0.5) == 3.0
    assert conformal_factor(scores, 0.6) == 4.0  # of the three that are known alone 3 would be enough
    assert conformal_factor(scores, 0.75) == 4.0
    with pytest.raises(ValueError, match=r"clips must be at least 4 for a level of 0\.8, got 3"):
        conformal_factor(scores, 0.8)
    for clips, level, message in (
        ([], 0.5, "scores must be of one clip or more"),
        ([np.zeros(0)], 0.5, "each with one score or more"),
        ([np.ones(3)], 1.0, "level must be between 0 and 1, got 1"),
    ):
        with pytest.raises(ValueError, match=message):
            conformal_factor(clips, level)


def test_conformal_factors_hold_for_clips_that_were_not_there() -> None:
    # errors of a clip go together: a factor of its own times a normal one. 19 clips to learn from, one to come
    rng, inside = np.random.default_rng(0), []
    for _ in range(400):
        clips = [np.exp(0.5 * rng.normal()) * np.abs(rng.normal(size=30)) for _ in range(20)]
        inside.append((clips[-1] <= conformal_factor(clips[:-1], 0.8)).mean())
    assert 0.78 <= np.mean(inside) <= 0.85  # at least the level, at most a twentieth above it


def test_the_calibration_error_is_the_mean_gap_of_the_bins() -> None:
    # bins of 0.5: (0.2, 0.4) are right once of two, off by 0.2; (0.9, 0.7, 1.0) always, off by 2.6 / 3 - 1
    probabilities = np.array([0.2, 0.4, 0.9, 0.7, 1.0])
    right = np.array([True, False, True, True, True])
    assert calibration_error(probabilities, right, bins=2) == pytest.approx((2 * 0.2 + 3 * (1 - 2.6 / 3)) / 5)
    assert calibration_error(np.array([0.0, 1.0]), np.array([False, True])) == 0.0
