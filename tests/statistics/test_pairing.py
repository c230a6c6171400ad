"""Runs side by side, and what is wrong with those that cannot be."""

import numpy as np
import pytest

from posefit.statistics.pairing import complete, paired, shared
from tests.cases import each

ROWS = [
    (method, instance, seed, 100.0 * (method == "b") + 10.0 * instance + seed)
    for method in ("b", "a")
    for instance in (7, 2)
    for seed in (1, 0)
]


def test_runs_are_put_side_by_side_whatever_order_they_come_in():
    found = paired(ROWS)
    assert (found.methods, found.instances, found.seeds) == (("b", "a"), (7, 2), ((0, 1), (0, 1)))
    assert np.array_equal(found.errors, [[[170.0, 171.0], [120.0, 121.0]], [[70.0, 71.0], [20.0, 21.0]]])


def test_instances_may_have_seeds_of_their_own():
    found = paired([("a", 0, 5, 1.0), ("a", 1, 6, 2.0)])
    assert found.seeds == ((5,), (6,))
    assert found.errors.tolist() == [[[1.0], [2.0]]]


def test_a_sweep_with_gaps_keeps_what_all_methods_share():
    gaps = [row for row in ROWS if row[:3] != ("a", 2, 0)]
    kept, left_out = shared(gaps)
    found = paired(kept)
    assert found.seeds == ((0,), (1,))  # of instance 7 the lowest seed, as many as instance 2 has left
    assert found.errors.tolist() == [[[170.0], [121.0]], [[70.0], [21.0]]]
    assert left_out == 3


def test_a_sweep_without_gaps_is_kept_whole():
    kept, left_out = shared(ROWS)
    assert (sorted(kept), left_out) == (sorted(ROWS), 0)


def test_an_error_that_is_nan_is_a_gap_and_an_instance_nobody_shares_is_left_out():
    kept, left_out = shared([*ROWS, ("a", 9, 0, 1.0), ("b", 9, 0, np.nan)])
    assert paired(kept).instances == (7, 2)
    assert left_out == 2


@each(
    ("rows", "message"),
    [
        ([], "runs must be at least one, got none"),
        ([*ROWS, ROWS[0]], "runs must differ in method, instance or seed, got two of b on 7, seed 1"),
        (ROWS[1:], r"runs must be there of every method, instance and seed, got none of b on 7, seed 1 \(1 missing"),
        ([*ROWS[1:], (*ROWS[0][:3], np.nan)], "errors must be finite, got nan of b on 7, seed 1"),
        ([*ROWS[1:], (*ROWS[0][:3], -np.inf)], "errors must be finite, got -inf of b on 7, seed 1"),
        (
            [row for row in ROWS if row[1:3] != (2, 0)],
            "instances must have the same number of seeds, got 1 of 2 and 2 of 7",
        ),
    ],
)
def test_runs_that_do_not_pair_are_refused(rows, message):
    with pytest.raises(ValueError, match=message):
        paired(rows)


def test_methods_that_share_nothing_are_refused():
    with pytest.raises(ValueError, match="methods must share an instance and a seed to be compared, got none of a, b"):
        shared([("a", 0, 0, 1.0), ("b", 0, 1, 1.0)])


def test_every_block_that_all_have_finished_is_complete_whatever_others_lack():
    gaps = [row for row in ROWS if row[:3] != ("a", 2, 0)]
    assert sorted(complete(gaps)) == [(2, 1), (7, 0), (7, 1)]
    assert sorted(complete([*ROWS, ("a", 9, 0, 1.0), ("b", 9, 0, np.nan)])) == [(2, 0), (2, 1), (7, 0), (7, 1)]
    with pytest.raises(ValueError, match="methods must share an instance and a seed to be compared, got none of a, b"):
        complete([("a", 0, 0, 1.0), ("b", 0, 1, 1.0)])
