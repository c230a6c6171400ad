"""The leaderboard as a table: as the command prints it, as CSV, and as LaTeX."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from posefit.evaluation.measures import BASELINES
from posefit.report.columns import Score
from posefit.report.kind import Row, Runs
from posefit.report.leaderboard import EFFECT
from posefit.report.tracks import LOSS_BASELINE

LATEX_MARK = "% The leaderboard of a report of posefit; needs \\usepackage{booktabs}.\n"
_LATEX = {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "°": r"\textdegree{}",
    "−": "$-$",
    "<": "$<$",
    ">": "$>$",
    **{sign: f"\\{sign}" for sign in "&%$#_{}"},
}


def board_cells(score: Score, row: Row) -> dict[str, str]:
    """Return what the command prints of a method, by the titles of the columns."""

    def number(value: float | None, digits: int) -> str:
        return "-" if value is None else f"{value:z.{digits}f}"

    ends = "-"
    if row["low"] is not None:
        ends = (
            f"{number(row['low'], score.digits)} to {number(row['high'], score.digits)}"
        )
    p = number(row["p"], 3)
    if row["p"] is not None and row["p"] < 0.001:
        p = "< 0.001"
    cells = {
        score.title: number(row[score.name], score.digits),
        "95 % interval": ends,
        "behind": number(row["behind"], score.digits),
        "p": p,
    }
    if "lost_tracks" not in row:
        return {**cells, "above": number(row["above"], 2)}
    lost = row["lost_rate"]
    return {
        **cells,
        "lost in": f"{row['lost_tracks']}/{row['runs']}",
        "lost %": "-" if lost is None else number(100.0 * lost, 1),
        "skill": number(row[f"skill.{LOSS_BASELINE}"], 2),
    }


def board_lines(
    score: Score, board: Sequence[Row], baselines: Sequence[Row]
) -> list[str]:
    """Return the leaderboard as lines, and below it the baseline that skills compare with."""
    cells = [board_cells(score, row) for row in board]
    names = [row["name"] for row in board]
    for baseline in baselines:
        is_shown = baseline["baseline"] == LOSS_BASELINE
        if is_shown and baseline[score.name] is not None:
            names.append(BASELINES[LOSS_BASELINE])
            cells.append({score.title: f"{baseline[score.name]:.{score.digits}f}"})
    widths = {
        title: max(len(title), *(len(row.get(title, "")) for row in cells))
        for title in cells[0]
    }
    first = max(map(len, names))
    lines = ["  ".join([" " * first, *(f"{t:>{w}}" for t, w in widths.items())])]
    for name, row in zip(names, cells, strict=True):
        texts = [f"{row.get(title, ''):>{width}}" for title, width in widths.items()]
        lines.append("  ".join([f"{name:{first}}", *texts]).rstrip())
    return lines


def board_rows(runs: Runs, board: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the leaderboard as rows of a CSV: every figure under its name, and what the page has of a method."""
    score, *others = runs.table_figures
    names = ["name", "settings", score, "low", "high", *EFFECT]
    if "lost_tracks" in board[0]:
        names.append("lost_tracks")
    names += ["runs", "failed", "warned", *others]
    return [
        {"method" if name == "name" else name: row[name] for name in names}
        for row in board
    ]


def latex_table(score: Score, board: Sequence[Row]) -> str:
    """Return the leaderboard as a LaTeX table."""
    cells = [board_cells(score, row) for row in board]
    columns = "l" + "r" * len(cells[0])
    lines = [f"\\begin{{tabular}}{{{columns}}}", "\\toprule"]
    lines.append(_latex_row(["method", *cells[0]]))
    lines.append("\\midrule")
    for row, texts in zip(board, cells, strict=True):
        lines.append(_latex_row([row["name"], *texts.values()]))
    lines += ["\\bottomrule", "\\end{tabular}"]
    return LATEX_MARK + "\n".join(lines) + "\n"


def _latex_row(texts: Sequence[str]) -> str:
    escapes: Mapping[int, str] = str.maketrans(_LATEX)
    cells = []
    for text in texts:
        if text == "-":
            cells.append("--")
        else:
            # a number's sign is no hyphen
            cells.append(re.sub(r"^-(?=\d)", "−", text).translate(escapes))
    return " & ".join(cells) + r" \\"
