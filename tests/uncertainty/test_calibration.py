"""Whether what is said is meant: figures of detectors, by hand."""

import numpy as np
import pytest

from posefit.uncertainty.calibration import (
    Recalibration,
    auroc,
    conformal_factor,
    coverage,
    false_alarms,
    kept_errors,
    reliability,
)
from tests.cases import each

SCORES = np.array([0.9, 0.8, 0.8, 0.4, 0.1])
LOST = np.array([True, False, True, False, False])


def test_coverage_is_the_share_within() -> None:
    assert coverage(np.array([1.0, 2.0, 3.0, 4.0]), np.array([1.0, 1.0, 3.0, 5.0])) == 0.75


def test_auroc_is_the_share_of_pairs_in_order() -> None:
    # 0.9 is above all three; 0.8 above two, and level with one
    assert auroc(SCORES, LOST) == pytest.approx(5.5 / 6)
    assert auroc(np.array([1.0, 1.0]), np.array([True, False])) == 0.5
    assert auroc(SCORES, np.zeros(5, dtype=bool)) is None
    assert auroc(SCORES, np.ones(5, dtype=bool)) is None


def test_false_alarms_are_those_at_the_score_that_finds_so_many() -> None:
    assert false_alarms(SCORES, LOST, 0.5) == 0.0  # one of two is found at 0.9
    assert false_alarms(SCORES, LOST, 0.51) == pytest.approx(1 / 3)  # both at 0.8, which one of three reaches
    assert false_alarms(SCORES, np.zeros(5, dtype=bool), 0.95) is None


def test_errors_of_the_least_doubted_come_first() -> None:
    errors, doubts = np.array([4.0, 1.0, 2.0, 9.0]), np.array([0.3, 0.1, 0.2, 0.4])
    np.testing.assert_allclose(kept_errors(errors, doubts, [0.25, 0.5, 0.75, 1.0]), [1.0, 1.5, 7 / 3, 4.0])
    np.testing.assert_allclose(kept_errors(errors, doubts, [0.01]), [1.0])  # one frame at least


def test_bins_hold_their_own() -> None:
    found = reliability(np.array([0.05, 0.15, 0.19, 1.0]), np.array([False, True, False, True]))
    assert found == [(1, 0.05, 0.0), (2, pytest.approx(0.17), 0.5), (1, 1.0, 1.0)]


@each("figure", [auroc, reliability])
def test_what_does_not_go_together_is_told(figure: object) -> None:
    with pytest.raises(ValueError, match=r"as many entries as there are values, 1 or more, got \(2,\) for \(3,\)"):
        figure(np.zeros(3), np.zeros(2, dtype=bool))  # type: ignore[operator]


def test_what_makes_no_conformal_factor_is_told() -> None:
    with pytest.raises(ValueError, match="scores must be of one clip or more"):
        conformal_factor([], 0.5)
    with pytest.raises(ValueError, match="each with one score or more"):
        conformal_factor([np.zeros(0)], 0.5)
    with pytest.raises(ValueError, match="level must be between 0 and 1, got 1"):
        conformal_factor([np.ones(3)], 1.0)


def test_a_recalibration_is_held_against_its_shapes() -> None:
    assert Recalibration().joint_factors.shape == (3, 27)
    with pytest.raises(ValueError, match=r"angle_spreads must have shape \(66,\), got \(27,\)"):
        Recalibration(angle_spreads=np.zeros(27))
    with pytest.raises(ValueError, match="joint_spreads must be finite and 0 or more, got -1 to -1"):
        Recalibration(joint_spreads=-np.ones(27))
    with pytest.raises(ValueError, match=r"second_side must lie in 0 to 1, got 1\.5"):
        Recalibration(second_side=1.5)
    with pytest.raises(ValueError, match=r"none must lie in 0 to 1, got -0\.1"):
        Recalibration(none=-0.1)


def test_a_recalibration_comes_back_from_a_file() -> None:
    one = Recalibration(joint_spreads=np.arange(27.0), second_side=0.3)
    again = Recalibration(**one.as_dict())
    np.testing.assert_array_equal(again.joint_spreads, one.joint_spreads)
    assert again.second_side == 0.3
