"""What `posefit report` writes and prints, and one line for every mistake."""

import csv
import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.page.document import embedded, plain
from posefit.report.content import data_of
from posefit.report.leaderboard import standings_of
from posefit.report.page import MARK
from posefit.report.reading import runs_of
from posefit.sweep.ledger import Ledger
from posefit.sweep.table import write_csv
from tests.commands import error_of, run
from tests.files import csv_rows
from tests.report.browser import data_in, ledger, result, sure, written
from tests.report.contests import FIRST, full, results_of

LOST = [
    (
        replace(FIRST, seed=9),
        ["its process died", "ValueError: it had to", "its process died"],
    )
]


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Return a ledger of two methods on two instances with two seeds, and one failure."""
    made = [
        result(
            replace(FIRST, method=method, instance=i, seed=s, frames=4),
            error + 0.01 * s,
        )
        for (method, i, s), error in full({"random@pca": 2.0, "sapso@pca": 1.0}).items()
    ]
    return ledger(tmp_path / "results", made, LOST)


def header_of(made: Path) -> dict[str, Any]:
    """Return the header of the page about a ledger."""
    with Ledger(made) as opened:
        runs = runs_of(opened)
        header: dict[str, Any] = data_of(opened, runs, standings_of(runs))["header"]
    return header


def test_the_header_counts_runs_methods_and_failures(
    results: Path, tmp_path: Path
) -> None:
    one = ledger(tmp_path / "one", [result(FIRST, 1.0)])
    assert header_of(one)["summary"] == "1 track by 1 method; no cell failed."
    assert header_of(results)["summary"] == "8 tracks by 2 methods; 1 cell failed."


@pytest.mark.parametrize("sign", ["=", "+", "-", "@", "\t", "\r"])
def test_no_name_is_a_formula_of_a_spreadsheet(sign: str, tmp_path: Path) -> None:
    write_csv(
        [{"name": f"{sign}1+1", "value": -1.5, "kind": "a=b"}], tmp_path / "rows.csv"
    )
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert row == {"name": f"'{sign}1+1", "value": "-1.5", "kind": "a=b"}


def test_the_report_is_one_file_that_links_to_nothing_but_itself(
    results: Path, tmp_path: Path
) -> None:
    lines, page = written(results)
    assert lines[-1] == f"written to {tmp_path / 'report.html'}: open it in any browser"
    assert lines[0].startswith(
        "No method leads; sapso@pca, which comes first, lost frames in none of 4 tracks"
    )
    first = lines.index("1 cell failed, left out of all figures: random@pca 1")
    assert [line.split()[:6] for line in lines[first + 4 : -1]] == [
        ["sapso@pca", "1.06", "-", "-", "-", "0/4"],
        ["random@pca", "2.06", "-", "1.00", "0.125", "0/4"],
        ["mean", "training", "pose", "4.00"],
    ]
    links = re.findall(r'\s(?:src|href|action)="([^"]*)"', page)
    assert links
    assert all(link.startswith("#") for link in links)
    assert not re.search(r"<(link|img|iframe|object)\b", page)
    data = data_in(page)
    assert data["header"]["done"] == 8
    assert data["failures"][0]["reasons"] == [
        "its process died",
        "ValueError: it had to",
    ]
    assert data["certainty"] is None
    assert not [
        name
        for name in (*data["columns"], *data["rows"])
        if re.match("coverage|interval_mm|unknown", name)
    ]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "report.html",
        "results",
    ]


def test_a_ledger_gives_the_same_text_and_bytes_and_replaces_an_earlier_report(
    results: Path, tmp_path: Path
) -> None:
    out = tmp_path / "report.html"
    done = run("report", results)
    assert done.exit_code == 0, done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results"]
    assert json.loads(run("report", results, "--json").stdout)["out"] is None
    lines, _ = written(results)
    assert lines[:-1] == done.stdout.splitlines()
    first = out.read_bytes()
    out.write_text(MARK + "of another day")
    printed = json.loads(run("report", results, "--out", out, "--json").stdout)
    assert out.read_bytes() == first
    assert [row["name"] for row in printed["leaderboard"]] == [
        "sapso@pca",
        "random@pca",
    ]
    assert printed["leaderboard"][0]["skill.mean_pose"] == pytest.approx(
        1.0 - 1.06 / 4.0
    )
    assert {row["baseline"] for row in printed["baselines"]} == {
        "mean_pose",
        "persistence",
        "nearest",
    }
    assert printed["header"]["failed"] == 1


def test_failures_and_instances_left_out_are_named_above_the_leaderboard(
    tmp_path: Path,
) -> None:
    errors = full({"random@pca": 1.0, "sapso@pca": 1.0}, instances=3)
    made = results_of(
        {key: error for key, error in errors.items() if key[:2] != ("sapso@pca", 1)}
    )
    lost = [
        (
            replace(FIRST, method="sapso@pca", instance=1, seed=s),
            ["its process died of SIGSEGV"],
        )
        for s in range(2)
    ]
    lines, _ = written(ledger(tmp_path / "results", made, lost))
    first = lines.index("2 cells failed, left out of all figures: sapso@pca 2")
    assert lines[first : first + 5] == [
        "2 cells failed, left out of all figures: sapso@pca 2",
        "  2 x its process died of SIGSEGV",
        "2 finished runs are left out of the comparison, as some method has no run to pair them with",
        "left out of the comparison, for every method: 1 instance",
        "  walk, view 45°, instance 1: no run of sapso@pca",
    ]
    assert (
        " ".join(lines[first + 5].split())
        == "error with losses ° 95 % interval behind ° p lost in lost % skill"
    )


def test_a_ledger_whose_every_cell_failed_has_a_page_with_the_reasons(
    tmp_path: Path,
) -> None:
    lines, page = written(ledger(tmp_path / "results", [], LOST))
    assert lines[:3] == [
        "1 cell failed, left out of all figures: random@pca 1",
        "  1 x its process died",
        "  1 x ValueError: it had to",
    ]
    assert data_in(page)["failures"][0]["reasons"] == [
        "its process died",
        "ValueError: it had to",
    ]


def test_a_failure_beside_a_run_without_an_error_is_not_every_cell(
    tmp_path: Path,
) -> None:
    row = result(FIRST, 1.0, error_degrees=None, baselines_degrees=None)
    made = ledger(tmp_path / "results", [row], LOST)
    with Ledger(made) as opened:
        runs = runs_of(opened)
        answer = data_of(opened, runs, standings_of(runs))["answer"]
    assert answer == ["No run has an error: nothing can be compared."]


def test_no_output_has_the_path_of_any_ledger(results: Path, tmp_path: Path) -> None:
    other = ledger(tmp_path / "other", [result(replace(FIRST, seed=20), 1.0)])
    message = error_of("report", results, other, "--coco", other)
    assert f"an output and the ledger, have the same path: {other}" in message


def test_figures_tables_and_rows_on_demand(results: Path, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    figures = tmp_path / "figures"
    rows = tmp_path / "rows.csv"
    written(results, "--figures", figures, "--csv", rows)
    drawn = {
        f"{name}.{kind}"
        for name in ("leaderboard", "convergence", "profile")
        for kind in ("png", "pdf")
    }
    assert {path.name for path in figures.iterdir()} == drawn | {"leaderboard.csv"}
    assert sorted(row["status"] for row in csv_rows(rows)) == ["done"] * 8 + [
        "quarantined"
    ]


def test_the_csv_has_the_rows_of_the_methods_that_are_compared(
    tmp_path: Path,
) -> None:
    made = [result(replace(FIRST, method=m, seed=s), 1.0) for m in "ab" for s in (0, 1)]
    failed = [(replace(FIRST, method=m, seed=2), ["it had to"]) for m in "ac"]
    rows = tmp_path / "rows.csv"
    path = ledger(tmp_path / "results", made, failed)
    for names, methods in (("b", "bb"), ("a,c", "aaac")):
        written(path, "--csv", rows, "--methods", names)
        assert sorted(row["method"] for row in csv_rows(rows)) == list(methods)


def test_methods_with_an_uncertainty_have_figures_of_it(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    uncertainty = sure(0.8, 60.0, [[4, 0.9, 0.5]])
    made = [
        result(replace(FIRST, method=m, seed=s), 1.0 + s, **uncertainty)
        for m in "ab"
        for s in (0, 1)
    ]
    made += [result(replace(FIRST, method="without", seed=s), 3.0) for s in (0, 1)]
    figures = tmp_path / "figures"
    rows = tmp_path / "rows.csv"
    _, page = written(
        ledger(tmp_path / "results", made), "--figures", figures, "--csv", rows
    )
    head, first, *_ = (figures / "leaderboard.csv").read_text().splitlines()
    assert "unknown_rate,coverage.80,interval_mm.80" in head
    assert ",0.8,60.0," in first
    row = csv_rows(rows)[0]
    assert (row["interval_mm.80"], row["coverage.80"]) == ("60.0", "0.8")
    assert "mode_reliability" not in row
    data = data_in(page)
    assert [method is None for method in data["certainty"]["methods"]] == [
        False,
        False,
        True,
    ]
    assert data["rows"]["coverage.80"] == [0.8] * 4 + [None] * 2


MISTAKES = [
    (
        "NONE",
        "expected a ledger, a folder or .sqlite file that posefit sweep wrote, got none",
    ),
    ("EMPTY --out OUT.html", "expected a ledger with finished rows, got none"),
    (
        "OTHER.html",
        "OTHER.html: expected an intact SQLite file, got file is not a database",
    ),
    ("results --out OUT.txt", "--out must be a file that ends in .html, got "),
    (
        "results --out OTHER.html",
        "expected a new name or an earlier file of this kind, got something else",
    ),
    (
        "results --out DIR.html",
        "expected a new name or an earlier file of this kind, got something else",
    ),
    ("results --out none/OUT.html", "none is not a folder"),
    (
        "results --out OUT.html --csv OTHER.html",
        "expected a new name or an earlier file of this kind, got something else",
    ),
    (
        "results --latex OTHER.html",
        "expected a new name or an earlier file of this kind, got something else",
    ),
    ("results --figures results", "have the same path"),
    ("results --csv OUT --latex OUT", "two outputs, or an output and the ledger, have"),
    (
        "results --out OUT.html --figures DIR.html",
        "expected a new name or an earlier folder of figures, got something else",
    ),
    (
        "results --out OUT.html --figures none/OUT",
        "none is not a folder",
    ),
    ("results --methods sapso", "got 'sapso'; did you mean 'sapso@pca'?"),
]


def test_mistakes_are_reported_in_one_line_and_write_nothing(
    results: Path, tmp_path: Path
) -> None:
    ledger(tmp_path / "EMPTY", [])
    (tmp_path / "OTHER.html").write_text("<p>mine</p>")
    (tmp_path / "DIR.html").mkdir()
    before = sorted(tmp_path.rglob("*"))
    for words, message in MISTAKES:
        arguments = [
            word if re.match(r"--|\d|sapso", word) else tmp_path / word
            for word in words.split()
        ]
        assert message in error_of("report", *arguments), words
        after = [
            path
            for path in sorted(tmp_path.rglob("*"))
            if not path.name.endswith(("-wal", "-shm"))
        ]
        # SQLite has these beside a ledger as long as somebody reads it
        assert after == before, words
    assert (tmp_path / "OTHER.html").read_text() == "<p>mine</p>"


def test_every_option_replaces_the_files_of_an_earlier_report(
    results: Path, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    places = {
        "--csv": tmp_path / "rows.csv",
        "--figures": tmp_path / "figures",
        "--latex": tmp_path / "table.tex",
    }
    words = [word for pair in places.items() for word in pair]
    written(results, *words)
    tables = [tmp_path / "figures/leaderboard.csv", tmp_path / "table.tex"]
    before = [path.read_bytes() for path in tables]
    places["--csv"].write_text("key,version,status,of another day")
    written(results, *words, "--methods", "sapso@pca")
    assert len(csv_rows(places["--csv"])) == 4
    for path, earlier in zip(tables, before, strict=True):
        assert b"random@pca" in earlier
        assert b"random@pca" not in path.read_bytes()
    (tmp_path / "figures" / "mine.txt").write_text("")
    line = error_of("report", results, "--figures", places["--figures"])
    assert "expected a new name or an earlier folder of figures, got something" in line
    assert (tmp_path / "figures" / "mine.txt").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "figures", "report.html", "results", "rows.csv", "table.tex",
    ]  # fmt: skip


def test_the_leaderboards_csv_has_all_that_the_page_has_of_a_method(
    results: Path, tmp_path: Path
) -> None:
    pytest.importorskip("matplotlib")
    _, page = written(results, "--figures", tmp_path / "figures")
    rows = csv_rows(tmp_path / "figures" / "leaderboard.csv")
    data = data_in(page)
    assert len(rows) == len(data["leaderboard"])
    for made, shown in zip(rows, data["leaderboard"], strict=True):
        assert made["method"] == shown["name"]
        assert set(data["columns"]) < set(made)
        for name, value in shown.items():
            if name in ("name", "method", "settings", "taking_part"):
                continue
            if value is None:
                assert made.get(name, "") in ("", "nan", "inf"), name
            elif name in made:
                assert float(made[name]) == pytest.approx(value, rel=1e-4), name
    assert {"lost_tracks", "behind", "behind_low", "p", "blocks_needed"} < set(rows[0])


def test_a_latex_table_has_the_leaderboard_with_its_signs_escaped(
    tmp_path: Path,
) -> None:
    cells = [
        replace(FIRST, method=m, name="a_b & 5 % {x}" if m == "b" else "", seed=s)
        for m in "ab"
        for s in range(12)
    ]
    made = [result(cell, 1.0 + 6.0 * (cell.method == "b")) for cell in cells]
    place = tmp_path / "table.tex"
    written(ledger(tmp_path / "results", made), "--latex", place)
    lines = place.read_text().splitlines()
    assert lines[1] == r"\begin{tabular}{lrrrrrrr}"
    assert lines[5] == r"a & 1.00 & 1.00 to 1.00 & -- & -- & 0/12 & 0.0 & 0.75 \\"
    assert lines[6] == (
        r"a\_b \& 5 \% \{x\} & 7.00 & 7.00 to 7.00 & 6.00 & $<$ 0.001 & 0/12 & 0.0 & $-$0.75 \\"
    )


def test_without_matplotlib_figures_are_reported_in_one_line_and_nothing_is_written(
    results: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    line = error_of(
        "report",
        results,
        "--out",
        tmp_path / "b.html",
        "--figures",
        tmp_path / "figures",
    )
    assert "figures need the library matplotlib: pip install posefit[figures]" in line
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_embedded_data_cannot_leave_its_element_and_numbers_are_plain() -> None:
    for text in (
        "</script>",
        "<!--",
        "]]>",
        "&lt;",
        "\u2028\u2029",
        '"\\',
        "\U0001f600é",
    ):
        json_text = embedded({text: [text, float("nan"), float("inf"), 1.23456789]})
        assert not set("<>&\u2028\u2029") & set(json_text)
        assert json.loads(json_text) == {text: [text, None, None, 1.2346]}
    # of which five digits are beyond what a float holds
    extreme = [1e-320, -1.7976931348623157e308, 0.5]
    assert json.loads(embedded([np.array(extreme), *extreme])) == [extreme, *extreme]
    assert plain({"a": np.arange(2), "b": np.array([0.5, np.nan]), "c": (np.int64(2**60), True, None)}) == {
        "a": [0, 1], "b": [0.5, None], "c": [2**60, True, None],
    }  # fmt: skip


def test_long_arrays_are_embedded_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("posefit.page.document.PIECE", 3)
    for count in range(8):
        whole = {"a": np.arange(count), "b": {"c": np.arange(count) / 2.0}, "d": {}}
        assert json.loads(embedded(whole)) == plain(whole)


def test_csv_without_rows_is_refused(tmp_path: Path) -> None:
    with pytest.raises(
        ValueError, match="rows must contain at least one row, got none"
    ):
        write_csv([], tmp_path / "rows.csv")
    assert list(tmp_path.iterdir()) == []
