"""Traces, running times and profiles, worked by hand."""

import numpy as np
import pytest

from posefit.statistics.profiles import (
    attained,
    expected_running_time,
    hits,
    performance_profile,
)
from tests.cases import each


def trace(evaluations, costs):
    return np.array(evaluations, dtype=float), np.array(costs, dtype=float)


QUICK = trace([1, 10, 100], [8.0, 4.0, 2.0])
SLOW = trace([10, 200], [8.0, 3.0])


def test_a_target_is_hit_where_the_cost_is_first_as_low():
    assert hits(QUICK, [9.0, 8.0, 7.9, 4.0, 2.0, 1.9]).tolist() == [
        1.0,
        1.0,
        10.0,
        10.0,
        100.0,
        np.inf,
    ]
    assert hits(trace([1, 2, 3], [5.0, 5.0, 5.0]), [5.0]).tolist() == [1.0]


def test_attained_is_the_share_of_runs_and_targets():
    # 1, 10, 100 and 10, 200, never
    evaluations = [hits(run, [8.0, 4.0, 2.5]) for run in (QUICK, SLOW)]
    assert attained(evaluations, [1, 10, 150, 1e9]).tolist() == [
        1 / 6,
        3 / 6,
        4 / 6,
        5 / 6,
    ]


def test_expected_running_time_counts_the_evaluations_of_failed_runs():
    evaluations = [[10.0, 40.0, np.inf], [20.0, np.inf, np.inf]]
    # 30 / 2; (40 + 60) / 1; never
    assert expected_running_time(evaluations, [50, 60]).tolist() == [
        15.0,
        100.0,
        np.inf,
    ]
    # a run hits after 30 of its 100 evaluations with probability 1/4: 3 failures of 100 on average, then 30
    assert expected_running_time([[30.0]] + [[np.inf]] * 3, [100] * 4).tolist() == [
        330.0
    ]


def test_a_profile_counts_runs_within_each_level():
    errors = [[[1.0, 2.0], [3.0, 4.0]], [[5.0, 5.0], [5.0, 5.0]]]
    assert performance_profile(errors, [0.5, 1.0, 3.5, 5.0]).tolist() == [
        [0.0, 0.25, 0.75, 1.0],
        [0.0, 0.0, 0.0, 1.0],
    ]


@each(
    ("call", "message"),
    [
        (
            lambda: attained([np.nan, 1.0], [1]),
            "hits must be numbers or inf, got 1 nan of 2",
        ),
        (
            lambda: expected_running_time([[1.0]], [1, 2]),
            r"hits must have shape \(2, targets\), got \(1, 1\)",
        ),
        (
            lambda: expected_running_time([[9.0]], [5]),
            "hits must be within a run's evaluations or inf, got a later",
        ),
    ],
)
def test_invalid_traces_and_hits_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
