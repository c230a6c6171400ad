"""Paired t tests, Holm and the runs needed, against scipy and sums by hand."""

import math
from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from posefit.statistics.paired import holm, paired_tests
from tests.cases import each
from tests.statistics.studies import studies, with_lost_runs


def block(runners):
    """Return rows of blocks as errors (methods, blocks, 1)."""
    return np.asarray(runners, dtype=float).T[:, :, None]


def test_a_difference_by_hand():
    # differences -1, -2, ..., -8: mean -4.5, standard deviation sqrt(6), so t = 4.5 sqrt(8 / 6) = 5.196152,
    # whose two-sided p with 7 degrees of freedom is 0.0013
    (pair,) = paired_tests(block([[0.0, k] for k in range(1, 9)]))
    assert (pair.first, pair.second, pair.difference) == (0, 1, -4.5)
    assert pair.p_value == pair.adjusted == 2.0**-7  # what eight signs can give
    # t of 7 degrees of freedom at 97.5 % is 2.364624: any table
    reach = 2.364624 * math.sqrt(6.0 / 8.0)
    assert (pair.low, pair.high) == pytest.approx((-4.5 - reach, -4.5 + reach))


def test_tests_are_scipys_and_holm_is_over_all_pairs():
    errors = np.random.default_rng(3).gamma(2.0, size=(5, 4, 6))
    runs = errors.reshape(5, -1)
    expected = [
        stats.ttest_rel(runs[first], runs[second]).pvalue
        for first, second in combinations(range(5), 2)
    ]
    made = paired_tests(errors)
    assert [pair.p_value for pair in made] == pytest.approx(expected)
    # Holm by hand: the k-th lowest of ten times ten minus its place, never less than an earlier one
    adjusted = dict.fromkeys(range(10), 0.0)
    largest = 0.0
    for place, k in enumerate(np.argsort(expected).tolist()):
        largest = max(largest, min(1.0, (10 - place) * expected[k]))
        adjusted[k] = largest
    assert [pair.adjusted for pair in made] == pytest.approx([*adjusted.values()])


@pytest.mark.parametrize("blocks", [1, 2, 5, 6, 12])
def test_p_is_at_least_the_p_of_a_sign_test(blocks):
    errors = block([[0.1 * k, 0.1 * k + 1.0] for k in range(blocks)])
    (pair,) = paired_tests(errors)
    assert pair.p_value == min(1.0, 2.0 / 2.0**blocks)
    assert math.isnan(pair.low) == (blocks < 6)


def test_an_interval_excludes_0_exactly_if_the_adjusted_p_is_below_5_percent():
    rng = np.random.default_rng(11)
    shown = 0
    for _ in range(40):
        offsets = rng.normal(0.0, 0.7, 5)[:, None, None]
        for pair in paired_tests(rng.normal(size=(5, 4, 4)) + offsets):
            excludes = pair.low > 0.0 or pair.high < 0.0
            assert excludes == (pair.adjusted < 0.05)
            shown += excludes
    assert 40 < shown < 360


def test_intervals_are_at_holms_levels():
    # of three differences the clearest is judged at a third of 5 %, the next one at half of it, the last one at 5 %
    errors = np.random.default_rng(2).normal(size=(3, 24, 1))
    errors += np.array([0.0, 0.6, 1.0])[:, None, None]
    made = sorted(paired_tests(errors), key=lambda pair: pair.p_value)
    ps = [pair.p_value for pair in made]
    assert 2.0 / 2**24 < 3 * ps[0] < 2 * ps[1] < ps[2]
    runs = errors[:, :, 0]
    for level, pair in zip((0.05 / 3, 0.05 / 2, 0.05), made, strict=True):
        values = runs[pair.first] - runs[pair.second]
        expected = stats.ttest_1samp(values, 0.0).confidence_interval(1.0 - level)
        assert (pair.low, pair.high) == pytest.approx(tuple(expected))


def test_methods_that_are_equal_differ_by_nothing():
    (pair,) = paired_tests(np.ones((2, 3, 3)))
    assert (pair.difference, pair.p_value, pair.low, pair.high) == (0.0, 1.0, 0.0, 0.0)
    assert pair.blocks_needed == math.inf


def test_the_blocks_needed_by_hand():
    # standard deviation 4 and difference 2: ((1.959964 + 0.841621) 4 / 2)^2 = 31.4
    values = np.array([6.0, -2.0, 2.0, 2.0])
    values = 2.0 + (values - 2.0) * 4.0 / values.std(ddof=1)
    (pair,) = paired_tests(block([[value, 0.0] for value in values]))
    assert pair.blocks_needed == 32
    # three pairs at a third of the level: 2 / 2^n is below 0.05 / 3 from seven blocks on
    clear = block([[0.1 * k, 0.1 * k + 1.0, 0.1 * k + 9.0] for k in range(4)])
    assert [pair.blocks_needed for pair in paired_tests(clear)] == [7, 7, 7]


def test_the_blocks_needed_show_a_difference_in_four_studies_of_five():
    rng = np.random.default_rng(4)
    shown = 0
    for _ in range(1000):
        # ((1.96 + 0.84) / 0.5)^2 = 31.4 blocks of differences with a mean of half a standard deviation
        differences = rng.normal(0.5, 1.0, 32)
        (pair,) = paired_tests(np.stack([differences, np.zeros(32)])[:, :, None])
        shown += pair.p_value < 0.05
    assert 0.75 <= shown / 1000 <= 0.84


@pytest.mark.parametrize("lost", [0.0, 0.15, 0.3])
def test_false_alarms_are_rare_whether_runs_are_lost_or_not(lost):
    rng = np.random.default_rng(6)
    count = 1500
    first, second = (
        studies(with_lost_runs(lost), (8, 3), count, rng) for _ in range(2)
    )
    alarms = 0
    for pair in zip(first, second, strict=True):
        (made,) = paired_tests(np.stack(pair))
        alarms += made.p_value < 0.05
    # 5 %, by chance off by 0.6
    assert alarms / count <= 0.065


def test_false_alarms_of_all_pairs_together_are_rare():
    rng = np.random.default_rng(7)
    alarms = 0
    for _ in range(600):
        errors = np.stack(
            [studies(with_lost_runs(0.15), (8, 3), 1, rng)[0] for _ in range(6)]
        )
        alarms += min(pair.adjusted for pair in paired_tests(errors)) < 0.05
    assert alarms / 600 <= 0.075  # 5 %, by chance off by 0.9


def test_holm_by_hand():
    assert holm([0.01, 0.04, 0.03]).tolist() == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.5, 0.6]).tolist() == [1.0, 1.0]
    assert holm([]).tolist() == []


@each(
    ("errors", "message"),
    [
        (np.ones((1, 3, 2)), r"errors must have shape .*at least \(2, 1, 1\), got"),
        ([[[1.0]], [[np.inf]]], "errors must be finite, got 1 that are not"),
    ],
)  # fmt: skip
def test_invalid_errors_are_refused(errors, message):
    with pytest.raises(ValueError, match=message):
        paired_tests(errors)
