"""How probably one method is better than another."""

import math
from itertools import product

import numpy as np
import pytest
from scipy import stats

from posefit.statistics.improvement import improvement_interval, probability_of_improvement
from tests.cases import each


def test_improvement_by_hand_with_a_tie():
    # 1 and 3 against 2 and 3: better in (1, 2), (1, 3), worse in (3, 2), equal in (3, 3)
    assert probability_of_improvement([[[1.0, 3.0]], [[2.0, 3.0]]]).tolist() == [[0.5, 0.625], [0.375, 0.5]]


def test_improvement_is_mann_whitneys_u_averaged_over_instances():
    errors = np.random.default_rng(0).integers(0, 9, (3, 4, 6)).astype(float)
    probabilities = probability_of_improvement(errors)
    for a, b in product(range(3), repeat=2):
        u = [stats.mannwhitneyu(errors[b, i], errors[a, i]).statistic / 36 for i in range(4)]
        assert probabilities[a, b] == pytest.approx(np.mean(u))
    # the first method is better on both instances, though its runs on the second are worse than all on the first
    assert probability_of_improvement([[[1.0, 1.0], [8.0, 8.0]], [[2.0, 2.0], [9.0, 9.0]]])[0, 1] == 1.0


def test_the_interval_has_the_same_value_and_holds_it():
    errors = np.random.default_rng(0).gamma(2.0, size=(2, 5, 8)) * np.array([1.0, 1.3])[:, None, None]
    value, low, high = improvement_interval(*errors, np.random.default_rng(1))
    assert value == pytest.approx(probability_of_improvement(errors)[0, 1])
    assert 0.0 <= low < value < high <= 1.0


@each("seeds", [3, 10])
@pytest.mark.slow
def test_intervals_hold_the_truth_in_93_to_98_percent_of_1000_studies(seeds: int):
    # normal runs, the second method worse by d: P = Phi(d / sqrt(2)) on each of eight instances
    rng, worse = np.random.default_rng(6), np.linspace(0.0, 1.2, 8)[:, None]
    truth, inside = stats.norm.cdf(worse / np.sqrt(2.0)).mean(), 0
    for _ in range(1000):
        _, low, high = improvement_interval(
            rng.normal(size=(8, seeds)), rng.normal(size=(8, seeds)) + worse, rng, resamples=500
        )
        inside += low <= truth <= high
    assert 0.93 <= inside / 1000 <= 0.98


def test_the_interval_of_three_seeds_by_going_through_all_27_resamples():
    # At the level 1/2 the t distribution with 3 - 1 degrees of freedom has its quantile at sqrt(2/3), and sqrt(n/(n-1))
    # is sqrt(3/2): the ends are the percentiles at Phi(-1) and Phi(1), 15.9 and 84.1 %. Of the 27 resamples 22 have a
    # share of at most 7/9, 81.5 %; without the factor the upper end, at Phi(sqrt(2/3)) = 79.3 %, would be among them.
    first, second = [0.0, 0.0, 2.0], [0.0, 1.0, 3.0]
    shares = sorted(
        sum((first[i] < second[j]) + 0.5 * (first[i] == second[j]) for i in picked for j in picked) / 9
        for picked in product(range(3), repeat=3)
    )
    assert shares.count(7 / 9) + sum(share < 7 / 9 for share in shares) == 22
    low, high = (shares[math.ceil(stats.norm.cdf(end) * 27) - 1] for end in (-1.0, 1.0))
    assert (low, high) == (6 / 9, 7.5 / 9)
    interval = improvement_interval([first], [second], np.random.default_rng(0), resamples=100_000, level=0.5)
    assert interval == pytest.approx((6 / 9, low, high))


def test_one_seed_gives_no_interval_and_different_shapes_are_refused():
    value, low, high = improvement_interval([[1.0], [1.0]], [[2.0], [0.0]], np.random.default_rng(0))
    assert value == 0.5
    assert np.isnan([low, high]).all()
    with pytest.raises(ValueError, match=r"second must have the shape of first, \(1, 2\), got \(1, 1\)"):
        improvement_interval([[1.0, 2.0]], [[1.0]], np.random.default_rng(0))
