"""The interquartile mean, and how often its interval holds the truth."""

import numpy as np
import pytest
from scipy import stats

from posefit.statistics import intervals
from posefit.statistics.intervals import iqm, iqm_intervals
from tests.cases import each
from tests.statistics.studies import DRAWS, studies, truth

# of 399 pivots ten lie beyond each end of a 95 % interval; more change what it holds by
# 0.1 %
RESAMPLES = 399
SLOW = [
    pytest.param(kind, seeds, 2000, 0.03, marks=pytest.mark.slow)
    for kind in DRAWS
    for seeds in (5, 10, 20)
]


@pytest.mark.parametrize(
    ("kind", "seeds", "count", "off"),
    # by chance it is off by 0.016, or 0.005
    [("normal", 5, 200, 0.05), ("with lost runs", 10, 200, 0.05), *SLOW],
)
def test_intervals_hold_the_truth(kind, seeds, count, off):
    true = truth(kind)
    rng = np.random.default_rng(12)
    inside = 0
    for errors in studies(kind, seeds, count, rng):
        interval = iqm_intervals(errors, rng, resamples=RESAMPLES)
        inside += interval.low[0] <= true <= interval.high[0]
    assert 0.95 - off <= inside / count <= min(0.95 + off, 0.98)


def test_iqm_is_the_mean_of_the_middle_half():
    # eight runs: two at either end are left out, and 3, 4, 5, 9 are not
    assert iqm([[[100.0, 5.0, 1.0, 4.0], [3.0, 9.0, 50.0, 2.0]]])[0] == 5.25
    errors = np.random.default_rng(0).gamma(2.0, size=(3, 5, 7))
    assert np.allclose(
        iqm(errors), [stats.trim_mean(runs.ravel(), 0.25) for runs in errors]
    )


def test_the_standard_error_is_scipys_of_a_trimmed_mean_for_one_instance():
    runs = np.random.default_rng(5).normal(size=(1, 1, 40))
    mean, error = intervals._estimate(runs)
    assert mean[0] == pytest.approx(stats.trim_mean(runs.ravel(), 0.25))
    assert error[0] == pytest.approx(
        stats.mstats.trimmed_stde(runs.ravel(), (0.25, 0.25), (True, True)), rel=1e-6
    )


def test_each_instance_has_a_resample_of_its_own():
    # the same runs in each of 16 instances: with one resample for all of them the mean would vary four times as much
    runs = np.tile(np.random.default_rng(4).normal(size=40), (1, 16, 1))
    interval = iqm_intervals(runs, np.random.default_rng(2))
    error = intervals._estimate(runs)[1][0]
    assert 2 * 1.6 * error < interval.high[0] - interval.low[0] < 2 * 2.6 * error


def test_differences_between_instances_do_not_widen_the_interval():
    apart = (
        np.random.default_rng(1).normal(size=(1, 8, 10))
        + 1000.0 * np.arange(8)[:, None]
    )
    interval = iqm_intervals(apart, np.random.default_rng(2))
    # the middle four of eight instances
    assert interval.values[0] == pytest.approx(apart[0, 2:6].mean())
    assert interval.high[0] - interval.low[0] < 1.0


def test_the_same_generator_gives_the_same_interval_whatever_other_methods_there_are():
    errors = np.random.default_rng(0).gamma(2.0, size=(3, 4, 6))
    both, alone = (
        iqm_intervals(part, np.random.default_rng(7)) for part in (errors, errors[1:2])
    )
    assert (both.low[1], both.high[1]) == (alone.low[0], alone.high[0])


def test_a_method_without_chance_has_an_interval_of_no_width():
    interval = iqm_intervals(np.full((1, 3, 4), 0.1), np.random.default_rng(0))
    assert (
        interval.low[0] == interval.values[0] == interval.high[0] == pytest.approx(0.1)
    )


def test_few_runs_give_a_finite_interval_within_the_runs():
    interval = iqm_intervals(
        [[[1.0, 2.0, 1.5, 3.0, 2.5, 1.0, 2.0, 8.0]]], np.random.default_rng(0)
    )
    assert interval.values[0] == 2.0  # the mean of 1.5, 2, 2, 2.5
    assert 1.0 <= interval.low[0] < 2.0 < interval.high[0] <= 8.0


def test_one_seed_or_fewer_than_eight_runs_give_no_interval():
    # by the formula the middle half, 0.88 and 1.1, would have no spread within its instances, and the interval no width
    for errors, value in ([[0.84, 0.88], [1.1, 1.17]], 0.99), ([[1.0], [3.0]], 2.0):
        interval = iqm_intervals([errors], np.random.default_rng(0))
        assert interval.values[0] == pytest.approx(value)
        assert np.isnan([interval.low[0], interval.high[0]]).all()


@each(
    ("errors", "settings", "message"),
    [
        (
            np.ones((2, 3)),
            {},
            r"errors must have shape \(methods, instances, seeds\), got \(2, 3\)",
        ),
        (
            np.ones((2, 0, 3)),
            {},
            r"errors must have shape \(methods, instances, seeds\), got \(2, 0, 3\)",
        ),
        ([[[1.0, np.nan]]], {}, "errors must be finite, got 1 that are not"),
        (
            np.ones((1, 2, 2)),
            {"resamples": 99},
            "resamples must be at least 100, got 99",
        ),
    ],
)
def test_invalid_errors_and_settings_are_refused(errors, settings, message):
    with pytest.raises(ValueError, match=message):
        iqm_intervals(errors, np.random.default_rng(0), **settings)
