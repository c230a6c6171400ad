"""The compact letter display, by hand and against its definition."""

from itertools import combinations

import numpy as np
import pytest

from posefit.statistics.ranks import LETTERS, compact_letters


def test_methods_that_nothing_tells_apart_share_one_letter() -> None:
    assert compact_letters(3, []) == ["a", "a", "a"]


def test_methods_that_all_differ_have_a_letter_each() -> None:
    assert compact_letters(3, [(0, 1), (0, 2), (1, 2)]) == ["a", "b", "c"]


def test_one_between_two_groups_has_both_letters() -> None:
    assert compact_letters(3, [(0, 2)]) == ["a", "ab", "b"]


def test_piephos_definition_holds_whatever_is_told_apart() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        count = int(rng.integers(2, 9))
        apart = [pair for pair in combinations(range(count), 2) if rng.random() < rng.choice([0.1, 0.5, 0.9])]
        letters = compact_letters(count, apart)
        for pair in combinations(range(count), 2):
            assert (not set(letters[pair[0]]) & set(letters[pair[1]])) == (pair in apart)
        used = sorted(set("".join(letters)))
        assert used == list(LETTERS[: len(used)])
        members = [{m for m in range(count) if letter in letters[m]} for letter in used]
        assert not any(one <= other for one in members for other in members if one is not other)


def test_too_many_groups_have_no_letters() -> None:
    count = 2 * 6  # six pairs that are told apart within themselves alone are 2^6 groups
    assert compact_letters(count, [(2 * k, 2 * k + 1) for k in range(6)]) == [""] * count


@pytest.mark.parametrize("pair", [(0, 0), (0, 3), (-1, 1)])
def test_a_pair_that_is_none_is_refused(pair: tuple[int, int]) -> None:
    with pytest.raises(ValueError, match="apart must be of two different methods of 0 to 2"):
        compact_letters(3, [pair])
