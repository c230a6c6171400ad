"""Methods compared on the runs that they share, worked by hand."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.report.charts import certainty, convergence, grid, joint_errors
from posefit.report.contest import contest_of
from posefit.report.tracks import error_with_losses
from tests.report.browser import ledger, result, sure
from tests.report.contests import (
    FIRST,
    baselines,
    board_of,
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
    rows = board_of(contest)
    assert [(row["name"], row["taking_part"], row["runs"]) for row in rows] == [
        ("a", True, 8), ("b", True, 8), ("late", False, 2),
    ]  # fmt: skip
    assert rows[2]["low"] is None
    assert rows[2]["error_with_losses_degrees"] == pytest.approx(0.505)


def test_p_holds_for_all_comparisons_together(tmp_path: Path) -> None:
    # equal differences in 6 blocks: p = 2 / 2^6 = 0.031 each, and 0.094 after Holm
    board = board_of(
        contest_of_errors(tmp_path, full({"a": 1.0, "b": 2.0, "c": 3.0}, instances=3))
    )
    assert [row["p"] for row in board[1:]] == pytest.approx([3 * 2 / 2**6] * 2)


def test_the_leaderboard_has_means_and_baselines_have_skills_too(
    tmp_path: Path,
) -> None:
    contest = contest_of_errors(
        tmp_path, {("a", i, 0): error for i, error in enumerate([1.0, 2.0, 3.0, 50.0])}
    )
    (row,) = board_of(contest)
    assert row["error_with_losses_degrees"] == pytest.approx(14.0)
    assert row["skill.mean_pose"] == pytest.approx(1.0 - 14.0 / 4.0)
    assert row["low"] is None  # one seed gives no interval
    assert [
        (base["error_with_losses_degrees"], base["skill.nearest"])
        for base in baselines(contest)
    ] == [(4.0, 0.0)] * 3


def test_a_skill_is_computed_from_the_reported_errors(tmp_path: Path) -> None:
    errors = [1.0, 2.0, 3.0, 10.0]
    trivial = [4.0, 1.0, 16.0, 11.0]
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
    shown = {
        row["baseline"]: row["error_with_losses_degrees"] for row in baselines(contest)
    }
    assert shown == {"mean_pose": 8.0, "persistence": None, "nearest": None}
    board = {row["name"]: row for row in board_of(contest)}
    assert [board[name]["skill.mean_pose"] for name in "ab"] == pytest.approx(
        [1.0 - 4.0 / 8.0, 1.0 - 8.0 / 8.0]
    )
    # on its own run
    assert board["late"]["skill.mean_pose"] == pytest.approx(1.0 - 3.0 / 4.0)
    assert board["a"]["skill.nearest"] is None


def test_rows_have_their_effect_and_how_many_tracks_lost_frames(tmp_path: Path) -> None:
    board = board_of(contest_of_errors(tmp_path, three_methods()))
    assert [row["name"] for row in board] == ["a", "c", "b"]
    assert [board[0][name] for name in ("behind", "p", "blocks_needed")] == [None] * 3
    # c is 0.001 behind and ahead in turn: of twelve Student's t is 2.200985
    reach = 2.200985 * 0.001 * np.sqrt(12.0 / 11.0) / np.sqrt(12.0)
    ends = [board[1][name] for name in ("behind", "behind_low", "behind_high")]
    assert ends == pytest.approx([0.0, -reach, reach], abs=1e-9)
    # 1, 1.02 and 1.04 in turn
    assert board[2]["behind"] == pytest.approx(1.02)
    assert board[2]["p"] == pytest.approx(3 * 2 / 2**12)
    rates = {0: 0.0, 1: 0.2, 2: 0.01}
    made = [
        result(replace(FIRST, instance=i), 1.0, lost_rate=rate)
        for i, rate in rates.items()
    ]
    (row,) = board_of(contest_of_results(tmp_path / "lost", made))
    assert (row["lost_tracks"], row["runs"]) == (2, 3)


def row(error: float | None, lost: float | None, baseline: float | None) -> Any:
    return {
        "error_degrees": None if error is None else {"mean": error},
        "lost_rate": lost,
        "baselines_degrees": None if baseline is None else {"mean_pose": baseline},
    }


def test_a_lost_frame_counts_as_the_mean_training_poses_at_least() -> None:
    assert error_with_losses(row(1.0, 0.0, 4.0)) == 1.0
    # a quarter of the frames is lost: 1 + 0.25 (4 - 1)
    assert error_with_losses(row(1.0, 0.25, 4.0)) == 1.75
    assert error_with_losses(row(1.0, 1.0, 4.0)) == 4.0
    # what is lost is worse than the baseline already
    assert error_with_losses(row(5.0, 0.5, 4.0)) == 5.0
    assert error_with_losses(row(1.0, None, 4.0)) == 1.0
    assert error_with_losses(row(1.0, 0.5, None)) == 1.0
    assert np.isnan(error_with_losses(row(None, 0.5, 4.0)))


def test_one_or_two_lost_tracks_give_no_interval_and_none_or_more_do(
    tmp_path: Path,
) -> None:
    for lost, is_shown in ((0, True), (1, False), (2, False), (3, True), (5, True)):
        made = [
            result(
                replace(FIRST, instance=i, seed=s),
                1.0 + 0.1 * s,
                lost_rate=0.5 if 2 * i + s < lost else 0.0,
            )
            for i in range(4)
            for s in range(2)
        ]
        contest = contest_of_results(tmp_path / str(lost), made)
        (made_row,) = board_of(contest)
        assert (made_row["low"] is not None) == is_shown, lost
        # nor have its curve and its joints
        (curve,) = convergence(contest, grid(contest))
        assert curve is not None
        assert curve.low is not None
        assert np.isfinite(curve.low).all() == is_shown
        assert np.isfinite(joint_errors(contest)[0].low).all() == is_shown


def test_curves_start_and_end_with_the_traces(tmp_path: Path) -> None:
    contest = contest_of_errors(tmp_path, full({"a": 1.0, "b": 2.0}))
    evaluations = grid(contest)
    assert (evaluations[0], evaluations[-1]) == (40.0, 120.0)
    curve = convergence(contest, evaluations)[0]
    assert curve is not None
    # the mean of 1, 1.01, 1.1, 1.11, times 4 at the start
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
    row, other = board_of(contest)
    assert (row["unknown_rate"], row["swap_rate"], row["coverage.80"]) == pytest.approx(
        (0.3, 0.1, 0.75)
    )
    assert other["coverage.80"] is None
    assert certainty(contest_of_errors(tmp_path / "without", full({"a": 1.0}))) is None


def test_without_errors_there_is_no_contest(tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [result(FIRST, 1.0, error_degrees=None)])
    assert contest_of(runs_in(made)) is None


def test_one_missing_run_takes_one_block_and_not_a_seed_of_every_instance(
    tmp_path: Path,
) -> None:
    errors = full(
        {name: float(k) for k, name in enumerate("abcde", start=1)},
        instances=4,
        seeds=3,
    )
    del errors["e", 3, 2]
    contest = contest_of_errors(tmp_path, errors)
    assert contest.blocks.shape == (5, 11)
    assert np.bincount(contest.instance).tolist() == [3, 3, 3, 2]
    assert board_of(contest)[0]["runs"] == 11
    # the other methods' runs of the missing instance and seed
    assert contest.left_out == 4
    # all differences are equal
    adjusted = [test.adjusted for test in contest.comparisons]
    assert adjusted == pytest.approx([10 * 2 / 2**11] * 10)
