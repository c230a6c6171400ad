"""Friedman, Nemenyi, Wilcoxon and Holm against scipy, published tables and sums by hand."""

from itertools import combinations

import numpy as np
import pytest
from scipy import stats

from posefit.statistics.ranks import (
    LETTERS,
    _cliques,
    compact_letters,
    friedman,
    holm,
    nemenyi_difference,
    wilcoxon,
)
from tests.cases import each

# Hollander and Wolfe, Nonparametric statistical methods, 1973, page 140: rounding first base in three ways (R's
# example of friedman.test quotes them, with a chi-squared of 11.1429 and a p-value of 0.003805)
FIRST_BASE = np.array(
    [
        [5.40, 5.50, 5.55], [5.85, 5.70, 5.75], [5.20, 5.60, 5.50], [5.55, 5.50, 5.40], [5.90, 5.85, 5.70],
        [5.45, 5.55, 5.60], [5.40, 5.40, 5.35], [5.45, 5.50, 5.35], [5.25, 5.15, 5.00], [5.85, 5.80, 5.70],
        [5.25, 5.20, 5.10], [5.65, 5.55, 5.45], [5.60, 5.35, 5.45], [5.05, 5.00, 4.95], [5.50, 5.50, 5.40],
        [5.45, 5.55, 5.50], [5.55, 5.55, 5.35], [5.45, 5.50, 5.55], [5.50, 5.45, 5.25], [5.65, 5.60, 5.40],
        [5.70, 5.65, 5.55], [6.30, 6.30, 6.25],
    ]
)  # fmt: skip


def block(runners):
    """Return rows of blocks as errors (methods, blocks, 1)."""
    return np.asarray(runners, dtype=float).T[:, :, None]


def test_friedman_of_a_textbook_example():
    ranking = friedman(block(FIRST_BASE))
    assert ranking.statistic == pytest.approx(11.1429, abs=5e-5)
    assert ranking.p_value == pytest.approx(0.003805, abs=5e-7)


@each("seed", range(5))
def test_friedman_is_scipys_with_ties(seed):
    errors = np.random.default_rng(seed).integers(0, 4, (5, 6, 2)).astype(float)
    expected = stats.friedmanchisquare(*errors.reshape(5, -1))
    ranking = friedman(errors)
    assert (ranking.statistic, ranking.p_value) == (pytest.approx(expected.statistic), pytest.approx(expected.pvalue))


def test_mean_ranks_by_hand_with_ties():
    # ranks 1, 2.5, 2.5 and 1, 2, 3
    assert friedman(block([[1.0, 5.0, 5.0], [2.0, 3.0, 4.0]])).mean_ranks.tolist() == [1.0, 2.25, 2.75]
    equal = friedman(np.ones((3, 4, 2)))
    assert (equal.statistic, equal.p_value, equal.cliques) == (0.0, 1.0, ((0, 1, 2),))


@each(("methods", "quantile"), [(2, 1.960), (3, 2.343), (4, 2.569), (5, 2.728), (10, 3.164)])
def test_the_critical_difference_has_the_quantiles_of_demsars_table_5a(methods, quantile):
    blocks = 30
    expected = quantile * (methods * (methods + 1) / (6 * blocks)) ** 0.5
    assert nemenyi_difference(methods, blocks) == pytest.approx(expected, rel=3e-4)
    # example 3.2.4: four classifiers on 14 data sets, CD = 2.569 sqrt(4 * 5 / (6 * 14)) = 1.25
    assert nemenyi_difference(4, 14) == pytest.approx(1.25, abs=0.005)


def test_cliques_are_as_large_as_they_can_be_and_none_is_part_of_another():
    # 1 and 2 do not differ, nor do 2 to 3.4; 9 is alone
    assert _cliques(np.array([2.0, 9.0, 1.0, 3.4, 2.9]), 1.5) == ((2, 0), (0, 4, 3))
    assert _cliques(np.array([1.0, 2.5]), 1.5) == ()  # methods differ from the critical difference on


@each("seed", range(10))
def test_cliques_are_those_of_a_slow_twin(seed):
    mean = np.random.default_rng(seed).uniform(1.0, 8.0, 8)
    groups = [{int(m) for m in np.flatnonzero((mean >= low) & (mean < low + 1.5))} for low in mean]  # from one on
    largest = [group for group in groups if len(group) > 1 and not any(group < other for other in groups)]
    assert {frozenset(clique) for clique in _cliques(mean, 1.5)} == set(map(frozenset, largest))


def test_wilcoxon_by_hand():
    # differences -1 to -5: the signed rank is 0, as extreme as it gets, 2 / 2**5
    (pair,) = wilcoxon(block([[1.0, 2.0], [2.0, 4.0], [3.0, 6.0], [4.0, 8.0], [5.0, 10.0]]))
    assert (pair.first, pair.second, pair.difference) == (0, 1, -3.0)
    assert pair.p_value == pair.adjusted == pytest.approx(0.0625)


def test_a_medians_interval_is_that_of_the_sign_test():
    # of ten ordered differences the second and the ninth: P(at most one of ten below) = 11 / 1024 on either side
    values = np.arange(10.0)
    (pair,) = wilcoxon(np.stack([values, np.zeros(10)])[:, :, None])
    assert (pair.difference, pair.low, pair.high) == (4.5, 1.0, 8.0)
    interval = stats.quantile_test(values, q=0, p=0.5).confidence_interval(0.95)
    assert (pair.low, pair.high) == (interval.low, interval.high)
    (pair,) = wilcoxon(np.stack([values, np.zeros(10)])[:, :5, None])  # 2 / 2**5 is more than 5 %
    assert np.isnan([pair.low, pair.high]).all()


def test_wilcoxon_is_scipys_and_its_adjustment_holms():
    errors = np.random.default_rng(0).gamma(2.0, size=(4, 3, 5)) * np.array([1.0, 1.2, 2.0, 3.0])[:, None, None]
    pairs = wilcoxon(errors)
    assert [(pair.first, pair.second) for pair in pairs] == list(combinations(range(4), 2))
    p_values = [stats.wilcoxon(errors[a].ravel(), errors[b].ravel()).pvalue for a, b in combinations(range(4), 2)]
    assert [pair.p_value for pair in pairs] == pytest.approx(p_values)
    assert [pair.adjusted for pair in pairs] == pytest.approx(holm(p_values).tolist())
    some = wilcoxon(errors, [(0, 3), (2, 3)])  # adjusted for these two alone
    assert [pair.p_value for pair in some] == [pairs[2].p_value, pairs[5].p_value]
    assert [pair.adjusted for pair in some] == holm([pairs[2].p_value, pairs[5].p_value]).tolist()


@each("seed", range(3))
def test_with_ties_and_equal_blocks_wilcoxon_is_scipys_too(seed):
    errors = np.random.default_rng(seed).integers(0, 4, (2, 8, 1)).astype(float)
    (pair,) = wilcoxon(errors)
    assert pair.p_value == pytest.approx(stats.wilcoxon(*errors[:, :, 0], zero_method="pratt").pvalue)


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


def test_an_instance_is_one_block_where_its_seeds_are_averaged():
    errors = np.random.default_rng(0).gamma(2.0, size=(3, 4, 50))
    assert friedman(errors.mean(axis=2, keepdims=True)).critical_difference == nemenyi_difference(3, 4)
    assert friedman(errors).critical_difference == nemenyi_difference(3, 200)


@each(
    ("call", "message"),
    [
        (lambda: friedman(np.ones((1, 2, 2))), r"errors must have shape .*, at least \(2, 1, 1\), got \(1, 2, 2\)"),
        (lambda: friedman(np.ones((3, 1, 1))), "blocks, instances times seeds, must be at least 2, got 1"),
        (lambda: friedman(np.full((3, 2, 2), np.nan)), "errors must be finite, got 12 that are not"),
        (
            lambda: wilcoxon(np.ones((2, 2, 2)), [(0, 2)]),
            r"pairs must be of two different methods of 0 to 1, got \(0, 2",
        ),
        (
            lambda: wilcoxon(np.ones((2, 2, 2)), [(1, 1)]),
            r"pairs must be of two different methods of 0 to 1, got \(1, 1",
        ),
    ],
)
def test_invalid_errors_and_pairs_are_refused(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@each(
    ("different", "letters"),
    [([], ["a", "a", "a"]), ([(0, 1), (0, 2), (1, 2)], ["a", "b", "c"]), ([(0, 2)], ["a", "ab", "b"])],
)
def test_methods_share_a_letter_where_they_do_not_differ(different: list[tuple[int, int]], letters: list[str]) -> None:
    assert compact_letters(3, different) == letters


def test_piephos_definition_holds_for_random_differences() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        count = int(rng.integers(2, 9))
        different = [pair for pair in combinations(range(count), 2) if rng.random() < rng.choice([0.1, 0.5, 0.9])]
        letters = compact_letters(count, different)
        for pair in combinations(range(count), 2):
            assert (not set(letters[pair[0]]) & set(letters[pair[1]])) == (pair in different)
        used = sorted(set("".join(letters)))
        assert used == list(LETTERS[: len(used)])
        members = [{m for m in range(count) if letter in letters[m]} for letter in used]
        assert not any(group <= other for group in members for other in members if group is not other)


def test_too_many_groups_have_no_letters() -> None:
    count = 2 * 6  # six pairs that differ within themselves alone are 2^6 groups
    assert compact_letters(count, [(2 * k, 2 * k + 1) for k in range(6)]) == [""] * count


@each("pair", [(0, 0), (0, 3), (-1, 1)])
def test_an_invalid_pair_is_refused(pair: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="apart must be of two different methods of 0 to 2"):
        compact_letters(3, [pair])
