"""The page's scripts, style and markup as text: lines that can be read, and a linter's word on the script as a whole."""

import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

from posefit.report.page.webpage import SCRIPTS, script

LONGEST = 120
PAGE = files("posefit.report") / "page"
ROOT = Path(__file__).parents[2]
PARTS = [one for one in PAGE.iterdir() if one.name.endswith((".js", ".css", ".html"))]


def test_lines_are_of_at_most_120_characters():
    lines = [(one.name, k, line) for one in PARTS for k, line in enumerate(one.read_text("utf-8").split("\n"), 1)]
    assert len({name for name, _, _ in lines}) >= 10
    assert [(name, k, len(line)) for name, k, line in lines if len(line) > LONGEST] == []


def test_every_script_is_part_of_the_page():
    assert sorted(f"{name}.js" for name in SCRIPTS) == sorted(one.name for one in PARTS if one.name.endswith(".js"))


def linted(path):
    """Return the exit status and what the linter says of a script that runs as a whole."""
    program = shutil.which("oxlint") or pytest.skip("the linter oxlint is not installed: pip install posefit[dev]")
    rules = ["no-undef", "no-unused-vars", "no-redeclare"]  # in single files what others declare would be unknown
    command = [program, "--config", ROOT / ".oxlintrc.json", "--deny-warnings", *(f"--deny={rule}" for rule in rules)]
    done = subprocess.run([*command, path], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


def test_the_linter_finds_nothing_in_the_whole_script(tmp_path):
    (tmp_path / "report.js").write_text(script(), encoding="utf-8")
    status, said = linted(tmp_path / "report.js")
    assert status == 0, said
    assert "on 1 file" in said


@pytest.mark.parametrize(
    ("mistake", "rule"),
    [
        ("none_of_ours(1);", "no-undef"),
        ("const of_no_use = 1;", "no-unused-vars"),
        ("if (D == null) header();", "eqeqeq"),
    ],
)
def test_the_linter_finds_a_mistake_that_was_planted(tmp_path, mistake, rule):
    planted = re.sub(r"\n\}\)\(\);\n$", f"\n{mistake}\n}})();\n", script())
    assert planted != script()
    (tmp_path / "report.js").write_text(planted, encoding="utf-8")
    status, said = linted(tmp_path / "report.js")
    assert status != 0
    assert rule in said
