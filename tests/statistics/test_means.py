"""The mean of stratified, clustered values, worked by hand."""

import doctest
import math

import numpy as np
import pytest
from scipy import stats

import posefit.statistics.means
import posefit.statistics.paired
from posefit.statistics.means import mean_interval, run_means
from tests.cases import each
from tests.statistics.studies import DRAWS, SHAPES, coverage, shown_coverage


def test_one_stratum_of_single_values_gives_students_interval() -> None:
    interval = mean_interval([1.0, 2.0, 3.0, 4.0], [0] * 4, range(4))
    assert interval.value == 2.5
    # t of 3 degrees of freedom at 97.5 %: any table
    reach = 3.182446 * math.sqrt(5.0 / 3.0 / 4.0)
    assert (interval.low, interval.high) == pytest.approx((2.5 - reach, 2.5 + reach))


def test_differences_between_strata_do_not_widen_it() -> None:
    # of each of two strata: 2 / (2 - 1) * (1 + 1) / 4^2 = 0.25, with 1 degree of freedom; of both 0.5, with
    # 0.5^2 / (0.25^2 + 0.25^2) = 2 of them, of which t at 97.5 % is 4.302653
    interval = mean_interval(
        [0.0, 2.0, 100.0, 102.0], ["a", "a", "b", "b"], [0, 1, 0, 1]
    )
    assert interval.value == 51.0
    assert interval.high - interval.value == pytest.approx(4.302653 * math.sqrt(0.5))


def test_equal_values_of_a_cluster_count_once() -> None:
    once = mean_interval([1.0, 3.0, 8.0], [0] * 3, [0, 1, 2])
    assert vars(
        mean_interval([1.0, 1.0, 3.0, 3.0, 8.0, 8.0], [0] * 6, [0, 0, 1, 1, 2, 2])
    ) == pytest.approx(vars(once))


def test_one_cluster_gives_no_interval_and_equal_values_one_of_no_width() -> None:
    alone = mean_interval([1.0, 2.0, 5.0], [0, 0, 1], [0, 1, 0])
    assert alone.value == pytest.approx(8.0 / 3.0)
    assert np.isnan([alone.low, alone.high]).all()
    assert tuple(vars(mean_interval([2.0, 2.0], [0, 0], [0, 1])).values()) == (
        2.0,
        2.0,
        2.0,
    )


def test_the_interval_holds_the_truth_at_its_level() -> None:
    rng = np.random.default_rng(0)
    strata = np.repeat(np.arange(4), 10)
    clusters = np.tile(np.repeat(np.arange(5), 2), 4)
    inside = 0
    for _ in range(400):
        drawn = (
            np.repeat(rng.normal(size=(4, 5)), 2)
            + 0.3 * rng.normal(size=40)
            + 3.0 * strata
        )
        interval = mean_interval(drawn, strata, clusters)
        inside += interval.low <= 4.5 <= interval.high
    assert 0.92 <= inside / 400 <= 0.98


def test_unequal_lengths_and_values_that_are_not_finite_are_refused() -> None:
    with pytest.raises(
        ValueError,
        match=r"strata and clusters must have shape \(2,\), got \(1,\) and \(2,\)",
    ):
        mean_interval([1.0, 2.0], [0], [0, 1])
    with pytest.raises(ValueError, match="values must be finite"):
        mean_interval([1.0, math.nan], [0, 0], [0, 1])


STUDIES = 4000  # by chance the share that hold the truth is off by 0.35 %


@pytest.mark.parametrize("shape", SHAPES)
def test_intervals_of_runs_hold_the_truth(shape: tuple[int, int]) -> None:
    for kind, (draw, mean) in DRAWS.items():
        assert 0.92 <= coverage(draw, mean, shape, STUDIES) <= 0.98, kind


@pytest.mark.parametrize("shape", SHAPES)
def test_intervals_shown_with_few_lost_runs_contain_the_truth(
    shape: tuple[int, int],
) -> None:
    for share in (0.05, 0.15, 0.3):
        assert shown_coverage(share, shape, STUDIES) >= 0.93, share


def test_examples_of_docstrings() -> None:
    for module in (posefit.statistics.means, posefit.statistics.paired):
        done = doctest.testmod(module)
        assert (done.attempted > 0, done.failed) == (True, 0)


def test_an_interval_of_runs_is_satterthwaites_of_two_instances_by_hand() -> None:
    # variances of the instances' means: 2 / 4 and 8 / 4; of the mean of both (0.5 + 2) / 4 = 0.625, with
    # 2.5^2 / (0.5^2 / 3 + 2^2 / 3) = 4.411765 degrees of freedom
    first = [1.0, 1.0, 3.0 + math.sqrt(0.5), 3.0 - math.sqrt(0.5)]
    deviations = np.array(first) - 2.0
    deviations *= math.sqrt(2.0 / np.var(first, ddof=1))
    means = run_means([[2.0 + deviations, 6.0 + 2.0 * deviations]])
    assert means.values[0] == pytest.approx(4.0)
    reach = stats.t.ppf(0.975, 4.411765) * math.sqrt(0.625)
    assert means.high[0] - 4.0 == pytest.approx(reach)
    assert 4.0 - means.low[0] == pytest.approx(reach)


def test_differences_between_instances_do_not_widen_the_interval_of_runs() -> None:
    runs = np.random.default_rng(1).normal(size=(1, 8, 10))
    apart = runs + 1000.0 * np.arange(8)[:, None]
    near, far = (run_means(errors) for errors in (runs, apart))
    assert far.high - far.low == pytest.approx(near.high - near.low)


def test_one_seed_or_fewer_than_eight_runs_give_no_interval() -> None:
    for errors in ([[[1.0], [3.0]]], np.ones((1, 20, 1)), np.ones((1, 3, 2))):
        means = run_means(errors)
        assert np.isnan([means.low[0], means.high[0]]).all()
    assert run_means(np.ones((1, 4, 2))).low[0] == 1.0


@each(
    ("errors", "message"),
    [
        (np.ones((2, 3)), r"must have shape \(methods, instances, seeds\), got \(2, 3\)"),
        (np.ones((2, 0, 3)), r"must have shape .*, got \(2, 0, 3\)"),
        ([[[1.0, np.nan]]], "errors must be finite, got 1 that are not"),
    ],
)  # fmt: skip
def test_invalid_errors_are_refused(errors: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        run_means(errors)  # type: ignore[arg-type]
