"""Which of many methods cannot be told apart, short enough for a column of a table."""

from collections.abc import Iterable
from string import ascii_letters

LETTERS = ascii_letters  # as many groups as a reader can be asked to follow


def compact_letters(count: int, apart: Iterable[tuple[int, int]]) -> list[str]:
    """Return letters for each of `count` methods, such that two share one exactly where they are not told apart.

    `apart` names the pairs, of 0 to count - 1, that some test told apart. The letters are given in the order of the
    methods, so best first makes `a` the best group. All are empty where 52 letters are not enough. The compact letter
    display by inserting and absorbing: Piepho, An algorithm for a letter-based representation of all-pairwise
    comparisons, 2004.
    """
    groups = [frozenset(range(count))]
    for first, second in apart:
        if first == second or not {first, second} <= set(range(count)):
            raise ValueError(f"apart must be of two different methods of 0 to {count - 1}, got {(first, second)}")
        split = {
            part
            for group in groups
            for part in ((group - {first}, group - {second}) if {first, second} <= group else (group,))
        }
        groups = [one for one in split if not any(one < other for other in split)]
        if len(groups) > len(LETTERS):
            return [""] * count
    named = dict(zip(LETTERS, sorted(groups, key=sorted), strict=False))
    return ["".join(letter for letter, group in named.items() if method in group) for method in range(count)]
