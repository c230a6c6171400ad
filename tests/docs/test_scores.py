"""Scores of detectors, by hand."""

import numpy as np
import pytest

from scores import auroc, false_alarms, kept_errors

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
