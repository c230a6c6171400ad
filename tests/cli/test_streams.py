"""Standard streams that are closed, full or files: the work goes on, and what cannot be said is one line."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from unittest.mock import Mock

import pytest

from tests.cases import each
from tests.commands import run

TRACK = "track walk --frames 0:2 --size 60x45 --method random --evaluations 40"
PLAN = """
[defaults]
frames = 2
size = [60, 45]
evaluations = 40

[product]
methods = ["random@pca"]
motions = ["walk"]
seeds = 1
"""


def shell(command: str, **variables: str) -> subprocess.CompletedProcess[str]:
    words = ["sh", "-c", command.replace("posefit", f"{sys.executable} -m posefit", 1)]
    return subprocess.run(
        words, capture_output=True, text=True, env={**os.environ, **variables}
    )


def test_unreadable_messages_do_not_stop_the_work(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN)
    sweep = f"sweep {tmp_path}/plan.toml --workers 1"
    for number, redirected in enumerate(("2>/dev/full", "<&- 2>&-")):
        out = tmp_path / str(number)
        for command, name, count in (
            (f"{TRACK} --out {out}", "frames", 2),
            (f"{sweep} --out {out}-rows", "done", 1),
        ):
            ran = shell(f"posefit {command} --json {redirected}")
            assert ran.returncode == 0
            assert json.loads(ran.stdout)[name] == count
        assert (out / "summary.json").is_file()
        assert shell(f"posefit track wlak {redirected}").returncode == 2


def test_processes_started_with_closed_streams_have_streams() -> None:
    child = "import sys; print(sys.stdin is None, sys.stderr is None)"
    parent = (
        "import subprocess, sys; from posefit.cli.output import open_streams;"
        f" open_streams(); subprocess.run([sys.executable, '-c', '{child}'])"
    )
    ran = subprocess.run(
        ["sh", "-c", f'{sys.executable} -c "{parent}" <&- 2>&-'],
        capture_output=True,
        text=True,
    )
    assert ran.stdout.split() == ["False", "False"]


@each("unbuffered", ["", "1"])
def test_results_that_cannot_be_written_are_reported_in_one_line(
    unbuffered: str,
) -> None:
    line = "posefit: standard output: expected room to write results to, got No space left on device\n"
    for words in ("plugins --json", "--version", "--help"):
        ran = shell(f"posefit {words} >/dev/full", PYTHONUNBUFFERED=unbuffered)
        assert (ran.returncode, ran.stderr) == (2, line)
    closed = shell(f"posefit {TRACK} --json >&-", PYTHONUNBUFFERED=unbuffered)
    assert closed.returncode == 0
    assert "Traceback" not in closed.stderr


def test_a_file_gets_messages_and_no_bars(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN)
    for command in (
        TRACK,
        f"sweep {tmp_path}/plan.toml --workers 1 --out {tmp_path}/out",
    ):
        ran = shell(f"posefit {command}")
        assert ran.returncode == 0
        assert [part for part in ("\r", "it/s", "%|") if part in ran.stderr] == []


def test_an_error_of_the_machine_is_reported_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    fits = "expected work that fits .* GB of memory, got"
    denied = PermissionError(13, "Permission denied", "a.npz")
    for error, line in (
        (MemoryError(), f"{fits} more"),
        (MemoryError("Unable to allocate 9 TiB"), f"{fits} Unable to allocate 9 TiB"),
        (denied, "a.npz: expected a file or folder that can be used, got Permission"),
    ):
        monkeypatch.setattr("posefit.tracking.front.track", Mock(side_effect=error))
        ran = run("track", "walk")
        assert (ran.exit_code, ran.stdout, len(ran.stderr.splitlines())) == (2, "", 1)
        assert re.match(f"posefit: {line}", ran.stderr)
