"""Recalibrations and bins of probabilities."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from posefit.uncertainty.calibration import Recalibration, reliability
from tests.cases import each


def test_reliability_is_by_bins() -> None:
    bins = reliability(np.array([0.05, 0.15, 0.19, 1.0]), np.array([False, True, False, True]))
    assert bins == [(1, 0.05, 0.0), (2, pytest.approx(0.17), 0.5), (1, 1.0, 1.0)]


@each(
    ("make", "message"),
    [
        (lambda: Recalibration(angle_spreads=np.zeros(27)), r"angle_spreads must have shape \(66,\), got \(27,\)"),
        (lambda: Recalibration(joint_spreads=-np.ones(27)), "joint_spreads must be 0 or more, got -1"),
        (lambda: Recalibration(second_side=1.5), r"second_side must lie in 0 to 1, got 1\.5"),
        (lambda: Recalibration(none=-0.1), r"none must lie in 0 to 1, got -0\.1"),
        (lambda: Recalibration(sharpness=0.0), "sharpness must lie in 1e-09 to 1e"),
    ],
)
def test_wrong_corrections_are_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def test_a_recalibration_is_the_same_after_saving() -> None:
    before = Recalibration(joint_spreads=np.arange(27.0), second_side=0.3)
    assert before.joint_factors.shape == (3, 27)
    after = Recalibration(**before.as_dict())
    np.testing.assert_array_equal(after.joint_spreads, before.joint_spreads)
    assert after.second_side == 0.3
