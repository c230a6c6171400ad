"""Standard streams that are closed, full or files: the work goes on, and what cannot be said is one line."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

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
    return subprocess.run(words, capture_output=True, text=True, env={**os.environ, **variables})


def test_messages_that_nobody_can_read_end_no_work(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN)
    for number, redirected in enumerate(("2>/dev/full", "<&- 2>&-")):
        out = tmp_path / str(number)
        ran = shell(f"posefit {TRACK} --json --out {out} {redirected}")
        assert ran.returncode == 0
        assert json.loads(ran.stdout)["frames"] == 2
        assert (out / "summary.json").is_file()
        assert shell(f"posefit track wlak {redirected}").returncode == 2
        ran = shell(f"posefit sweep {tmp_path}/plan.toml --workers 1 --json --out {out}-rows {redirected}")
        assert ran.returncode == 0
        assert json.loads(ran.stdout)["done"] == 1


@each("unbuffered", ["", "1"])
def test_results_that_cannot_be_written_are_one_line(unbuffered: str) -> None:
    line = "posefit: standard output: expected room to write results to, got No space left on device\n"
    for words in ("plugins --json", "--version", "--help"):
        ran = shell(f"posefit {words} >/dev/full", PYTHONUNBUFFERED=unbuffered)
        assert (ran.returncode, ran.stderr) == (2, line)
    closed = shell(f"posefit {TRACK} --json >&-", PYTHONUNBUFFERED=unbuffered)
    assert closed.returncode == 0
    assert "Traceback" not in closed.stderr


def test_a_file_gets_messages_and_no_bars(tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(PLAN)
    shown = [shell(f"posefit {TRACK}"), shell(f"posefit sweep {tmp_path}/plan.toml --workers 1 --out {tmp_path}/out")]
    for ran in shown:
        assert ran.returncode == 0
        assert "\r" not in ran.stderr
        assert "it/s" not in ran.stderr
        assert "%|" not in ran.stderr


def test_what_a_machine_refuses_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    for error, line in (
        (MemoryError(), r"expected work that fits .* GB of memory, got more"),
        (
            MemoryError("Unable to allocate 9 TiB"),
            r"expected work that fits .* GB of memory, got Unable to allocate 9 TiB",
        ),
        (
            PermissionError(13, "Permission denied", "a.npz"),
            "a.npz: expected a file or folder that can be used, got Permission",
        ),
    ):

        def refused(*_: object, error: BaseException = error, **__: object) -> None:
            raise error

        monkeypatch.setattr("posefit.tracking.front.track", refused)
        ran = run("track", "walk")
        assert (ran.exit_code, ran.stdout, len(ran.stderr.splitlines())) == (2, "", 1)
        assert re.match(f"posefit: {line}", ran.stderr)
