"""Runs side by side, of sweeps with and without gaps."""

from typing import Any

import numpy as np

from posefit.statistics.pairing import most_shared
from tests.cases import each

ALL = [
    (method, instance, seed)
    for method in range(2)
    for instance in (2, 7)
    for seed in range(2)
]


def of(runs: list[tuple[int, int, int]], errors: list[float] | None = None) -> Any:
    return most_shared(
        *np.array(runs, dtype=int).reshape(-1, 3).T,
        np.array(errors or [1.0] * len(runs)),
    )


def test_runs_are_paired_in_any_order() -> None:
    order = np.random.default_rng(0).permutation(len(ALL))
    shared = of([ALL[k] for k in order])
    assert (shared.methods, shared.left_out, shared.missing) == ((0, 1), 0, ())
    assert [ALL[order[k]] for k in shared.blocks.ravel()] == ALL
    assert shared.instance.tolist() == [2, 2, 7, 7]


def test_instances_may_have_different_seeds_and_numbers_of_seeds() -> None:
    assert of([(0, 0, 5), (0, 1, 6)]).blocks.tolist() == [[0, 1]]
    runs = [run for run in ALL if run != (1, 2, 0)]
    shared = of(runs)
    assert [runs[k] for k in shared.blocks[1]] == [(1, 2, 1), (1, 7, 0), (1, 7, 1)]
    assert shared.instance.tolist() == [2, 7, 7]
    assert shared.left_out == 1


def test_an_error_that_is_nan_is_a_gap_and_an_instance_without_a_shared_run_is_missing() -> (
    None
):
    runs = [*ALL, (0, 9, 0), (1, 9, 0), (0, 11, 0), (1, 11, 1)]
    shared = of(runs, [1.0] * len(ALL) + [1.0, np.nan, 1.0, 1.0])
    assert (shared.instance.tolist(), shared.left_out) == ([2, 2, 7, 7], 3)
    # the last has a run of each, but none with the same seed
    assert shared.missing == ((9, (1,)), (11, ()))


@each(("late", "methods"), [(1, (0, 1)), (2, (0, 1, 2))])
def test_a_method_that_shares_less_than_half_of_the_runs_is_left_out(
    late: int, methods: tuple[int, ...]
) -> None:
    assert of([*ALL, *((2, 7, seed) for seed in range(late))]).methods == methods


def test_no_error_is_shared_if_no_run_has_one() -> None:
    assert of([]) is None
    assert of(ALL, [np.nan] * len(ALL)) is None
    assert of([(0, 0, 0), (1, 0, 1)]).methods == (0,)
