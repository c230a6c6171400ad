"""The mean of stratified, clustered values, worked by hand."""

import math

import numpy as np
import pytest

from posefit.statistics.means import mean_interval


def test_of_one_stratum_of_single_values_it_is_students_interval() -> None:
    found = mean_interval([1.0, 2.0, 3.0, 4.0], [0] * 4, range(4))
    assert found.value == 2.5
    reach = 3.182446 * math.sqrt(5.0 / 3.0 / 4.0)  # t of 3 degrees of freedom at 97.5 %: any table
    assert (found.low, found.high) == pytest.approx((2.5 - reach, 2.5 + reach))


def test_strata_differ_without_making_it_wider() -> None:
    # of each of two strata: 2 / (2 - 1) * (1 + 1) / 4^2 = 0.25, with 1 degree of freedom; of both 0.5, with
    # 0.5^2 / (0.25^2 + 0.25^2) = 2 of them, of which t at 97.5 % is 4.302653
    found = mean_interval([0.0, 2.0, 100.0, 102.0], ["a", "a", "b", "b"], [0, 1, 0, 1])
    assert found.value == 51.0
    assert found.high - found.value == pytest.approx(4.302653 * math.sqrt(0.5))


def test_values_of_one_cluster_are_no_more_than_one() -> None:
    once = mean_interval([1.0, 3.0, 8.0], [0] * 3, [0, 1, 2])
    assert vars(mean_interval([1.0, 1.0, 3.0, 3.0, 8.0, 8.0], [0] * 6, [0, 0, 1, 1, 2, 2])) == pytest.approx(vars(once))


def test_one_cluster_says_nothing_and_equal_values_leave_no_doubt() -> None:
    alone = mean_interval([1.0, 2.0, 5.0], [0, 0, 1], [0, 1, 0])
    assert alone.value == pytest.approx(8.0 / 3.0)
    assert math.isnan(alone.low)
    assert math.isnan(alone.high)
    assert tuple(vars(mean_interval([2.0, 2.0], [0, 0], [0, 1])).values()) == (2.0, 2.0, 2.0)


def test_it_holds_the_truth_about_as_often_as_it_says() -> None:
    rng = np.random.default_rng(0)
    strata, clusters = np.repeat(np.arange(4), 10), np.tile(np.repeat(np.arange(5), 2), 4)
    held = 0
    for _ in range(400):
        drawn = np.repeat(rng.normal(size=(4, 5)), 2) + 0.3 * rng.normal(size=40) + 3.0 * strata
        found = mean_interval(drawn, strata, clusters)
        held += found.low <= 4.5 <= found.high
    assert 0.92 <= held / 400 <= 0.98


def test_what_is_not_as_long_or_not_finite_is_refused() -> None:
    with pytest.raises(ValueError, match=r"strata and clusters must have shape \(2,\), got \(1,\) and \(2,\)"):
        mean_interval([1.0, 2.0], [0], [0, 1])
    with pytest.raises(ValueError, match="values must be finite"):
        mean_interval([1.0, math.nan], [0, 0], [0, 1])
