"""Traces, targets, running times and profiles, worked by hand."""

import numpy as np
import pytest

from posefit.statistics import profiles
from posefit.statistics.profiles import (
    attained,
    costs_at,
    expected_running_time,
    hits,
    performance_profile,
    ratios,
    trace,
)
from tests.cases import each

QUICK = trace([1, 10, 100], [8.0, 4.0, 2.0])
SLOW = trace([10, 200], [8.0, 3.0])


def test_a_run_has_its_last_cost_until_the_next_one_falls():
    assert costs_at(QUICK, [1, 9, 10, 99, 100, 5000]).tolist() == [8.0, 8.0, 4.0, 4.0, 2.0, 2.0]


def test_a_cost_before_the_trace_starts_is_refused():
    with pytest.raises(ValueError, match="evaluations must be at least 10, where the trace starts, got 9"):
        costs_at(SLOW, [9, 20])


def test_a_target_is_hit_where_the_cost_is_first_as_low():
    assert hits(QUICK, [9.0, 8.0, 7.9, 4.0, 2.0, 1.9]).tolist() == [1.0, 1.0, 10.0, 10.0, 100.0, np.inf]


def test_a_cost_that_stays_counts_from_its_first_evaluation():
    assert hits(trace([1, 2, 3], [5.0, 5.0, 5.0]), [5.0]).tolist() == [1.0]


def test_attained_is_the_share_of_runs_and_targets():
    found = [hits(run, [8.0, 4.0, 2.5]) for run in (QUICK, SLOW)]  # 1, 10, 100 and 10, 200, never
    assert attained(found, [1, 10, 150, 1e9]).tolist() == [1 / 6, 3 / 6, 4 / 6, 5 / 6]


def test_attained_is_the_empirical_distribution_of_a_slow_twin():
    rng = np.random.default_rng(0)
    found = np.where(rng.random((20, 30)) < 0.2, np.inf, rng.integers(1, 50, (20, 30)))
    grid = np.arange(1.0, 60.0)
    twin = [np.mean([[hit <= budget for hit in row] for row in found]) for budget in grid]
    assert np.allclose(attained(found, grid), twin)


def test_expected_running_time_counts_what_failed_runs_used():
    found = [[10.0, 40.0, np.inf], [20.0, np.inf, np.inf]]
    # 30 / 2; (40 + 60) / 1; never
    assert expected_running_time(found, [50, 60]).tolist() == [15.0, 100.0, np.inf]


def test_expected_running_time_is_right_for_a_geometric_number_of_restarts():
    # a run hits after 30 of its 100 evaluations with probability 1/4: 3 failures of 100 on average, then 30
    found = [[30.0]] * 1 + [[np.inf]] * 3
    assert expected_running_time(found, [100] * 4).tolist() == [330.0]


def test_targets_fall_evenly_on_a_log_scale_between_the_first_and_the_last_costs():
    found = profiles.targets([QUICK, trace([5, 6], [32.0, 20.0])], 5)
    assert np.allclose(found, [32.0, 16.0, 8.0, 4.0, 2.0])
    assert hits(QUICK, found[-1:])[0] == 100.0


def test_targets_of_perfect_runs_end_above_zero():
    assert profiles.targets([trace([1, 2], [1.0, 0.0])], 3).tolist() == [1.0, pytest.approx(0.1), 0.01]


def test_the_best_run_hits_the_last_target_to_the_last_bit():
    for cost in np.random.default_rng(0).uniform(0.1, 3.0, 50):
        run = trace([1, 7], [50.0, cost])
        assert hits(run, profiles.targets([run]))[-1] == 7.0


def test_the_common_grid_starts_where_the_last_trace_does_and_ends_where_the_longest_does():
    found = profiles.common_grid([QUICK, SLOW], 4)
    # 10 to 200 in three equal ratios of 2.714
    assert found.tolist() == [10.0, 27.0, 74.0, 200.0]


def test_a_profile_counts_runs_within_each_level():
    errors = [[[1.0, 2.0], [3.0, 4.0]], [[5.0, 5.0], [5.0, 5.0]]]
    assert performance_profile(errors, [0.5, 1.0, 3.5, 5.0]).tolist() == [[0.0, 0.25, 0.75, 1.0], [0.0, 0.0, 0.0, 1.0]]


def test_ratios_are_to_the_best_on_the_same_instance_and_seed():
    found = ratios([[[1.0, 6.0]], [[4.0, 2.0]]])
    assert found.tolist() == [[[1.0, 3.0]], [[4.0, 1.0]]]
    # at ratio 1 a profile says how often a method is the best
    assert performance_profile(found, [1.0]).tolist() == [[0.5], [0.5]]


@each(
    ("call", "message"),
    [
        (lambda: trace([], []), r"evaluations must have shape \(k\), got \(0,\)"),
        (lambda: trace([1, 2], [1.0]), "costs must be one for each of 2 evaluations, got 1"),
        (lambda: trace([0, 2], [1.0, 1.0]), "evaluations must rise from at least 1, got 0, 2"),
        (lambda: trace([2, 2], [1.0, 1.0]), "evaluations must rise from at least 1, got 2, 2"),
        (lambda: trace([1, 2], [1.0, 1.5]), "costs must be the best so far and never rise, got 1, 1.5"),
        (lambda: trace([1, 2], [1.0, np.nan]), "costs must be finite, got 1 that are not"),
        (lambda: profiles.targets([]), "traces and targets must be at least one, got 0 and 51"),
        (lambda: profiles.common_grid([QUICK], 1), "traces must be at least one and points at least 2, got 1 and 1"),
        (lambda: attained([np.nan, 1.0], [1]), "hits must be numbers or inf, got 1 nan of 2"),
        (lambda: expected_running_time([[1.0]], [1, 2]), r"hits must have shape \(2, targets\), got \(1, 1\)"),
        (lambda: expected_running_time([[9.0]], [5]), "hits must be within a run's evaluations or inf, got a later"),
        (lambda: ratios([[[0.0]]]), "errors must be above 0 to be compared by ratio, got 0"),
    ],
)
def test_what_makes_no_sense_is_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
