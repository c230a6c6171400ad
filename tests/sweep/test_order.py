"""In which order a driver begins its cells: as the plan has them, but the first ones of different methods."""

from collections.abc import Iterator

from posefit.sweep.cell import TrackCell
from posefit.sweep.drive import LOOKAHEAD, interleaved
from tests.cases import each

METHODS = ("sapso@pca", "cma@pca", "vsmm")


def cells(methods: str, seeds: int) -> list[TrackCell]:
    """Return the cells of a product of methods, a letter each, and seeds."""
    return [
        TrackCell(METHODS["abc".index(one)], "walk", ("walk-a",), seed=seed) for one in methods for seed in range(seeds)
    ]


def order(given: list[TrackCell], workers: int) -> list[int]:
    return [given.index(cell) for cell in interleaved(iter(given), lambda: workers)]


@each(
    ("workers", "expected"),
    [
        (1, [0, 1, 2, 3, 4, 5, 6, 7, 8]),
        (2, [0, 3, 1, 2, 4, 5, 6, 7, 8]),
        (3, [0, 3, 6, 1, 2, 4, 5, 7, 8]),
        (9, [0, 3, 6, 1, 2, 4, 5, 7, 8]),
    ],
)
def test_the_first_cell_of_each_worker_is_of_another_method(workers: int, expected: list[int]) -> None:
    assert order(cells("abc", 3), workers) == expected


def test_cells_of_one_method_keep_their_order() -> None:
    assert order(cells("a", 4), 2) == [0, 1, 2, 3]


def test_a_long_plan_is_not_gone_through_before_it_begins() -> None:
    asked: list[int] = []

    def coming() -> Iterator[TrackCell]:
        for cell in cells("ab", 2 * LOOKAHEAD):
            asked.append(cell.seed)
            yield cell

    begun = next(interleaved(coming(), lambda: 2))
    assert begun == cells("a", 1)[0]
    assert len(asked) == LOOKAHEAD


def test_no_cell_is_lost_or_run_twice() -> None:
    given = cells("abc", 400)
    assert sorted(order(given, 3)) == list(range(len(given)))
