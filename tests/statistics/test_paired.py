"""Wilcoxon and Holm against scipy and sums by hand."""

from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from posefit.statistics.ranks import holm, wilcoxon
from tests.cases import each


def block(runners):
    """Return rows of blocks as errors (methods, blocks, 1)."""
    return np.asarray(runners, dtype=float).T[:, :, None]


def test_wilcoxon_by_hand():
    # differences -1 to -5: the signed rank is 0, as extreme as it gets, 2 / 2**5
    (pair,) = wilcoxon(
        block([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0], [4.0, 8.0], [5.0, 10.0]])
    )
    assert (pair.first, pair.second, pair.difference) == (0, 1, -3.0)
    assert pair.p_value == pair.adjusted == pytest.approx(0.0625)


def test_a_medians_interval_is_that_of_the_sign_test():
    # of ten ordered differences the second and the ninth: P(at most one of ten below) = 11 / 1024 on either side
    values = np.arange(10.0)
    (pair,) = wilcoxon(np.stack([values, np.zeros(10)])[:, :, None])
    assert (pair.difference, pair.low, pair.high) == (4.5, 1.0, 8.0)
    interval = stats.quantile_test(values, q=0, p=0.5).confidence_interval(0.95)
    assert (pair.low, pair.high) == (interval.low, interval.high)
    # 2 / 2**5 is more than 5 %
    (pair,) = wilcoxon(np.stack([values, np.zeros(10)])[:, :5, None])
    assert np.isnan([pair.low, pair.high]).all()


def test_wilcoxon_is_scipys_and_its_adjustment_holms():
    errors = (
        np.random.default_rng(0).gamma(2.0, size=(4, 3, 5))
        * np.array([1.0, 1.2, 2.0, 3.0])[:, None, None]
    )
    pairs = wilcoxon(errors)
    numbers = list(combinations(range(4), 2))
    assert [(pair.first, pair.second) for pair in pairs] == numbers
    p_values = [
        stats.wilcoxon(errors[a].ravel(), errors[b].ravel()).pvalue for a, b in numbers
    ]
    assert [pair.p_value for pair in pairs] == pytest.approx(p_values)
    assert [pair.adjusted for pair in pairs] == pytest.approx(holm(p_values).tolist())


@each("seed", range(3))
def test_with_ties_and_equal_blocks_wilcoxon_is_scipys_too(seed):
    (pair,) = wilcoxon(
        errors := np.random.default_rng(seed).integers(0, 4, (2, 8, 1)).astype(float)
    )
    assert pair.p_value == pytest.approx(
        stats.wilcoxon(*errors[:, :, 0], zero_method="pratt").pvalue
    )


def test_blocks_without_a_difference_count_against_one():
    (equal,) = wilcoxon(np.ones((2, 3, 3)))
    assert (equal.difference, equal.p_value) == (0.0, 1.0)
    errors = np.zeros((2, 20, 1))
    errors[1, :6, 0] = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    (pair,), (without,) = wilcoxon(errors), wilcoxon(errors[:, :6])
    assert pair.difference == 0.0
    assert pair.p_value != without.p_value


def test_holm_by_hand():
    # in order 0.005, 0.01, 0.03, 0.04 times 4, 3, 2, 1: 0.02, 0.03, 0.06, and 0.04 may not be below the one before it
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.6, 0.7]) == pytest.approx([1.0, 1.0])


@each(
    ("call", "message"),
    [
        (
            lambda: wilcoxon(np.ones((1, 2, 2))),
            r"errors must have shape .*, at least \(2, 1, 1\), got \(1, 2, 2\)",
        ),
        (
            lambda: wilcoxon(np.full((3, 2, 2), np.nan)),
            "errors must be finite, got 12 that are not",
        ),
    ],
)
def test_invalid_errors_and_pairs_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()
