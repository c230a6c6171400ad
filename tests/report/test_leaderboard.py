"""Methods compared on the runs that they share, worked by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posefit.report.charts import certainty, convergence, grid, joint_errors
from posefit.report.leaderboard import contest_of, leaderboard, paired_tests
from tests.report.browser import ledger, result, sure
from tests.report.contests import (
    FIRST,
    baselines,
    contest_of_errors,
    contest_of_results,
    full,
    runs_in,
    three_methods,
)


def test_a_method_that_shares_too_few_runs_is_listed_last_with_its_own_runs(
    tmp_path: Path,
) -> None:
    errors = full({"a": 1.0, "b": 2.0, "late": 0.5}, instances=4)
    contest = contest_of_errors(
        tmp_path,
        {key: e for key, e in errors.items() if key[0] != "late" or key[1] == 0},
    )
    rows = leaderboard(contest)
    assert [(row["name"], row["taking_part"], row["runs"]) for row in rows] == [
        ("a", True, 8), ("b", True, 8), ("late", False, 2),
    ]  # fmt: skip
    assert rows[2]["low"] is None
    assert rows[2]["error"] == pytest.approx(0.505)


def test_p_holds_for_all_comparisons_together(tmp_path: Path) -> None:
    # of 6 blocks each method is better in all: p = 2 / 2^6 = 0.031 each, and 0.094 after Holm
    board = leaderboard(
        contest_of_errors(tmp_path, full({"a": 1.0, "b": 2.0, "c": 3.0}, instances=3))
    )
    assert [row["p"] for row in board[1:]] == pytest.approx([3 * 2 / 2**6] * 2)


def test_the_leaderboard_has_interquartile_means_and_baselines_have_skills_too(
    tmp_path: Path,
) -> None:
    contest = contest_of_errors(
        tmp_path, {("a", i, 0): error for i, error in enumerate([1.0, 2.0, 3.0, 50.0])}
    )
    (row,) = leaderboard(contest)
    # of four runs the first and the last are left out
    assert row["error"] == pytest.approx(2.5)
    assert row["skill_mean_pose"] == pytest.approx(1.0 - 2.5 / 4.0)
    assert np.isnan(row["low"])  # one seed gives no interval
    assert [(base["error"], base["skill_nearest"]) for base in baselines(contest)] == [
        (4.0, 0.0)
    ] * 3


def test_a_skill_is_that_of_the_errors_that_are_shown(tmp_path: Path) -> None:
    # the middle halves are of instances 1 and 2 for the method, and 0 and 3 for the baselines
    errors = [1.0, 2.0, 3.0, 9.0]
    trivial = [4.0, 1.0, 16.0, 8.0]
    made = [
        result(
            replace(FIRST, method=method, instance=i),
            scale * error,
            baselines_degrees={"mean_pose": trivial[i]},
        )
        for method, scale in (("a", 1.0), ("b", 2.0))
        for i, error in enumerate(errors)
    ]
    late = result(
        replace(FIRST, method="late", instance=7),
        3.0,
        baselines_degrees={"mean_pose": 4.0},
    )
    contest = contest_of_results(tmp_path, [*made, late])
    shown = {row["baseline"]: row["error"] for row in baselines(contest)}
    assert shown == {"mean_pose": 6.0, "persistence": None, "nearest": None}
    board = {row["name"]: row for row in leaderboard(contest)}
    assert [board[name]["skill_mean_pose"] for name in "ab"] == pytest.approx(
        [1.0 - 2.5 / 6.0, 1.0 - 5.0 / 6.0]
    )
    # on its own run
    assert board["late"]["skill_mean_pose"] == pytest.approx(1.0 - 3.0 / 4.0)
    assert board["a"]["skill_nearest"] is None


def test_rows_have_their_effect_and_how_many_tracks_lost_frames(tmp_path: Path) -> None:
    board = leaderboard(contest_of_errors(tmp_path, three_methods()))
    assert [row["name"] for row in board] == ["a", "c", "b"]
    assert [
        board[0][name] for name in ("behind", "behind_low", "behind_high", "p")
    ] == [None] * 4
    # c is 0.001 behind and ahead in turn: of twelve differences the third lowest and the third highest
    ends = [board[1][name] for name in ("behind", "behind_low", "behind_high")]
    assert ends == pytest.approx([0.0, -0.001, 0.001], abs=1e-9)
    assert board[2]["behind"] == pytest.approx(1.0)
    assert board[2]["p"] == pytest.approx(3 * 2 / 2**12)
    rates = {0: 0.0, 1: 0.2, 2: 0.01}
    made = [
        result(replace(FIRST, instance=i), 1.0, lost_rate=rate)
        for i, rate in rates.items()
    ]
    (row,) = leaderboard(contest_of_results(tmp_path / "lost", made))
    assert (row["lost_tracks"], row["runs"]) == (2, 3)


def test_curves_start_and_end_with_the_traces(tmp_path: Path) -> None:
    contest = contest_of_errors(tmp_path, full({"a": 1.0, "b": 2.0}))
    evaluations = grid(contest)
    assert (evaluations[0], evaluations[-1]) == (40.0, 120.0)
    curve = convergence(contest, evaluations)[0]
    assert curve is not None
    # of 1, 1.01, 1.1, 1.11 the middle two, times 4 at the start
    assert (curve.y[0], curve.y[-1]) == pytest.approx((4.0 * 1.055, 1.055), rel=1e-6)
    assert curve.low is not None
    assert np.isnan(curve.low).all()  # of four runs
    assert joint_errors(contest)[0].values[10] == pytest.approx(10.55, rel=1e-6)


def test_a_method_without_a_trace_has_no_curve(tmp_path: Path) -> None:
    empty = {"evaluations": [], "cost": []}
    made = [result(replace(FIRST, method="a", seed=s), 1.0) for s in (0, 1)]
    made += [
        result(replace(FIRST, method="b", seed=s), 2.0, trace=empty) for s in (0, 1)
    ]
    contest = contest_of_results(tmp_path, made)
    assert [curve is None for curve in convergence(contest, grid(contest))] == [
        False,
        True,
    ]


def test_certainty_is_pooled_over_runs_frame_by_frame(tmp_path: Path) -> None:
    first = [[10, 0.55, 0.5], [30, 1.0, 0.9]]
    second = [[30, 0.55, 0.3]]
    made = [
        result(
            replace(FIRST, method="a", seed=0),
            1.0,
            **sure(0.7, 50.0, first, 0.1),
            swap_rate=0.2,
        ),
        result(replace(FIRST, method="a", seed=1), 1.0, **sure(0.8, 70.0, second, 0.5)),
        *(result(replace(FIRST, method="b", seed=s), 2.0) for s in (0, 1)),
    ]
    contest = contest_of_results(tmp_path, made)
    calibration = certainty(contest)
    assert calibration is not None
    assert calibration["levels"] == [0.5, 0.8, 0.95]
    a, b = calibration["methods"]
    assert b is None
    assert a["coverage"] == pytest.approx([0.45, 0.75, 0.9])
    assert a["width"] == pytest.approx([30.0, 60.0, 120.0])
    # of 40 frames near 0.55 are 5 + 9 right, of 30 at 1 are 27
    assert a["ece"] == pytest.approx((40 * 0.2 + 30 * 0.1) / 70, rel=1e-5)
    row, other = leaderboard(contest)
    assert (row["unknown"], row["swapped"], row["coverage_80"]) == pytest.approx(
        (0.3, 0.1, 0.75)
    )
    assert other["coverage_80"] is None
    assert certainty(contest_of_errors(tmp_path / "without", full({"a": 1.0}))) is None


def test_without_errors_there_is_no_contest(tmp_path: Path) -> None:
    assert (
        contest_of(
            runs_in(
                ledger(tmp_path / "results", [result(FIRST, 1.0, error_degrees=None)])
            )
        )
        is None
    )


def test_curves_of_very_many_runs_use_some_seeds_and_instances(tmp_path: Path) -> None:
    contest = contest_of_errors(
        tmp_path, full({"a": 1.0, "b": 2.0}, instances=10, seeds=4)
    )
    # 1e8 / (100 resamples x 20,000 points x 2 methods) = 25 runs of a method, of 50,000 points 10
    shapes = [contest.fewer(points).rows.shape for points in (1, 20_000, 50_000)]
    assert shapes == [(2, 10, 4), (2, 10, 2), (2, 5, 2)]
    assert contest.fewer(50_000).instances == (0, 2, 4, 6, 8)


def test_one_lost_run_takes_one_block_from_the_tests_and_not_a_seed_of_every_instance(
    tmp_path: Path,
) -> None:
    errors = full(
        {name: float(k) for k, name in enumerate("abcde", start=1)},
        instances=4,
        seeds=3,
    )
    del errors["e", 3, 2]
    contest = contest_of_errors(tmp_path, errors)
    assert contest.rows.shape == (5, 4, 2)  # means have as many seeds of every instance
    assert contest.blocks.shape == (5, 11)
    # the other methods' runs of the lost instance and seed
    assert contest.left_out == 4
    tests = paired_tests(contest)
    assert tests is not None
    assert tests["blocks"] == 11
    # all eleven differences have one sign; of eight, ten pairs after Holm could never fall below 10 x 2 / 2^8 = 0.078
    assert [pair[6] for pair in tests["pairs"]] == pytest.approx([10 * 2 / 2**11] * 10)
