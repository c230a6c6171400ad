"""What `posefit report` writes and prints of single searches, and one line for every mistake."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import pytest

from posefit.reading import parsed_toml
from posefit.report.repeat import search_command
from posefit.sweep.plan import search_cells
from tests.cli.test_command_line import fails, run
from tests.report.browser import ledger, result
from tests.report.search.searched import cell, found, problems, searched
from tests.report.test_live import data_in, page_of
from tests.sweep.fake import cells

LOST = (cell("pso", instance=10_001, settings={"population_size": 20}, seed=3), ["ValueError: it had to"])


@pytest.fixture
def results(tmp_path: Path) -> Path:
    return searched(tmp_path / "results", {"cma": 10, "random": 2}, problems([1, 5], [9], 3), [LOST])


def test_the_answer_the_failures_and_the_leaderboard_are_printed_and_a_page_is_written(
    results: Path, tmp_path: Path
) -> None:
    done = run("report", results, "--out", tmp_path / "page.html", "--csv", tmp_path / "rows.csv")
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[0].startswith("cma leads with 37.9 % of all targets reached (95 % interval ")
    assert lines[1:3] == ["1 cell failed, left out of all figures: pso 1", "  1 x ValueError: it had to"]
    assert lines[3] == f"{'':32} targets %   95 % interval   above  alike"
    assert [line.split()[:2] for line in lines[4:6]] == [["cma", "37.9"], ["random", "10.3"]]
    assert lines[6].endswith("Wilcoxon's signed ranks on paired instances, Holm over 1 pair, 5 %")
    data = data_in((tmp_path / "page.html").read_text("utf-8"))
    assert data["answer"] == lines[0]
    assert data["failures"][0]["name"] == "pso on f1 in 9D, instance 10001, seed 3"
    assert data["header"]["unfinished"] == ["pso"]
    assert data["baselines"] == [{"baseline": "random", "reached": pytest.approx(10.345)}]
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 12 + 1


def test_json_has_the_answer_the_leaderboard_and_running_times(results: Path, tmp_path: Path) -> None:
    said = json.loads(run("report", results, "--out", tmp_path / "page.html", "--json").stdout)
    assert [row["name"] for row in said["leaderboard"]] == ["cma", "random"]
    assert said["times"][0]["times"][0] == 50.0
    assert said["answer"].startswith("cma leads")


def test_the_command_of_a_search_is_a_plan_of_that_one_cell() -> None:
    one = cell("pso", 7, 24, 3, seed=5, budget=30, infeasible="reject", settings={"population_size": 20})
    plan = search_command(one.spec).partition("<<'END'\n")[2].removesuffix("END")
    (other,) = search_cells(parsed_toml(plan))
    assert other.spec == {**one.spec, "version": other.version}


def test_where_every_search_failed_there_is_a_page_with_the_reasons(tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [], [LOST])  # type: ignore[list-item]
    done = run("report", made, "--out", tmp_path / "page.html")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines()[:2] == [
        "1 cell failed, left out of all figures: pso 1",
        "  1 x ValueError: it had to",
    ]


def test_a_sweep_that_goes_on_is_shown_too(results: Path) -> None:
    status, text = page_of(results)
    assert status == 200
    assert data_in(text)["live"]["done"] == 12


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--figures", "new"], "--figures must be given with a sweep of tracks, got one of single searches"),
        (["--iohprofiler", "new"], "got one of single searches: posefit suite table "),
    ],
)
def test_what_only_tracks_have_is_refused_in_one_line(
    words: list[str], message: str, results: Path, tmp_path: Path
) -> None:
    assert message in fails("report", results, "--out", tmp_path / "page.html", words[0], tmp_path / words[1])
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


@pytest.mark.parametrize("tracks_first", [False, True])
def test_a_ledger_of_both_kinds_is_refused_in_one_line(tmp_path: Path, tracks_first: bool) -> None:
    track, search = replace(cells(1)[0], frames=4), cell("cma")
    if tracks_first:
        made = ledger(tmp_path / "r", [result(track, 1.0)], [(search, ["no"])])  # type: ignore[list-item]
    else:
        made = ledger(tmp_path / "r", [found(search, 3)], [(track, ["no"])])
    said = fails("report", made, "--out", tmp_path / "page.html")
    assert "expected a ledger of tracks or one of single searches, got both in one" in said
    assert not (tmp_path / "page.html").exists()
