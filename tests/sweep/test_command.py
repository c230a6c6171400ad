"""What a user types, and what comes back: rows, a preview, and one line for every mistake."""

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posefit.sweep.plan import Plan
from posefit.sweep.schema import FILE
from posefit.sweep.writer import Writer
from tests.cases import each
from tests.commands import error_of, printed, run
from tests.report.browser import ledger, result
from tests.sweep.fake import cells, rows_in

PLAN = """
[defaults]
frames = 2
size = [80, 60]
evaluations = 80
settings.sapso.cooling = 0.9

[product]
methods = ["sapso@pca", "random@full"]
motions = ["walk"]
corruptions = [{}, { holes = 0.5 }]
seeds = 2
"""


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    path = tmp_path / "plan.toml"
    path.write_text(PLAN)
    return path


def test_a_sweep_writes_a_ledger_and_the_same_command_has_nothing_left_to_do(
    plan: Path, tmp_path: Path
) -> None:
    out = tmp_path / "deep" / "out"
    first = run("sweep", plan, "--out", out, "--workers", 1)
    assert first.exit_code == 0, first.stderr
    report = f"see the results: posefit report {out} --out {out}.html\n"
    assert (
        first.stdout == f"8 of 8 cells done, 8 of them now, written to {out}\n{report}"
    )
    assert first.stderr == ""  # a bar is for a terminal alone
    again = run("sweep", plan, "--out", out, "--workers", 2, "--json")
    assert again.exit_code == 0, again.stderr
    assert json.loads(again.stdout) == {
        "out": str(out), "cells": 8, "done": 8, "ran": 0, "failed": 0, "quarantined": 0, "stopped": False,
    }  # fmt: skip
    assert again.stderr == "8 of 8 cells are done already\n"
    assert run("sweep", plan, "--out", out, "--quiet").stderr == ""
    rows = rows_in(out)
    assert {row["spec"]["method"] for row in rows} == {"sapso@pca", "random@full"}
    sapso = next(row for row in rows if row["spec"]["method"] == "sapso@pca")
    assert sapso["spec"]["settings"] == {"sapso.cooling": 0.9}
    assert len(sapso["joint_errors_mm"]) == 27
    assert sum(sapso["joint_errors_mm"]) / 27 == pytest.approx(
        sapso["mpjpe_mm"], abs=1e-3
    )
    assert set(sapso["skill"]) == {"mean_pose", "persistence", "nearest"}
    assert (sapso["evaluations_used"], sapso["dimensions"]) == (2 * 80, 9)


def test_a_preview_counts_the_cells_and_runs_none(plan: Path, tmp_path: Path) -> None:
    done = run("sweep", plan, "--dry-run")
    assert done.exit_code == 0, done.stderr
    *lines, last, seconds = done.stdout.splitlines()
    assert lines == [
        "method            4 x sapso@pca, 4 x random@full",
        "motion            8 x walk",
        'settings          4 x {"sapso.cooling":0.9}, 4 x {}',
        'corruption        4 x {}, 4 x {"holes":0.5}',
        "seed              4 x 0, 4 x 1",
    ]
    assert last == "8 cells, 8 of them to run, 1,280 evaluations"  # 2 frames of 80 each
    assert re.fullmatch(r"about \d+ s on (one worker|\d+ workers)", seconds)
    assert [path.name for path in tmp_path.iterdir()] == ["plan.toml"]
    run("sweep", plan, "--out", tmp_path / "out")
    listed = printed("sweep", plan, "--dry-run", "--out", tmp_path / "out")
    assert [cell["done"] for cell in listed["cells"]] == [True] * 8


def test_a_preview_finds_a_setting_that_a_factory_refuses(plan: Path) -> None:
    plan.write_text(
        '[[cells]]\nmethod = "sapso@pca"\nmotion = "walk"\nsettings = {"sapso.inertia" = -1.0}\n'
    )
    message = error_of("sweep", plan, "--dry-run")
    assert "sapso@pca with sapso.inertia=-1.0 fails in its first frames: " in message


def test_quarantined_cells_are_run_again_on_request(plan: Path, tmp_path: Path) -> None:
    plan.write_text(
        '[[cells]]\nmethod = "random@pca"\nmotion = "walk"\nframes = 1\nevaluations = 80\n'
    )
    words = ["sweep", plan, "--out", tmp_path / "out", "--workers", 1]
    out = tmp_path / "out"
    (cell,) = Plan.read(plan)
    with Writer(out / FILE) as ledger:
        ledger.plan([cell])
        for _ in range(3):
            ledger.fail(cell.key, "the disk of its files was away")
    lost = run(*words)
    assert lost.exit_code == 1
    assert (
        f"written to {out}; 1 quarantined: posefit report names the reasons"
        in lost.stdout
    )
    still = run(*words)
    assert "1 cell in quarantine: --retry-quarantined tries again" in still.stderr
    assert "done already" not in still.stderr
    again = run(*words, "--retry-quarantined")
    assert again.exit_code == 0, again.stderr
    assert "1 of 1 cells done, 1 of them now" in again.stdout
    assert "1 quarantined cell is tried again" in again.stderr


@each(
    ("words", "message"),
    [
        (["PLAN"], "--out must name a folder for the results, got none"),
        (["PLAN", "--out", "OUT", "--workers", "0"], "--workers must be at least 1, got 0"),
        (["PLAN", "--out", "OUT", "--workers", "1", "--scheduler", "tcp://a:1"], "--workers must not be given with --scheduler"),
        (["PLAN", "--out", "OUT", "--shard", "3/2"], "--shard must be I/N such as 2/8, got 3/2"),
        (["PLAN", "--out", "OUT", "--shard", "2"], "--shard must be I/N such as 2/8, got 2"),
        (["PLAN", "--dry-run", "--shard", "3/2"], "--shard must be I/N such as 2/8, got 3/2"),
        (["PLAN", "--dry-run", "--shard", "a/b"], "--shard must be I/N such as 2/8, got a/b"),
        (["PLAN", "--dry-run", "--shard", "0/2"], "--shard must be I/N such as 2/8, got 0/2"),
        (["PLAN", "--dry-run", "--shard", "1/0", "--json"], "--shard must be I/N such as 2/8, got 1/0"),
        (["PLAN", "--out", "OUT", "--cell-seconds", "0"], "the limit of seconds must lie in 0.001 to 1e+08, got 0.0"),
        (["PLAN", "--out", "OUT", "--cell-seconds", "inf"], "the limit of seconds must lie in 0.001 to 1e+08, got inf"),
        (["PLAN", "--out", "OUT", "--cell-gigabytes", "1e30"], "limit of gigabytes must lie in 0.001 to 1e+06, got 1e+30"),
        (["BAD", "--out", "OUT"], "bad.toml: a key of defaults must be one of"),
        (["BAD", "--out", "OUT", "--dry-run"], "bad.toml: a key of defaults must be one of"),
    ],
)  # fmt: skip
def test_mistakes_are_reported_in_one_line_and_write_nothing(
    words: list[str], message: str, plan: Path, tmp_path: Path
) -> None:
    (tmp_path / "bad.toml").write_text("[defaults]\nframe = 3\n")
    places = {"PLAN": plan, "OUT": tmp_path / "out", "BAD": tmp_path / "bad.toml"}
    assert message in error_of("sweep", *(places.get(word, word) for word in words))
    assert not (tmp_path / "out").exists()


def test_names_of_a_ledger_neither_steer_a_terminal_nor_forge_lines(
    tmp_path: Path,
) -> None:
    cell = replace(cells(1)[0], method="sapso@\x1b[31m\nno method is better")
    other = replace(cell, seed=1)
    folder = ledger(
        tmp_path / "results", [result(cell, 1.0)], [(other, ["it\x1b[2J\ntook ages"])]
    )
    shown = run("report", folder)
    assert shown.exit_code == 0, shown.output
    assert "\x1b" not in shown.output
    for name in (r"sapso@\x1b[31m\nno method is better", r"it\x1b[2J\ntook ages"):
        assert name in shown.stdout
    assert not any(
        line.startswith(("no method", "took ages"))
        for line in shown.stdout.splitlines()
    )


def test_without_distributed_the_message_names_the_package_to_install(
    plan: Path, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    line = error_of(
        "sweep", plan, "--out", tmp_path / "out", "--scheduler", "tcp://a:1"
    )
    assert line.endswith("python -m pip install 'posefit[dask]'")
