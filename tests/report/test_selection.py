"""The best method of each instance, and the gain of choosing by the instance, worked by hand."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.report.contest import Contest
from posefit.report.selection import features_of, selected, selection_of
from tests.report.browser import result
from tests.report.contests import FIRST, Errors, contest_of_errors, contest_of_results, full

METHODS = {"clean": (1.0, 4.0), "tough": (3.0, 2.5)}  # errors on undamaged and on damaged instances


def damaged(path: Path, instances: int, seeds: int = 2, view_step: float = 0.0) -> Contest:
    """Return a contest on twice as many instances, of which every second one is damaged."""
    made = []
    for name, errors in METHODS.items():
        for k, s in np.ndindex(2 * instances, seeds):
            corruption = {"holes": 0.3} if k % 2 else {}
            cell = replace(FIRST, method=name, instance=k, seed=s, corruption=corruption)
            cell = replace(cell, view_degrees=(45.0 + view_step * (k // 2),))
            made.append(result(cell, errors[k % 2] + 0.01 * s))
    return contest_of_results(path, made)


def selection(contest: Contest) -> dict[str, Any]:
    content = selection_of(contest)
    assert content is not None
    return content


def test_a_selector_closes_the_gap_where_the_plan_says_which_method_wins(tmp_path: Path) -> None:
    content = selection(damaged(tmp_path, 4))
    # means over seeds are 0.005 more: clean has 1 and 4, tough 3 and 2.5, the best of each instance 1 and 2.5
    assert (content["single"], content["oracle"], content["oracle_apart"]) == pytest.approx((2.505, 1.755, 1.755))
    assert content["selector"] == pytest.approx(1.755)
    assert content["closed"] == pytest.approx(1.0)
    assert content["features"] == ["holes"]
    assert sorted(content["wins"]) == [[0, 4, 4], [1, 4, 4]]
    parts = {part["part"]: (part["method"], part["behind"]) for part in content["where"]}
    assert parts == {"damage: none": (0, pytest.approx(0.0)), "damage: holes 0.3": (1, pytest.approx(1.5))}


def test_a_selector_of_many_instances_is_trained_on_a_random_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # every second instance is damaged: a part of every second one would be of one kind
    monkeypatch.setattr("posefit.report.selection.MAX_INSTANCES", 32)
    content = selection(damaged(tmp_path, 32, seeds=1, view_step=5.0))
    assert (content["instances"], content["trained"]) == (64, 32)
    assert content["oracle"] == pytest.approx(1.75)
    assert content["selector"] == pytest.approx(1.75, abs=0.4)


def test_a_selector_without_useful_features_takes_the_single_best() -> None:
    rng = np.random.default_rng(0)
    errors = rng.uniform(1.0, 2.0, (40, 3)) - np.array([0.5, 0.0, 0.0])
    assert selected(rng.uniform(size=(40, 1)), errors).tolist().count(0) >= 36


def test_an_instance_does_not_train_the_choice_made_for_it() -> None:
    # the sixth is alone with its feature: a tree trained on it would take its best method, the others cannot know it
    errors = np.ones((12, 2))
    errors[:, 1] += 0.1
    errors[5] = [9.0, 0.0]
    errors[0, 0] = 0.0  # so that the first is the best on average without the sixth, and with it is not
    assert selected(np.arange(12.0)[:, None] == 5.0, errors)[5] == 0


def test_an_oracle_scored_on_other_seeds_has_no_luck(tmp_path: Path) -> None:
    # on seed 0 a is better, on seed 1 b: the best on the other seed is worse on this one
    errors: Errors = {}
    for i in range(3):
        errors |= {("a", i, 0): 1.0, ("a", i, 1): 2.0, ("b", i, 0): 2.0, ("b", i, 1): 1.1}
    content = selection(contest_of_errors(tmp_path, errors))
    assert (content["oracle_apart"], content["oracle"]) == pytest.approx((2.0, 1.5))
    assert content["selector"] is None
    assert content["why"] == "3 instances are too few to train a selector: at least 8"


def test_without_a_choice_or_without_features_there_is_no_selector(tmp_path: Path) -> None:
    assert selection_of(contest_of_errors(tmp_path / "a", full({"a": 1.0}))) is None
    assert selection_of(contest_of_errors(tmp_path / "b", full({"a": 1.0, "b": 2.0}, instances=1))) is None
    content = selection(contest_of_errors(tmp_path / "c", full({"a": 1.0, "b": 2.0}, instances=9)))
    assert (content["selector"], content["closed"]) == (None, None)
    assert content["why"].startswith("the plan is the same for every instance")


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
        names, values = features_of(contest_of_results(tmp_path / name, made).runs, range(6))
        assert names == [name]
        assert len(np.unique(values, axis=0)) == 2
