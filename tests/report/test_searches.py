"""Reports of single searches: the numbers worked by hand, what the command writes and prints, and mistakes."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.report.content import data_of
from posefit.report.leaderboard import standings_of
from posefit.report.reading import runs_of
from posefit.sweep.ledger import Ledger
from tests.commands import error_of, run
from tests.files import csv_rows
from tests.report.browser import data_in, ledger, result, written
from tests.report.contests import (
    FIRST,
    baselines,
    board_of,
    contest_in,
    runs_in,
    sentences,
)
from tests.report.searched import cell, problems, search_result, searched

LOST = (
    cell("pso", instance=10_001, settings={"population_size": 20}, seed=3),
    ["ValueError: it had to"],
)


def test_the_leader_and_its_certainty_are_one_sentence(tmp_path: Path) -> None:
    # of 29 targets 10, 11 or 12 in turn, by function and instance: 11 on average, 37.9 %
    contest = contest_in(
        searched(tmp_path / "r", {"cma": 10, "random": 2}, problems([1, 5], [9, 24], 3))
    )
    board = board_of(contest)
    assert [(row["name"], row["runs"]) for row in board] == [
        ("cma", 12),
        ("random", 12),
    ]
    assert [row["reached"] for row in board] == pytest.approx(
        [1100.0 / 29.0, 300.0 / 29.0]
    )
    assert sentences(contest) == [
        f"cma reached 37.9 % of all targets (95 % interval {board[0]['low']:.1f} % to "
        f"{board[0]['high']:.1f} %) on functions 1 and 5 in 9 and 24 dimensions, 6 "
        "instances in all with one seed; it leads random by 27.6 points (27.6 points to 27.6 points, p = 0.031).",
        "Random search reached 10.3 %.",
    ]


def test_the_interval_is_over_instances_in_any_number_of_dimensions(
    tmp_path: Path,
) -> None:
    flat, both = (
        searched(tmp_path / str(len(d)), {"cma": 10}, problems([1], d, 3))
        for d in ([9], [9, 24])
    )
    rows = [board_of(contest_in(path))[0] for path in (flat, both)]
    # 10, 11 and 12 of 29: a standard deviation of 1, so t of 2 degrees of freedom, 4.302653, over the root of 3
    assert rows[0]["high"] - rows[0]["reached"] == pytest.approx(
        4.302653 / math.sqrt(3.0) * 100.0 / 29.0
    )
    assert rows[1]["high"] == pytest.approx(rows[0]["high"])


def test_a_difference_is_that_of_the_scores_however_many_runs_an_instance_has(
    tmp_path: Path,
) -> None:
    # function 1 has two dimensions, function 7 one: b is better in the first, a in the
    # other, by 3 and 4 targets; so b is ahead by (2 x 3 - 4) / 3 of 29, not by -1 / 2
    rows = []
    for function, dimension, instance in problems([1], [9, 24], 4) + problems(
        [7], [24], 4
    ):
        targets = {"a": 10, "b": 13} if function == 1 else {"a": 10, "b": 6}
        for method, count in targets.items():
            made = cell(method, function, dimension, instance)
            rows.append(search_result(made, count + instance % 2))
    board = board_of(contest_in(ledger(tmp_path / "r", rows)))
    assert [row["name"] for row in board] == ["b", "a"]
    behind = board[0]["reached"] - board[1]["reached"]
    assert behind == pytest.approx(100.0 * 2.0 / 3.0 / 29.0)
    assert board[1]["behind"] == pytest.approx(behind)


def test_random_search_is_the_baseline_unless_it_leads_or_is_missing(
    tmp_path: Path,
) -> None:
    text = sentences(
        contest_in(
            searched(tmp_path / "a", {"cma": 3, "random": 6}, problems([1], [9], 6))
        )
    )
    assert text[0].startswith("random reached ")
    assert text[-1] == "That is random search: no method does better."
    alone = contest_in(searched(tmp_path / "b", {"cma": 3}, problems([1], [9], 1)))
    assert sentences(alone) == [
        "cma reached 17.2 % of all targets on function 1 in 9 dimensions, 1 instance in all with one seed.",
        "No other method shares its runs.",
    ]
    assert baselines(alone) == []
    once = contest_in(
        searched(tmp_path / "c", {"cma": 3, "pso": 2}, problems([1], [9, 24], 1))
    )
    assert "One shared instance shows no difference between methods." in sentences(once)


def test_methods_differ_in_settings_budget_and_infeasible_proposals(
    tmp_path: Path,
) -> None:
    more: list[dict[str, Any]] = [
        {},
        {"settings": {"population_size": 20}},
        {"budget": 30},
        {"infeasible": "reject"},
    ]
    made = [
        search_result(cell("pso", instance=10_000 + i, **dict(fields)), 5)
        for fields in more
        for i in range(2)
    ]
    assert sorted(runs_in(ledger(tmp_path / "r", made)).methods) == [
        "pso (budget 100, infeasible reject)",
        "pso (budget 100, infeasible repair)",
        "pso (budget 30, infeasible repair)",
        "pso (population_size 20, budget 100, infeasible repair)",
    ]


def test_curves_and_running_times_follow_from_the_traces(tmp_path: Path) -> None:
    # 9 + 2 and 9; 9 and 9 + 1
    path = searched(tmp_path / "r", {"cma": 9}, problems([1, 5], [9], 2))
    with Ledger(path) as results:
        runs = runs_of(results)
        data = data_of(results, runs, standings_of(runs))
    assert [chart["title"] for chart in data["charts"]] == [
        "All functions",
        "1 single image",
        "5 sequence",
    ]
    together, first, _ = (chart["lines"][0]["y"] for chart in data["charts"])
    evaluations = data["charts"][0]["lines"][0]["x"]
    assert (evaluations[0], evaluations[-1]) == pytest.approx((1.0, 100.0))
    # the first target falls at the tenth evaluation, 1.1 for each dimension
    assert together[0] == 0.0
    assert together[-1] == pytest.approx(39.0 / (4.0 * 29.0))
    assert first[-1] == pytest.approx(20.0 / (2.0 * 29.0))
    half = int(np.searchsorted(evaluations, 5.0))
    assert together[half] == pytest.approx(
        min(int(evaluations[half] * 9.0 / 10.0), 9) / 29.0
    )
    last = data["charts"][0]["lines"][0]
    row = data["leaderboard"][0]
    assert [100.0 * last[end][-1] for end in ("low", "high")] == pytest.approx(
        [row["low"], row["high"]]
    )
    # +16 is the fifth target, at the 50th evaluation; +4 the 13th, which no run reaches
    times = [(row["function"], row["times"]) for row in data["times"]]
    # and no mean of both
    assert times == [(function, [50.0, None, None, None]) for function in (1, 5)]


def test_the_command_prints_the_leader_failures_and_leaderboard_and_writes_a_page(
    tmp_path: Path,
) -> None:
    results = searched(
        tmp_path / "results", {"cma": 10, "random": 2}, problems([1, 5], [9], 3), [LOST]
    )
    lines, page = written(results, "--csv", tmp_path / "rows.csv")
    rows = csv_rows(tmp_path / "rows.csv")
    first = next(row for row in rows if row["method"] == "cma")
    # the command repeats a row without the ledger
    assert first["command"].startswith("posefit sweep - --out rerun <<'END'\n")
    assert f"\ninstances = [{first['instance']}]\n" in first["command"]
    assert lines[0].startswith("cma reached 37.9 % of all targets (95 % interval ")
    assert lines[2:4] == [
        "1 cell failed, left out of all figures: pso 1",
        "  1 x ValueError: it had to",
    ]
    assert lines[4] == "no cell finished, so not on the leaderboard: pso"
    titles = " ".join(lines[5].split())
    assert titles == "targets % 95 % interval behind points p above"
    assert [line.split()[:2] for line in lines[6:8]] == [
        ["cma", "37.9"],
        ["random", "10.3"],
    ]
    data = data_in(page)
    assert data["answer"] == lines[:2]
    assert data["failures"][0]["name"] == "pso on f1 in 9D, instance 10001, seed 3"
    assert data["baselines"] == [
        {
            "baseline": "random",
            "title": "random search",
            "reached": pytest.approx(10.345),
        }
    ]
    assert len(csv_rows(tmp_path / "rows.csv")) == 12 + 1
    printed = json.loads(run("report", results, "--json").stdout)
    assert [row["name"] for row in printed["leaderboard"]] == ["cma", "random"]
    assert printed["times"][0]["times"][0] == 50.0
    assert printed["answer"][0].startswith("cma reached")
    mistake = error_of("report", results, "--figures", tmp_path / "new")
    assert (
        "--figures must be given with a sweep of tracks, got one of single searches"
        in mistake
    )
    assert not (tmp_path / "new").exists()


def test_a_ledger_of_tracks_and_searches_is_refused(tmp_path: Path) -> None:
    search = cell("cma")
    for path in (
        ledger(tmp_path / "a", [result(FIRST, 1.0)], [(search, ["no"])]),
        ledger(tmp_path / "b", [search_result(search, 3)], [(FIRST, ["no"])]),
    ):
        message = error_of("report", path, "--out", tmp_path / "page.html")
        assert (
            "expected a ledger of either tracks or single searches, got both" in message
        )
        assert not (tmp_path / "page.html").exists()
