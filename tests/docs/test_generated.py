"""The pages and the drawing that are made from the code say what the code does."""

import json
import os
import pkgutil
import re
import subprocess
import sys
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from generator import angles, figures, messages, settings
from generator.prose import restructured

import posefit
from posefit import track
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.angles import COLUMNS
from posefit.measuring.centres import PLACES
from posefit.registry import registry
from posefit.report.leaderboard import standings_of
from posefit.report.reading import runs_of
from posefit.report.table import board_rows
from posefit.report.write import write_report
from posefit.silhouette.corruption import CORRUPTIONS
from posefit.sweep.cell import DROPPED, TrackCell, run_cell
from posefit.sweep.check import FIELDS, cell_of, search_of
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import LISTS
from tests.docs.pages import DOCS
from tests.report.browser import ledger, result
from tests.report.contests import FIRST


def rows(page: str) -> set[str]:
    """Return what the rows of a page's tables begin with."""
    return set(re.findall(r"^\| `([^`]+)` \|", page, re.MULTILINE))


def test_the_settings_of_every_method_are_described() -> None:
    page = settings.page()
    names = [
        offer.name for offers in registry().offers.values() for offer in offers.values()
    ]
    assert [name for name in names if f"`{name}`" not in page] == []


def test_messages_are_listed_with_their_modules_and_the_advice_of_their_page() -> None:
    page = messages.page()
    assert (
        "| `... must have shape ..., got ...` | `posefit.arrays.__init__` |\n" in page
    )
    assert page.count("\n| `") > 400
    (row,) = re.findall(r"^\| `views must have the same frames.*", page, re.MULTILINE)
    assert "`posefit.footage.cameras` | cut the views to the same moments" in row


@pytest.fixture(scope="module")
def tracked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("docs") / "walk"
    track("walk", frames=(0, 2), evaluations=80, out=out)
    return out


def test_every_key_of_summary_json_is_described(tracked: Path) -> None:
    summary = json.loads((tracked / "summary.json").read_text("utf-8"))
    described = {*figures.REQUEST, *figures.MEASURES, *figures.RESULT}
    assert set(summary) <= described
    assert described - set(summary) <= {"history"}  # of a single frame


def head_of(path: Path) -> list[str]:
    """Return the names of a table's columns."""
    return path.read_text("utf-8").splitlines()[0].split(",")


def test_every_column_of_frames_csv_is_described(tracked: Path) -> None:
    of_places = {f"{place}_{axis}" for place in PLACES for axis in "xyz"}
    assert [
        name for name in head_of(tracked / "frames.csv") if name not in of_places
    ] == list(figures.FRAME)


def columns_of(page: str, heading: str) -> set[str]:
    """Return the columns that a section of a page describes."""
    section = page.partition(f"## Columns of {heading}")[2].partition("\n## ")[0]
    rows = re.findall(r"^\| (`.+?`) \|", section, re.MULTILINE)
    return {name for row in rows for name in re.findall(r"`([^`]+)`", row)}


def test_every_column_of_a_sweeps_csv_is_described(tmp_path: Path) -> None:
    small = {"motion": "walk", "frames": 2, "evaluations": 80}
    problem = {"suite": "posefit-2026.3", "function": 1, "dimension": 9, "instance": 3}
    rows_of_cells = [
        run_cell(cell_of({"method": "sapso@pca", **small})),
        run_cell(cell_of({"method": "exemplars", **small, "evaluations": 800})),
        run_cell(search_of({"method": "random", **problem, "seed": 1, "budget": 5})),
    ]
    described = columns_of(figures.page(), "a sweep's CSV")
    present: set[str] = set()
    for k, made in enumerate(rows_of_cells):
        path = ledger(tmp_path / f"results-{k}", [made])
        write_report(str(path), None, csv=str(tmp_path / f"{k}.csv"))
        present |= set(head_of(tmp_path / f"{k}.csv"))
    joints = {name for name in present if name.startswith("joint_errors_mm.")}
    assert len(joints) == len(JOINTS)
    stages = {name for name in present if name.startswith("effort.")}
    assert "effort.frames" in stages
    # without a value they have one column
    whole = {"coverage", "interval_mm"}
    by_kind = {"joint_errors_mm.JOINT", "effort.STAGE"}
    assert present - joints - stages - whole == described - by_kind


def test_every_column_of_a_leaderboard_is_described(tmp_path: Path) -> None:
    made = [result(replace(FIRST, method=m), 1.0) for m in "ab"]
    path = ledger(tmp_path / "results", made)
    with Ledger(path) as opened:
        standings = standings_of(runs_of(opened))
    assert standings is not None
    columns = set(board_rows(standings)[0])
    described = columns_of(figures.page(), "`leaderboard.csv`")
    assert (
        columns - {"method", "settings", *standings.contest.runs.table_figures}
        == described
    )


def test_every_angle_is_described(tracked: Path) -> None:
    assert head_of(tracked / "angles.csv") == ["frame", "seconds", *COLUMNS]
    described = re.findall(r"^\| `(\w+)` \|", angles.page(), re.MULTILINE)
    assert {name.partition("_")[2] for name in COLUMNS} == set(described)
    page = (
        (DOCS / "howto" / "measuring.md")
        .read_text("utf-8")
        .partition("of `gait.csv`")[2]
    )
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == head_of(
        tracked / "gait.csv"
    )


def test_generated_pages_are_up_to_date() -> None:
    # in a process of its own, because other tests register plugins, which --help names
    code = "import generator, json; print(json.dumps(generator.pages()))"
    made = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(DOCS), *sys.path])},
        capture_output=True,
        encoding="utf-8",
        check=True,
    )
    # words alone: another click breaks lines elsewhere
    differing = [
        name
        for name, text in json.loads(made.stdout).items()
        if text.split() != (DOCS / name).read_text("utf-8").split()
    ]
    assert differing == [], "python docs/generator writes them"


def test_a_plan_is_described_with_every_field_list_and_corruption() -> None:
    page = (DOCS / "howto" / "plan.md").read_text("utf-8")
    assert set(FIELDS) | set(LISTS) | set(CORRUPTIONS) | {DROPPED} == rows(page)
    defaults: dict[str, Any] = {one.name: one.default for one in fields(TrackCell)}
    for name in ("instance", "frames", "fps", "evaluations", "seed"):
        assert f"| `{name}` | {defaults[name]:g} |" in page
    for name, text in (
        ("size", list(defaults["size"])),
        ("view_degrees", f"{defaults['view_degrees'][0]:g}"),
        *((name, f'"{defaults[name]}"') for name in ("translation", "first_pose")),
    ):
        assert f"| `{name}` | {text} |" in page


def test_a_docstring_is_read_as_plain_text() -> None:
    assert (
        restructured(["`a`s and b* and c_ of |d|"])[0]
        == "``a``\\ s and b\\* and c\\_ of \\|d\\|"
    )
    assert restructured(["So:", "", "    x = 1"])[:5] == [
        "So:",
        "",
        "::",
        "",
        "    x = 1",
    ]
    assert restructured(["    x = 1", "", "    y = 2"]) == [
        "::",
        "",
        "    x = 1",
        "",
        "    y = 2",
        "",
    ]
    assert restructured(["one   first", "two   second"])[0] == "::"
    assert restructured(["| a | b |", "|---|---|", "| 1 | 2 |"])[0] == ".. list-table::"
    assert restructured(["Settings:", "    a (b): c"])[:3] == [
        "Settings:",
        "",
        "* **a (b)**: c",
    ]


def test_the_page_of_the_architecture_lists_every_package() -> None:
    page = (DOCS / "background" / "architecture.md").read_text("utf-8")
    packages = {
        module.name
        for module in pkgutil.iter_modules(posefit.__path__)
        if not module.name.startswith("_")
    }
    assert [name for name in sorted(packages) if f"`{name}`" not in page] == []
