"""Rows as CSV, and tables as LaTeX that needs no package."""

import csv
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from posefit.errors import InputError
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


def write_csv(rows: Iterable[Mapping[str, Any]], path: str | Path) -> None:
    """Write rows as a new CSV file, in UTF-8; columns are all that any row has, in the order of their first row.

    Missing values are left empty. Raises ValueError where there is no row, and where the file exists or cannot be
    written.
    """
    table = list(rows)
    if not table:
        raise InputError("rows must be at least one, got none")
    with new_file(path) as building, building.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(name for row in table for name in row)), restval="")
        writer.writeheader()
        writer.writerows(table)


def latex(text: str) -> str:
    """Return text that LaTeX sets as it stands, on one line."""
    return "".join(_SPECIAL.get(letter, letter) for letter in " ".join(text.split()))


def latex_table(header: Sequence[str], rows: Sequence[Sequence[str | float | None]]) -> str:
    """Return a tabular: text to the left, numbers to the right with two digits, None and nan as dashes."""
    columns = "".join(
        "l" if any(isinstance(cell, str) for cell in column) else "r" for column in zip(*rows, strict=True)
    )
    lines = [" & ".join(map(_cell, row)) + r" \\" for row in (header, *rows)]
    rule = r"\hline"
    table = [f"\\begin{{tabular}}{{{columns}}}", rule, lines[0], rule, *lines[1:], rule, r"\end{tabular}", ""]
    return "\n".join(table)


def _cell(value: str | float | None) -> str:
    if isinstance(value, str):
        return latex(value)
    if value is None or math.isnan(value):
        return "--"
    return str(value) if isinstance(value, int) else f"{value:.2f}"
