"""The sentences of a report's first screen, worked by hand."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.hooks import ClaimedOrder
from posefit.report.contest import Contest, baseline_rows, contest_of, leaderboard, paired_tests
from posefit.report.runs import runs_of
from posefit.report.selection import features_of, selected, selection_of
from posefit.report.summary import (
    leader_sentence,
    not_worse,
    others_clause,
    published_claims,
    three_tracks,
    unpaired_sentence,
)
from posefit.sweep.ledger import Ledger
from tests.report.browser import ledger, result
from tests.report.test_contest import FIRST, Errors, contest, full

ORDER = ClaimedOrder("a paper", "c beats b, and b beats a", ("a", "b", "c"))


def sentence(found: Contest) -> str:
    tests = paired_tests(found) if found.testable else None
    board = leaderboard(found)
    return leader_sentence(found, board, baseline_rows(found, board), tests)


def test_the_leader_and_methods_not_shown_to_be_worse_are_one_sentence(tmp_path: Path) -> None:
    # as in the letters of a leaderboard: b is behind a in each of 12 pairs; a and c differ by chance alone
    errors = full({"a": 1.0, "b": 2.0}, instances=6)
    errors |= {("c", i, s): error + 0.001 * (-1) ** i for (_, i, s), error in full({"a": 1.0}, instances=6).items()}
    found = contest(tmp_path, errors)
    first = leaderboard(found)[0]
    assert sentence(found) == (
        f"a leads with an error of 1.26° (95 % interval {first['low']:.2f}° to {first['high']:.2f}°), 0.00° ahead of "
        "c, on 6 instances of walk with 2 seeds each; c is not shown to be worse, and 1 other is worse (Wilcoxon's signed ranks over 12 "
        "paired runs, after Holm, at 5 %). The best baseline, the mean training pose, has 4.00°."
    )


def test_a_leader_by_the_mean_may_be_worse_on_most_runs(tmp_path: Path) -> None:
    # b is better in 11 of 12 instances, p = 0.034; in the fourth it is so much worse that its middle half is, too
    errors = {("a", i, 0): 1.0 + i for i in range(12)}
    errors |= {("b", i, 0): 7.5 if i == 3 else 0.9 + 0.999 * i for i in range(12)}
    said = sentence(contest(tmp_path, errors))
    assert said.startswith("a leads")
    assert "; all others differ, and on most runs b is better (Wilcoxon's signed ranks" in said


def test_the_sentence_counts_worse_methods_and_names_better_ones() -> None:
    tests = {
        "methods": (0, 1, 2, 3),
        "blocks": 9,
        "pairs": [[0, 1, 0.1, 0.2, 0.2], [0, 2, -3.0, 0.01, 0.01], [0, 3, 2.0, 0.01, 0.01], [1, 2, 0.0, 1.0, 1.0]],
    }
    assert others_clause(("a", "b", "c", "d"), 0, tests, "runs") == (
        "; b is not shown to be worse, and on most runs d is better, and 1 other is worse (Wilcoxon's signed ranks "
        "over 9 paired runs, after Holm, at 5 %)"
    )
    assert not_worse(tests, 0) == [1]
    assert not_worse(tests, 3) == []
    assert not_worse(None, 0) == []


def test_one_method_alone_and_one_run_alone_are_not_compared(tmp_path: Path) -> None:
    both = sentence(contest(tmp_path / "c", full({"a": 1.0, "b": 2.0}, instances=6)))
    assert "; every other method is worse (" in both
    alone = sentence(contest(tmp_path / "a", full({"a": 1.0})))
    assert alone.startswith("a has an error of 1.06° on 2 instances of walk with 2 seeds each; no other method")
    once = sentence(contest(tmp_path / "b", full({"a": 1.0, "b": 2.0}, instances=1, seeds=1)))
    assert "on 1 instance of walk with one seed; one shared run is too few" in once


def test_a_leader_behind_the_baselines_is_not_praised(tmp_path: Path) -> None:
    said = sentence(contest(tmp_path, full({"a": 5.0, "b": 6.0})))
    assert said.endswith("It does not beat the baselines: the best baseline, the mean training pose, has 4.00°.")


def test_the_best_the_median_and_the_worst_track_of_a_method_are_shown(tmp_path: Path) -> None:
    found = contest(tmp_path, {("a", i, 0): error for i, error in enumerate([3.0, 1.0, 2.0, 9.0])})
    shown = [(name, found.runs.figures["error"][row]) for name, row in three_tracks(found, 0)]
    assert shown == [("best", 1.0), ("median", 2.0), ("worst", 9.0)]
    two = contest(tmp_path / "two", {("a", i, 0): error for i, error in enumerate([3.0, 1.0])})
    assert [name for name, _ in three_tracks(two, 0)] == ["best", "worst"]
    one = contest(tmp_path / "one", {("a", 0, 0): 1.0})
    assert [name for name, _ in three_tracks(one, 0)] == ["best"]


def test_a_claimed_order_is_tested_step_by_step(tmp_path: Path) -> None:
    found = contest(tmp_path, full({"a": 3.0, "b": 2.0, "c": 1.0, "d": 0.5}, instances=3, seeds=2))
    (one,) = published_claims(found, [ORDER])
    assert [step["difference"] for step in one["steps"]] == pytest.approx([1.0, 1.0])
    assert [step["p"] for step in one["steps"]] == pytest.approx([2.0 / 2**6] * 2)
    assert [step["adjusted"] for step in one["steps"]] == pytest.approx([4.0 / 2**6] * 2)  # Holm's, of two
    assert [step["by_instance"] for step in one["steps"]] == pytest.approx([4.0 / 2**3] * 2)
    assert [step["confirmed"] for step in one["steps"]] == [False, False]  # 0.0625 is above 5 %
    assert one["errors"] == pytest.approx([3.105, 2.105, 1.105])
    assert (one["source"], one["said"]) == ("a paper", "c beats b, and b beats a")
    assert published_claims(contest(tmp_path / "two", full({"a": 1.0, "b": 2.0})), [ORDER]) == []


def test_a_step_is_confirmed_where_it_is_better_and_not_where_it_is_worse(tmp_path: Path) -> None:
    found = contest(tmp_path, full({"a": 2.0, "b": 1.0, "c": 3.0}, instances=6))
    (one,) = published_claims(found, [ORDER])
    assert [step["confirmed"] for step in one["steps"]] == [True, False]


def damaged(path: Path, errors: dict[str, tuple[float, float]], seeds: int = 2) -> Contest:
    """Return a contest on eight instances, of which the last four are damaged, with each method's error on either."""
    made = [
        result(
            replace(FIRST, method=name, instance=i, seed=s, corruption={"holes": 0.3} if i >= 4 else {}),
            both[i // 4] + 0.01 * s,
        )
        for name, both in errors.items()
        for i in range(8)
        for s in range(seeds)
    ]
    found = contest_of(runs_of(Ledger(ledger(path / "results", made))))
    assert found is not None
    return found


def test_a_selector_closes_the_gap_where_the_plan_tells_who_wins(tmp_path: Path) -> None:
    found = selection_of(damaged(tmp_path, {"clean": (1.0, 4.0), "tough": (3.0, 2.5)}))
    assert found is not None
    # means over seeds are 0.005 more: clean has 1 and 4, tough 3 and 2.5, the best of each instance 1 and 2.5
    assert (found["single"], found["oracle"], found["oracle_apart"]) == pytest.approx((2.505, 1.755, 1.755))
    assert found["selector"] == pytest.approx(1.755)
    assert found["closed"] == pytest.approx(1.0)
    assert found["features"] == ["holes"]
    assert sorted(found["wins"]) == [[0, 4, 4], [1, 4, 4]]
    parts = {one["part"]: (one["method"], one["behind"]) for one in found["where"]}
    clean, tough = (["clean", "tough"].index(name) for name in ("clean", "tough"))
    assert parts["damage: none"] == (clean, pytest.approx(0.0))
    assert parts["damage: holes 0.3"] == (tough, pytest.approx(1.5))


def test_of_many_instances_a_selector_is_trained_of_some_in_no_order_of_the_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # from each side one instance is damaged and one is not: every other one would be of one kind, its selector nonsense
    monkeypatch.setattr("posefit.report.selection.MAX_INSTANCES", 32)
    made = [
        result(
            replace(FIRST, method=name, view_degrees=(5.0 * i,), corruption={"holes": 0.3} if bad else {}), both[bad]
        )
        for name, both in {"clean": (1.0, 4.0), "tough": (3.0, 2.5)}.items()
        for i in range(32)
        for bad in (0, 1)
    ]
    contested = contest_of(runs_of(Ledger(ledger(tmp_path / "results", made))))
    assert contested is not None
    found = selection_of(contested)
    assert found is not None
    assert (found["instances"], found["trained"]) == (64, 32)
    assert found["oracle"] == pytest.approx(1.75)
    assert found["selector"] == pytest.approx(1.75, abs=0.4)


def test_a_selector_that_learns_nothing_takes_the_single_best() -> None:
    rng = np.random.default_rng(0)
    errors = rng.uniform(1.0, 2.0, (40, 3)) - np.array([0.5, 0.0, 0.0])
    assert selected(rng.uniform(size=(40, 1)), errors).tolist().count(0) >= 36


def test_an_instance_has_no_say_in_what_is_chosen_for_it() -> None:
    # each is alone with its feature: whoever had seen it would take its best method; nobody else can know that
    errors = np.ones((12, 2))
    errors[:, 1] += 0.1
    errors[5] = [9.0, 0.0]
    errors[0, 0] = 0.0  # so that the first is the best on average without the sixth, and with it is not
    assert selected(np.arange(12.0)[:, None] == 5.0, errors)[5] == 0


def test_an_oracle_scored_on_other_seeds_has_no_luck(tmp_path: Path) -> None:
    # on seed 0 a is better, on seed 1 b: who is best on the other seed is worse on this one
    errors: Errors = {}
    for i in range(3):
        errors |= {("a", i, 0): 1.0, ("a", i, 1): 2.0, ("b", i, 0): 2.0, ("b", i, 1): 1.1}
    found = selection_of(contest(tmp_path, errors))
    assert found is not None
    assert found["oracle_apart"] == pytest.approx(2.0)
    assert found["oracle"] == pytest.approx(1.5)
    assert found["selector"] is None
    assert found["why"] == "3 instances are too few to train a selector: at least 8"


def test_one_method_or_one_instance_leaves_nothing_to_choose(tmp_path: Path) -> None:
    assert selection_of(contest(tmp_path / "a", full({"a": 1.0}))) is None
    assert selection_of(contest(tmp_path / "b", full({"a": 1.0, "b": 2.0}, instances=1))) is None


def test_where_the_plan_says_the_same_of_all_there_is_no_selector(tmp_path: Path) -> None:
    found = selection_of(contest(tmp_path, full({"a": 1.0, "b": 2.0}, instances=9)))
    assert found is not None
    assert (found["selector"], found["closed"]) == (None, None)
    assert found["why"].startswith("the plan is the same for every instance")


def test_features_of_instances_are_named_by_the_fields_that_differ(tmp_path: Path) -> None:
    changes: dict[str, dict[str, Any]] = {
        "view": {"view_degrees": (90.0,)},
        "motion": {"motion": "run"},
        "frames": {"frames": 9},
        "cameras": {"view_degrees": (45.0, 90.0)},
        "size": {"size": (80, 60)},
    }
    for name, change in changes.items():
        made = [result(replace(cell, instance=i), 1.0) for cell in (FIRST, replace(FIRST, **change)) for i in range(3)]
        names, values = features_of(runs_of(Ledger(ledger(tmp_path / name, made))), range(6))
        assert names == [name]
        assert len(np.unique(values, axis=0)) == 2


def test_too_few_runs_for_any_difference_are_reported(tmp_path: Path) -> None:
    # of eight pairs the least p is 2 / 2^8, times ten after Holm; of nine it is half of that, and below 5 %
    errors = full(dict.fromkeys("abcde", 1.0) | {"e": 2.0}, instances=4, seeds=2)
    assert (
        "; too few runs to show any difference (over 8 paired runs Wilcoxon's p cannot be below 0.078 after Holm over "
        "10 pairs, and must be below 0.05)."
    ) in sentence(contest(tmp_path / "eight", errors))
    errors |= full(dict.fromkeys("abcde", 1.0) | {"e": 2.0}, instances=3, seeds=3)
    said = sentence(contest(tmp_path / "eleven", errors))
    assert "b, c and d are not shown to be worse, and 1 other is worse (" in said


def test_the_lead_is_in_degrees_and_lost_frames_of_the_first_two_are_counted(tmp_path: Path) -> None:
    lost = {("b", 1): 0.2, ("c", 0): 0.5}
    made = [
        result(replace(FIRST, method=m, instance=i), error + 0.1 * i, lost_rate=lost.get((m, i), 0.0))
        for m, error in {"a": 1.0, "b": 1.5, "c": 2.0}.items()
        for i in range(2)
    ]
    found = contest_of(runs_of(Ledger(ledger(tmp_path / "results", made))))
    assert found is not None
    said = sentence(found)
    assert "a leads with an error of 1.05°, 0.50° ahead of b, on 2 instances" in said
    assert "Frames are lost by a in 0 and b in 1 of 2 tracks." in said


def test_what_a_gap_costs_is_counted() -> None:
    assert unpaired_sentence(0, 0, 3, tested=True) == ""
    assert unpaired_sentence(4, 15, 2, tested=True) == (
        "4 finished runs are left out of the comparison, as some method has no run to pair them with; 15 more count in "
        "tests, but not in means and intervals, which are of 2 seeds of every instance"
    )
    assert unpaired_sentence(0, 3, 1, tested=False) == "3 count in no figure, which are of one seed of every instance"
