"""Tables that LaTeX takes as they are."""

import re

import pytest

from posefit.report.export import latex, latex_table


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


def test_an_interval_that_is_not_known_is_a_dash():
    assert r"-- \\" in latex_table(["low"], [[float("nan")]])


def test_every_sign_that_latex_would_read_is_escaped():
    found = latex("\\input{x} $a^2$ #1 50% ~ <|> [2]\n\nend")
    assert found == (
        r"\textbackslash{}input\{x\} \$a\textasciicircum{}2\$ \#1 50\% \textasciitilde{} "
        r"\textless{}\textbar{}\textgreater{} {[}2{]} end"
    )
    # what is left of commands once the escapes themselves are gone
    assert not re.search(r"[\\$^~#%&_]", re.sub(r"\\(text\w+\{\}|[&%$#_{}])", "", found))


def test_a_row_of_another_length_is_refused():
    with pytest.raises(ValueError, match="rows must have 2 cells, as the header has, got 1"):
        latex_table(["a", "b"], [["x"]])
