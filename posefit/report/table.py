"""The leaderboard as a table: printed by the command, as CSV, and as LaTeX."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from posefit.evaluation.measures import BASELINES
from posefit.report.columns import Score
from posefit.report.contest import Row, Runs
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
    """Return the printed texts of a method's row, by the titles of the columns."""

    def number(value: float | None, digits: int) -> str:
        return "-" if value is None else f"{value:z.{digits}f}"

    ends = "-"
    if row["low"] is not None:
        low = number(row["low"], score.digits)
        high = number(row["high"], score.digits)
        ends = f"{low} to {high}"
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
    """Return the lines of the printed leaderboard.

    The last line is the baseline with which skills compare.
    """
    cells = [board_cells(score, row) for row in board]
    names = [row["name"] for row in board]
    for baseline in baselines:
        is_shown = baseline["baseline"] == LOSS_BASELINE
        if is_shown and baseline[score.name] is not None:
            names.append(BASELINES[LOSS_BASELINE])
            cells.append({score.title: f"{baseline[score.name]:.{score.digits}f}"})
    widths = {}
    for title in cells[0]:
        lengths = [len(row.get(title, "")) for row in cells]
        widths[title] = max(len(title), *lengths)
    name_width = max(map(len, names))
    titles = [f"{title:>{width}}" for title, width in widths.items()]
    lines = ["  ".join([" " * name_width, *titles])]
    for name, row in zip(names, cells, strict=True):
        texts = [f"{row.get(title, ''):>{width}}" for title, width in widths.items()]
        lines.append("  ".join([f"{name:{name_width}}", *texts]).rstrip())
    return lines


def board_rows(runs: Runs, board: Sequence[Row]) -> list[dict[str, Any]]:
    """Return the rows of the leaderboard's CSV file.

    They have every figure under its name, and all else that the page has of a method.
    """
    score, *others = runs.table_figures
    names = ["name", "settings", score, "low", "high", *EFFECT]
    if "lost_tracks" in board[0]:
        names.append("lost_tracks")
    names += ["runs", "failed", "warned", *others]
    rows = []
    for row in board:
        figures = {name: row[name] for name in names[1:]}
        rows.append({"method": row["name"], **figures})
    return rows


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
            # the sign of a number is a minus, not a hyphen
            cells.append(re.sub(r"^-(?=\d)", "−", text).translate(escapes))
    return " & ".join(cells) + r" \\"
