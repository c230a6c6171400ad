"""Tables for papers: LaTeX that any document takes, without a package."""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from posefit.files import new_file

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "[": "{[}",  # else a row's first cell could be read as an argument of the line break before it
    "]": "{]}",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}


def latex(text: str) -> str:
    """Return text that LaTeX sets as it stands, on one line."""
    return "".join(_SPECIAL.get(letter, letter) for letter in " ".join(text.split()))


def latex_table(header: Sequence[str], rows: Iterable[Sequence[str | float | None]], digits: int = 2) -> str:
    """Return a tabular: text to the left, numbers to the right with that many digits, None and nan as dashes.

    Raises ValueError where a row has more or fewer cells than the header.
    """
    found = [list(row) for row in rows]
    for row in found:
        if len(row) != len(header):
            raise ValueError(f"rows must have {len(header)} cells, as the header has, got {len(row)}")
    numbers = [bool(found) and not any(isinstance(row[k], str) for row in found) for k in range(len(header))]
    lines = [[latex(name) for name in header], *([_cell(cell, digits) for cell in row] for row in found)]
    body = [" & ".join(cells) + r" \\" for cells in lines]
    columns = "".join("r" if number else "l" for number in numbers)
    return "\n".join(
        [f"\\begin{{tabular}}{{{columns}}}", r"\hline", body[0], r"\hline", *body[1:], r"\hline", r"\end{tabular}", ""]
    )


def write_latex(header: Sequence[str], rows: Iterable[Sequence[str | float | None]], path: str | Path) -> None:
    """Write a LaTeX table as a new file. Raises ValueError where it exists or cannot be written."""
    text = latex_table(header, rows)
    with new_file(path) as building:
        building.write_text(text, encoding="utf-8")


def _cell(value: str | float | None, digits: int) -> str:
    if isinstance(value, str):
        return latex(value)
    if value is None or math.isnan(value):
        return "--"
    return str(value) if isinstance(value, int) else f"{value:.{digits}f}"
