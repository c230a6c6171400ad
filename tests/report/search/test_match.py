"""Methods of single searches held against each other, and the sentence about them, worked by hand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.report.search.answer import search_sentence
from posefit.report.search.content import data_of_searches
from posefit.report.search.match import Match, instance_tests, left_out, match_of, random_rows, search_board
from posefit.report.search.rows import searches_of
from posefit.sweep.ledger import Ledger
from tests.report.browser import ledger
from tests.report.search.searched import cell, found, problems, searched


def match(path: Path) -> Match:
    made = match_of(searches_of(Ledger(path)))
    assert made is not None
    return made


def sentence(one: Match) -> str:
    tests = instance_tests(one)
    board = search_board(one, tests)
    return search_sentence(one, board, random_rows(one, board), tests)


def test_who_leads_on_what_and_how_surely_is_one_sentence(tmp_path: Path) -> None:
    # of 29 targets 10, 11 or 12 in turn, by function and instance: 11 on average, 37.9 %
    one = match(searched(tmp_path / "r", {"cma": 10, "random": 2}, problems([1, 5], [9, 24], 3)))
    board = search_board(one, instance_tests(one))
    assert [(row["name"], row["runs"], row["letters"]) for row in board] == [("cma", 12, "a"), ("random", 12, "b")]
    assert [row["reached"] for row in board] == pytest.approx([1100.0 / 29.0, 300.0 / 29.0])
    assert sentence(one) == (
        f"cma leads with 37.9 % of all targets reached (95 % interval {board[0]['low']:.1f} % to "
        f"{board[0]['high']:.1f} %) on functions 1 and 5 in 9 and 24 dimensions, 6 instances in all with one seed; every "
        "other method can be told apart and is worse (Wilcoxon's signed ranks over 6 paired instances, after Holm, at 5 "
        "%). Random search reached 10.3 %."
    )


def test_the_interval_is_that_of_instances_and_two_dimensions_of_one_are_no_two_of_them(tmp_path: Path) -> None:
    flat, both = (searched(tmp_path / str(len(d)), {"cma": 10}, problems([1], d, 3)) for d in ([9], [9, 24]))
    rows = [search_board(match(path), None)[0] for path in (flat, both)]
    # 10, 11 and 12 of 29: a standard deviation of 1, so t of 2 degrees of freedom, 4.302653, over the root of 3
    assert rows[0]["high"] - rows[0]["reached"] == pytest.approx(4.302653 / math.sqrt(3.0) * 100.0 / 29.0)
    assert rows[1]["high"] == pytest.approx(rows[0]["high"])


def test_random_search_that_leads_is_called_so_and_without_it_there_is_no_baseline(tmp_path: Path) -> None:
    said = sentence(match(searched(tmp_path / "a", {"cma": 3, "random": 6}, problems([1], [9], 6))))
    assert said.startswith("random leads with ")
    assert said.endswith(" That is random search: nobody does better.")
    alone = match(searched(tmp_path / "b", {"cma": 3}, problems([1], [9], 1)))
    assert sentence(alone) == (
        "cma has 17.2 % of all targets reached on function 1 in 9 dimensions, 1 instance in all with one seed; "
        "no other method shares its runs."
    )
    assert random_rows(alone, search_board(alone, None)) == []
    once = match(searched(tmp_path / "c", {"cma": 3, "pso": 2}, problems([1], [9, 24], 1)))
    assert "; one shared instance is too few to tell it apart from any other method" in sentence(once)


def test_methods_are_told_apart_by_settings_budget_and_what_becomes_of_the_infeasible(tmp_path: Path) -> None:
    more: list[dict[str, Any]] = [{}, {"settings": {"population_size": 20}}, {"budget": 30}, {"infeasible": "reject"}]
    made = [found(cell("pso", instance=10_000 + i, **dict(one)), 5) for one in more for i in range(2)]
    names = searches_of(Ledger(ledger(tmp_path / "r", made))).methods
    assert sorted(names) == [
        "pso, 100 evaluations for each dimension, infeasible: reject",
        "pso, 100 evaluations for each dimension, infeasible: repair",
        "pso, 30 evaluations for each dimension, infeasible: repair",
        "pso, population_size=20, 100 evaluations for each dimension, infeasible: repair",
    ]


def test_problems_that_one_method_takes_from_all_are_named(tmp_path: Path) -> None:
    made = [found(cell(m, instance=10_000 + i), 5) for m in ("cma", "pso") for i in range(3) if (m, i) != ("pso", 1)]
    one = match(ledger(tmp_path / "r", made))
    (gap,) = left_out(one)
    assert one.searches.problems[gap["instance"]][:3] == (1, 9, 10_001)
    assert [one.searches.methods[m] for m in gap["missing"]] == ["pso"]
    assert len(one.problems) == 2


def test_curves_and_running_times_are_those_of_the_traces(tmp_path: Path) -> None:
    path = searched(tmp_path / "r", {"cma": 9}, problems([1, 5], [9], 2))  # 9 + 2 and 9; 9 and 9 + 1
    data = data_of_searches(searches_of(Ledger(path)))
    assert [one["title"] for one in data["curves"]] == ["All functions", "1 single image", "5 mismatched body"]
    (together,), (first,), _ = (one["shares"] for one in data["curves"])
    assert (data["evaluations"][0], data["evaluations"][-1]) == pytest.approx((1.0, 100.0))
    assert together[0] == 0.0  # the first target falls at the tenth evaluation, 1.1 for each dimension
    assert together[-1] == pytest.approx(39.0 / (4.0 * 29.0))
    assert first[-1] == pytest.approx(20.0 / (2.0 * 29.0))
    middle = int(np.searchsorted(data["evaluations"], 5.0))
    reached = min(int(data["evaluations"][middle] * 9.0 / 10.0), 9)
    assert together[middle] == pytest.approx(reached / 29.0)
    # +16 is the fifth target, at the 50th evaluation; +4 the 13th, which nobody reaches
    assert [(row["function"], row["times"]) for row in data["times"]] == [
        (function, [50.0, None, None, None]) for function in (0, 1, 5)
    ]
