"""Methods held against each other on the runs that they share, worked by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posefit.report.contest import Contest, baseline_rows, contest_of, leaderboard, paired_tests
from posefit.report.curves import certainty, convergence, grid, joint_errors, reached
from posefit.report.runs import runs_of
from posefit.sweep.ledger import Ledger
from tests.report.browser import ledger, result, sure
from tests.sweep.fake import cells

FIRST = cells(1)[0]
Errors = dict[tuple[str, int, int], float]  # of method, instance and seed


def contest(path: Path, errors: Errors) -> Contest:
    made = [result(replace(FIRST, method=m, instance=i, seed=s), error) for (m, i, s), error in errors.items()]
    found = contest_of(runs_of(Ledger(ledger(path / "results", made))))
    assert found is not None
    return found


def full(methods: dict[str, float], instances: int = 2, seeds: int = 2) -> Errors:
    """Return the errors of methods that are a little worse on later instances and seeds."""
    return {
        (name, i, s): error + 0.1 * i + 0.01 * s
        for name, error in methods.items()
        for i in range(instances)
        for s in range(seeds)
    }


def test_runs_are_paired_by_instance_and_seed(tmp_path: Path) -> None:
    found = contest(tmp_path, full({"worse": 2.0, "better": 1.0}))
    assert [found.runs.methods[m] for m in found.methods] == ["better", "worse"]
    assert found.of("error").round(9).tolist() == [[[1.0, 1.01], [1.1, 1.11]], [[2.0, 2.01], [2.1, 2.11]]]
    assert found.left_out == 0


def test_a_method_that_shares_too_few_runs_is_kept_apart(tmp_path: Path) -> None:
    errors = full({"a": 1.0, "b": 2.0, "late": 0.5}, instances=4)
    errors = {key: error for key, error in errors.items() if key[0] != "late" or key[1] == 0}
    found = contest(tmp_path, errors)
    assert [found.runs.methods[m] for m in found.methods] == ["a", "b"]
    rows = leaderboard(found)
    assert [(row["name"], row["taking_part"], row["runs"]) for row in rows] == [
        ("a", True, 8), ("b", True, 8), ("late", False, 2),
    ]  # fmt: skip
    assert rows[2]["low"] is None
    assert rows[2]["error"] == pytest.approx(0.505)


def test_methods_share_a_letter_where_no_test_tells_them_apart(tmp_path: Path) -> None:
    # 12 blocks: b is behind a in each, p = 2 / 2^12, times 3 after Holm; a and c differ by chance alone
    errors = full({"a": 1.0, "b": 2.0}, instances=6)
    errors |= {("c", i, s): error + 0.001 * (-1) ** i for (_, i, s), error in full({"a": 1.0}, instances=6).items()}
    assert {row["name"]: row["letters"] for row in leaderboard(contest(tmp_path, errors))} == {
        "a": "a",
        "c": "a",
        "b": "b",
    }


def test_a_method_with_a_few_gaps_takes_part_and_the_gaps_are_counted(tmp_path: Path) -> None:
    errors = full({"a": 1.0, "b": 2.0}, instances=4)
    del errors["b", 3, 1]
    del errors["b", 3, 0]
    found = contest(tmp_path, errors)
    assert found.rows.shape == (2, 3, 2)
    assert found.left_out == 2


def test_the_leaderboard_has_middles_of_runs_and_baselines_have_skills_too(tmp_path: Path) -> None:
    found = contest(tmp_path, {("a", i, 0): error for i, error in enumerate([1.0, 2.0, 3.0, 50.0])})
    (row,) = leaderboard(found)
    assert row["error"] == pytest.approx(2.5)  # of four runs the first and the last are left out
    assert row["skill_mean_pose"] == pytest.approx(1.0 - 2.5 / 4.0)
    assert np.isnan(row["low"])  # one seed says nothing of others
    for base in baseline_rows(found, []):
        assert base["error"] == 4.0
        assert base["skill_nearest"] == 0.0


def test_pairs_say_who_is_better_and_how_surely(tmp_path: Path) -> None:
    found = paired_tests(contest(tmp_path, full({"a": 1.0, "b": 2.0}, instances=3, seeds=3)))
    assert found["ranks"].tolist() == [1.0, 2.0]
    ((first, second, difference, p, adjusted, better, low, high),) = found["pairs"]
    assert (first, second, better, low, high) == (0, 1, 1.0, 1.0, 1.0)
    assert difference == pytest.approx(-1.0)
    assert p == adjusted == pytest.approx(2.0 / 2**9)  # all nine differences have one sign, either of two


def test_curves_start_and_end_with_the_traces(tmp_path: Path) -> None:
    found = contest(tmp_path, full({"a": 1.0, "b": 2.0}))
    evaluations = grid(found)
    assert (evaluations[0], evaluations[-1]) == (40.0, 120.0)
    curve = convergence(found, evaluations)[0]
    assert curve is not None
    assert curve.values[0] == pytest.approx(4.0 * 1.055, rel=1e-6)  # of 1, 1.01, 1.1, 1.11 the middle two, times 4
    assert curve.values[-1] == pytest.approx(1.055, rel=1e-6)
    assert np.isnan(curve.low).all()  # of four runs
    shares = reached(found, evaluations)
    assert (np.diff(shares) >= 0.0).all()
    assert (shares[0] >= shares[1]).all()
    assert shares[0, -1] > 0.9
    assert joint_errors(found)[0].values[10] == pytest.approx(10.55, rel=1e-6)


def test_a_method_without_traces_has_no_curve_and_reaches_nothing(tmp_path: Path) -> None:
    none = {"evaluations": [], "cost": []}
    made = [
        result(replace(FIRST, method=m, seed=s), 1.0, **({"trace": none} if m == "b" else {}))
        for m in "ab"
        for s in (0, 1)
    ]
    found = contest_of(runs_of(Ledger(ledger(tmp_path / "results", made))))
    assert found is not None
    assert [one is None for one in convergence(found, grid(found))] == [False, True]
    assert reached(found, grid(found))[1].max() == 0.0


def test_certainty_is_pooled_over_runs_frame_by_frame(tmp_path: Path) -> None:
    first, second = [[10, 0.55, 0.5], [30, 1.0, 0.9]], [[30, 0.55, 0.3]]
    made = [
        result(replace(FIRST, method="a", seed=0), 1.0, **sure(0.7, 50.0, first, 0.1), swap_rate=0.2),
        result(replace(FIRST, method="a", seed=1), 1.0, **sure(0.8, 70.0, second, 0.5)),
        *(result(replace(FIRST, method="b", seed=s), 2.0) for s in (0, 1)),
    ]
    found = contest_of(runs_of(Ledger(ledger(tmp_path / "results", made))))
    assert found is not None
    told = certainty(found)
    assert told is not None
    assert told["levels"] == [0.5, 0.8, 0.95]
    a, b = told["methods"]
    assert b is None
    assert a["coverage"] == pytest.approx([0.45, 0.75, 0.9])
    assert a["width"] == pytest.approx([30.0, 60.0, 120.0])
    # of 40 frames near 0.55 are 5 + 9 right, of 30 at 1 are 27
    assert [one[0] for one in a["reliability"]] == [40, 30]
    np.testing.assert_allclose([one[1:] for one in a["reliability"]], [[0.55, 0.35], [1.0, 0.9]], rtol=1e-5)
    assert a["ece"] == pytest.approx((40 * 0.2 + 30 * 0.1) / 70, rel=1e-5)
    row = leaderboard(found)[0]
    assert (row["unknown"], row["swapped"], row["coverage_80"]) == pytest.approx((0.3, 0.1, 0.75))
    assert leaderboard(found)[1]["coverage_80"] is None


def test_where_nobody_says_how_sure_he_is_there_is_no_certainty(tmp_path: Path) -> None:
    assert certainty(contest(tmp_path, full({"a": 1.0, "b": 2.0}))) is None


def test_without_errors_nobody_is_compared(tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [result(FIRST, 1.0, error_degrees=None)])
    assert contest_of(runs_of(Ledger(made))) is None


def test_very_many_runs_are_drawn_of_some(tmp_path: Path) -> None:
    found = contest(tmp_path, full({"a": 1.0, "b": 2.0}, instances=10, seeds=4))
    assert found.fewer(1).rows.shape == (2, 10, 4)
    few = found.fewer(20_000)  # 1e8 / (100 resamples x 20,000 points x 2 methods) = 25 runs of a method
    assert few.rows.shape == (2, 10, 2)
    fewer = found.fewer(50_000)  # 10 runs: two seeds of every second instance
    assert fewer.rows.shape == (2, 5, 2)
    assert fewer.instances == (0, 2, 4, 6, 8)


def lossy() -> Errors:
    """Return five methods on four instances with three seeds, of which the worst has lost one run."""
    errors = {
        (name, i, s): k + 0.1 * i + 0.01 * s
        for k, name in enumerate("abcde", start=1)
        for i in range(4)
        for s in range(3)
    }
    del errors["e", 3, 2]
    return errors


def test_one_lost_run_takes_one_block_from_the_tests_and_not_a_seed_of_every_instance(tmp_path: Path) -> None:
    found = contest(tmp_path, lossy())
    assert found.rows.shape == (5, 4, 2)  # means have as many seeds of every instance
    assert found.blocks.shape == (5, 11)
    assert found.left_out == 4  # what the others made of the lost run's instance and seed
    tests = paired_tests(found)
    assert tests["blocks"] == 11
    # all eleven differences have one sign; of eight, ten pairs after Holm could never fall below 10 x 2 / 2^8 = 0.078
    assert [pair[4] for pair in tests["pairs"]] == pytest.approx([10 * 2 / 2**11] * 10)
    assert [row["letters"] for row in leaderboard(found)] == list("abcde")
