"""Rows as CSV, and tables for LaTeX."""

import csv
import re
from pathlib import Path

import pytest

from posefit.report.export import latex, latex_table, write_csv


def test_csv_is_read_back_with_what_would_break_it(tmp_path):
    rows = [{"method": 'a,"b"\nc', "error": 0.1 + 0.2}, {"method": "Ä", "lost": None, "error": 1}]
    write_csv(rows, tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert read == [
        {"method": 'a,"b"\nc', "error": "0.30000000000000004", "lost": ""},
        {"method": "Ä", "error": "1", "lost": ""},
    ]


def test_csv_without_rows_or_over_a_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match="rows must be at least one, got none"):
        write_csv([], tmp_path / "rows.csv")
    assert list(tmp_path.iterdir()) == []
    Path(tmp_path / "rows.csv").write_text("mine")
    with pytest.raises(ValueError, match="rows.csv: expected a new name to write to, got one that exists"):
        write_csv([{"a": 1}], tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text() == "mine"


def test_a_table_by_hand():
    text = latex_table(["method", "error", "runs"], [["sapso@pca", 1.056, 10], ["a_b & c", None, 3]])
    assert text.splitlines() == [
        r"\begin{tabular}{lrr}",
        r"\hline",
        r"method & error & runs \\",
        r"\hline",
        r"sapso@pca & 1.06 & 10 \\",
        r"a\_b \& c & -- & 3 \\",
        r"\hline",
        r"\end{tabular}",
    ]
    assert r"-- \\" in latex_table(["low"], [[float("nan")]])


def test_every_sign_that_latex_would_read_is_escaped():
    text = latex("\\input{x} $a^2$ #1 50% ~ <|> [2]\n\nend")
    assert text == (
        r"\textbackslash{}input\{x\} \$a\textasciicircum{}2\$ \#1 50\% \textasciitilde{} "
        r"\textless{}\textbar{}\textgreater{} {[}2{]} end"
    )
    # what is left of commands once the escapes themselves are gone
    assert not re.search(r"[\\$^~#%&_]", re.sub(r"\\(text\w+\{\}|[&%$#_{}])", "", text))
