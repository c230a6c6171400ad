"""The pages' scripts, style and markup as text: lines that can be read, and a linter's word on each script as a whole."""

import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

from posefit.page.document import SHARED
from posefit.report.page.webpage import COMMON, script
from posefit.report.page.webpage import SCRIPTS as OF_REPORT
from posefit.report.search.page.webpage import SCRIPTS as OF_SEARCHES
from posefit.report.search.page.webpage import search_script
from posefit.tracking.page.webpage import SCRIPTS as OF_VIEWER
from posefit.tracking.page.webpage import viewer_script

LONGEST = 120
ROOT = Path(__file__).parents[2]
WHOLE = {"report": script, "searches": search_script, "viewer": viewer_script}
NAMES = {
    "posefit.page": SHARED,
    "posefit.report.page": (*COMMON, *OF_REPORT),
    "posefit.report.search.page": OF_SEARCHES,
    "posefit.tracking.page": OF_VIEWER,
}
OF_ALL = {"report": SHARED, "searches": SHARED[:1], "viewer": SHARED}  # what of the shared scripts a page has
PARTS = {name: [one for one in files(name).iterdir() if one.name.endswith((".js", ".css", ".html"))] for name in NAMES}


@pytest.mark.parametrize("package", NAMES)
def test_lines_are_of_at_most_120_characters(package):
    parts = PARTS[package]
    lines = [(one.name, k, line) for one in parts for k, line in enumerate(one.read_text("utf-8").split("\n"), 1)]
    assert len({name for name, _, _ in lines}) >= 4
    assert [(name, k, len(line)) for name, k, line in lines if len(line) > LONGEST] == []


@pytest.mark.parametrize("package", NAMES)
def test_every_script_is_part_of_its_page(package):
    names = [one.name for one in PARTS[package] if one.name.endswith(".js")]
    assert sorted(f"{name}.js" for name in NAMES[package]) == sorted(names)


@pytest.mark.parametrize("page", WHOLE)
def test_what_pages_share_stands_in_each_of_them_once(page):
    for name in OF_ALL[page]:
        (part,) = (one for one in PARTS["posefit.page"] if one.name == f"{name}.js")
        assert WHOLE[page]().count(part.read_text("utf-8")) == 1


def linted(path):
    """Return the exit status and what the linter says of a script that runs as a whole."""
    program = shutil.which("oxlint") or pytest.skip("the linter oxlint is not installed: pip install posefit[dev]")
    rules = ["no-undef", "no-unused-vars", "no-redeclare"]  # in single files what others declare would be unknown
    command = [program, "--config", ROOT / ".oxlintrc.json", "--deny-warnings", *(f"--deny={rule}" for rule in rules)]
    done = subprocess.run([*command, path], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


@pytest.mark.parametrize("page", WHOLE)
def test_the_linter_finds_nothing_in_the_whole_script(tmp_path, page):
    (tmp_path / "page.js").write_text(WHOLE[page](), encoding="utf-8")
    status, said = linted(tmp_path / "page.js")
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
@pytest.mark.parametrize("page", WHOLE)
def test_the_linter_finds_a_mistake_that_was_planted(tmp_path, page, mistake, rule):
    planted = re.sub(r"\n\}\)\(\);\n$", f"\n{mistake}\n}})();\n", WHOLE[page]())
    assert planted != WHOLE[page]()
    (tmp_path / "page.js").write_text(planted, encoding="utf-8")
    status, said = linted(tmp_path / "page.js")
    assert status != 0
    assert rule in said
