"""What `posefit report` writes and prints, and one line for every mistake."""

import csv
import html.parser
import json
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.page.document import embedded, plain
from posefit.report.content import data_of
from posefit.report.page import MARK
from posefit.report.runs import runs_of
from posefit.sweep.ledger import Ledger
from tests.cli.test_command_line import fails, run
from tests.report.browser import ledger, result, sure
from tests.sweep.fake import cells

FIRST = cells(1)[0]
LOST = replace(FIRST, seed=9)


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Return a ledger of two methods on two instances with two seeds, and one failure."""
    found = [
        result(replace(FIRST, method=m, instance=i, seed=s, frames=4), error + 0.1 * i + 0.02 * s)
        for m, error in (("random@pca", 2.0), ("sapso@pca", 1.0))
        for i in range(2)
        for s in range(2)
    ]
    return ledger(tmp_path / "results", found, [(LOST, ["its process died", "its process died"])])


class Page(html.parser.HTMLParser):
    """Collects the data of a page, and everything in it that would be fetched."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[str] = []
        self.tags: list[str] = []
        self._scripts: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))
        self.data: dict[str, Any] = json.loads(self._scripts[0])

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("src", "href", "action")]

    def handle_data(self, data: str) -> None:
        if self.tags and self.tags[-1] == "script" and data.strip():
            self._scripts.append(data)


def test_the_report_is_one_file_that_links_to_nothing_but_itself(results: Path, tmp_path: Path) -> None:
    out = tmp_path / "report.html"
    done = run("report", results, "--out", out)
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines()[-1] == f"written to {out}: open it in any browser"
    assert done.stdout.startswith(
        "sapso@pca leads with an error of 1.06°, 1.00° ahead of random@pca, on 2 instances of walk with 2 seeds each; "
    )
    assert done.stdout.splitlines()[1] == "1 cell failed, left out of all figures: random@pca 1"
    assert [line.split()[:2] for line in done.stdout.splitlines()[4:-2]] == [
        ["sapso@pca", "1.06"],
        ["random@pca", "2.06"],
    ]
    page = Page(out)
    assert page.links
    assert all(link.startswith("#") for link in page.links)
    assert not {"link", "img", "iframe", "object"} & set(page.tags)
    assert page.data["header"]["done"] == 8
    assert page.data["failures"][0]["reasons"] == ["its process died"]
    assert len(page.data["animations"]["tracks"]) == 8
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.html", "results"]


def test_the_same_ledger_gives_the_same_text_and_bytes_and_replaces_an_earlier_report(
    results: Path, tmp_path: Path
) -> None:
    out = tmp_path / "report.html"
    done = run("report", results)
    assert done.exit_code == 0, done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results"]
    assert json.loads(run("report", results, "--json").stdout)["out"] is None
    assert run("report", results, "--out", out).stdout.splitlines()[:-1] == done.stdout.splitlines()
    first = out.read_bytes()
    out.write_text(MARK + "of another day")
    printed = json.loads(run("report", results, "--out", out, "--json").stdout)
    assert out.read_bytes() == first
    assert [row["name"] for row in printed["leaderboard"]] == ["sapso@pca", "random@pca"]
    assert printed["leaderboard"][0]["skill_mean_pose"] == pytest.approx(1.0 - 1.06 / 4.0)
    assert {row["baseline"] for row in printed["baselines"]} == {"mean_pose", "persistence", "nearest"}
    assert printed["header"]["failed"] == 1


def test_failures_and_the_instances_that_one_method_takes_from_all_are_named_above_the_leaderboard(
    tmp_path: Path,
) -> None:
    found = [
        result(replace(FIRST, method=m, instance=i, seed=s), 1.0 + i)
        for m in ("random@pca", "sapso@pca")
        for i in range(3)
        for s in range(2)
        if (m, i) != ("sapso@pca", 1)
    ]
    lost = [(replace(FIRST, method="sapso@pca", instance=1, seed=s), ["its process died of SIGSEGV"]) for s in range(2)]
    done = run("report", ledger(tmp_path / "results", found, lost), "--out", tmp_path / "report.html")
    assert done.stdout.splitlines()[1:7] == [
        "2 cells failed, left out of all figures: sapso@pca 2",
        "  2 x its process died of SIGSEGV",
        "2 finished runs are left out of the comparison, as some method has no run to pair them with",
        "left out of the comparison, for every method: 1 instance",
        "  walk, view 45°, instance 1: no run of sapso@pca",
        f"{'':32} error deg   95 % interval   skill  group",
    ]
    header = Page(tmp_path / "report.html").data["header"]
    assert header["failed_by"] == {"sapso@pca": 2}
    assert [(one["instance"], len(one["missing"])) for one in header["dropped"]] == [(1, 1)]


def test_a_ledger_whose_every_cell_failed_has_a_page_with_the_reasons(tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [], [(LOST, ["ValueError: it had to", "its process died of SIGSEGV"])])
    done = run("report", made, "--out", tmp_path / "report.html")
    assert done.exit_code == 0, done.stderr
    assert done.stdout.splitlines()[:3] == [
        "1 cell failed, left out of all figures: random@pca 1",
        "  1 x ValueError: it had to",
        "  1 x its process died of SIGSEGV",
    ]
    page = Page(tmp_path / "report.html")
    assert page.data["failures"][0]["reasons"] == ["ValueError: it had to", "its process died of SIGSEGV"]
    assert page.data["header"]["unfinished"] == ["random@pca"]


def test_figures_tables_rows_and_iohprofiler_on_demand(results: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    places = {name: tmp_path / name for name in ("figures", "iohprofiler", "rows.csv")}
    words = [
        word for name, place in places.items() for word in (f"--{name.split('.')[0]}".replace("rows", "csv"), place)
    ]
    done = run("report", results, "--out", tmp_path / "report.html", *words)
    assert done.exit_code == 0, done.stderr
    names = ("attainment", "convergence", "critical-difference", "joints", "profile")
    drawn = {f"{name}.{kind}" for name in names for kind in ("png", "pdf")}
    assert {path.name for path in places["figures"].iterdir()} == drawn | {"leaderboard.tex", "leaderboard.csv"}
    assert "sapso@pca & 1.06" in (places["figures"] / "leaderboard.tex").read_text()
    with places["rows.csv"].open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 8 + 1
    assert {row["status"] for row in rows} == {"done", "quarantined"}
    assert sorted(path.name for path in places["iohprofiler"].iterdir()) == ["random@pca", "sapso@pca"]
    dimensions = [path.name.rpartition("DIM")[2] for path in places["iohprofiler"].rglob("*.dat")]
    assert set(dimensions) == {"9.dat"}  # three of the root and six components


def test_methods_that_say_how_sure_they_are_have_figures_of_it(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    says = sure(0.8, 60.0, [[4, 0.9, 0.5]])
    made = [result(replace(FIRST, method=m, seed=s), 1.0 + s, **says) for m in "ab" for s in (0, 1)]
    made += [result(replace(FIRST, method="silent", seed=s), 3.0) for s in (0, 1)]
    words = ["--figures", tmp_path / "figures", "--csv", tmp_path / "rows.csv"]
    done = run("report", ledger(tmp_path / "results", made), "--out", tmp_path / "report.html", *words)
    assert done.exit_code == 0, done.stderr
    drawn = {path.name for path in (tmp_path / "figures").iterdir()}
    assert drawn >= {f"{name}.{kind}" for name in ("reliability", "coverage") for kind in ("png", "pdf")}
    head, *rows = (tmp_path / "figures" / "leaderboard.csv").read_text().splitlines()
    assert "said unknown,80 % interval holds,80 % interval (mm)" in head
    assert ",0.8,60.0," in rows[0]
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        first = next(csv.DictReader(file))
    assert (first["interval_mm.80"], first["coverage.80"]) == ("60.0", "0.8")
    assert "mode_reliability" not in first
    data = Page(tmp_path / "report.html").data
    assert [one is None for one in data["certainty"]["methods"]] == [False, False, True]
    assert data["rows"]["coverage_80"] == [0.8] * 4 + [None] * 2


def test_methods_without_uncertainty_have_no_such_columns(results: Path, tmp_path: Path) -> None:
    assert run("report", results, "--out", tmp_path / "report.html").exit_code == 0
    data = Page(tmp_path / "report.html").data
    assert data["certainty"] is None
    assert not [name for name in (*data["columns"], *data["rows"]) if re.match("coverage|interval|unknown", name)]


MISTAKES = [
    (["NONE", "--out", "OUT.html"], "expected a ledger, a folder that posefit sweep wrote, got none"),
    (["EMPTY", "--out", "OUT.html"], "expected a ledger with finished rows, got one with none"),
    (["NONE"], "expected a ledger, a folder that posefit sweep wrote, got none"),
    (["RESULTS", "--out", "OUT.html", "--port", "1"], "--port must be given with --serve, got it without"),
    (["RESULTS", "--serve", "--out", "OUT.html"], "--serve must be given without --out, which it does not write"),
    (["RESULTS", "--serve", "--json"], "--serve must be given without --json, which it does not write"),
    (["NONE", "--serve"], "expected a ledger, a folder that posefit sweep wrote, got none"),
    (["RESULTS", "--serve", "--port", "70000"], "--port must be 0 to 65535, got 70000"),
    (["RESULTS", "--out", "OUT.txt"], "--out must be a file that ends in .html, got "),
    (["RESULTS", "--out", "OTHER.html"], "expected a new name or an earlier report, got something else"),
    (["RESULTS", "--out", "DIR.html"], "expected a new name or an earlier report, got something else"),
    (["RESULTS", "--out", "none/OUT.html"], "expected a place to write to, got one in "),
    (["RESULTS", "--out", "OUT.html", "--csv", "OTHER.html"], "expected a new name to write to, got one that exists"),
    (["RESULTS", "--out", "OUT.html", "--figures", "RESULTS"], "expected a place of its own for each"),
    (["RESULTS", "--out", "OUT.html", "--iohprofiler", "none/OUT"], "expected a place to write to, got one in "),
]


def test_mistakes_are_one_line_and_write_nothing(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("posefit.report.live.LEDGER_TIMEOUT_SECONDS", 0.0)
    ledger(tmp_path / "EMPTY", [])
    (tmp_path / "OTHER.html").write_text("<p>mine</p>")
    (tmp_path / "DIR.html").mkdir()
    before = sorted(tmp_path.rglob("*"))
    for words, message in MISTAKES:
        places = [
            word if word.startswith("--") or word.isdigit() else tmp_path / word.replace("RESULTS", "results")
            for word in words
        ]
        assert message in fails("report", *places), words
        assert sorted(tmp_path.rglob("*")) == before, words
    assert (tmp_path / "OTHER.html").read_text() == "<p>mine</p>"


def test_only_figures_need_a_library_beyond_the_core(results: Path, tmp_path: Path) -> None:
    code = """
import sys
for name in ("matplotlib", "pandas", "distributed", "iohinspector", "playwright"):
    sys.modules[name] = None
from posefit.cli import main
main(sys.argv[1:])
"""
    words = [sys.executable, "-W", "error", "-c", code, "report", str(results), "--out"]
    done = subprocess.run([*words, str(tmp_path / "a.html")], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    words += [str(tmp_path / "b.html"), "--figures", str(tmp_path / "figures")]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "posefit[figures]" in done.stderr
    assert not (tmp_path / "b.html").exists()


def test_a_damaged_picture_is_left_out_and_said(results: Path) -> None:
    (joints,) = (results / "rows").glob("*.joints")
    data = bytearray(joints.read_bytes())
    data[10] ^= 255
    joints.write_bytes(bytes(data))
    said: list[str] = []
    book = Ledger(results)
    found = data_of(book, runs_of(book), said.append)
    assert len(found["animations"]["tracks"]) == 7
    assert len(said) == 1
    assert "must be whole, got damaged ones; this run has no animation" in said[0]


def test_embedded_data_cannot_leave_its_element_and_numbers_are_plain() -> None:
    for text in ("</script>", "<!--", "]]>", "&lt;", "\u2028\u2029", '"\\', "\U0001f600é"):
        json_text = embedded({text: [text, float("nan"), float("inf"), 1.23456789]})
        assert not set("<>&\u2028\u2029") & set(json_text)
        assert json.loads(json_text) == {text: [text, None, None, 1.2346]}
    assert plain({"a": np.arange(2), "b": np.array([0.5, np.nan]), "c": (np.int64(2**60), True, None)}) == {
        "a": [0, 1], "b": [0.5, None], "c": [2**60, True, None],
    }  # fmt: skip
