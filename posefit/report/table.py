"""The leaderboard as a table: printed by the command, as CSV, and as LaTeX."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from posefit.report.columns import MIN_P, Score
from posefit.report.leaderboard import EFFECT, Standing, Standings
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


def board_cells(score: Score, row: Standing) -> dict[str, str]:
    """Return the printed texts of a method's row, by the titles of the columns."""

    def number(value: float | None, digits: int = score.digits) -> str:
        return "-" if value is None else f"{value:z.{digits}f}"

    ends = "-"
    if row.interval:
        ends = " to ".join(map(number, row.interval))
    behind = "-"
    p = "-"
    if row.test:
        behind = number(row.test.difference)
        p = number(row.test.adjusted, 3)
        if row.test.adjusted < MIN_P:
            p = f"< {MIN_P}"
    cells = {
        score.column.title: number(row.figures[score.name]),
        "95 % interval": ends,
        f"behind {score.points.strip()}": behind,
        "p": p,
    }
    if row.lost_tracks is None:
        return {**cells, "above": number(row.figures["above"], 2)}
    lost = row.figures["lost_rate"]
    return {
        **cells,
        "lost in": f"{row.lost_tracks}/{row.runs}",
        "lost %": "-" if lost is None else number(100.0 * lost, 1),
        "skill": number(row.figures[f"skill.{LOSS_BASELINE}"], 2),
    }


def board_lines(standings: Standings) -> list[str]:
    """Return the lines of the printed leaderboard.

    The last line is the baseline with which skills compare.
    """
    score = standings.contest.runs.kind.score
    cells = [board_cells(score, row) for row in standings.board]
    names = [row.name for row in standings.board]
    for baseline in standings.baselines:
        value = baseline.figures[score.name]
        if baseline.name == LOSS_BASELINE and value is not None:
            names.append(baseline.title)
            cells.append({score.column.title: f"{value:.{score.digits}f}"})
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


def board_rows(standings: Standings) -> list[dict[str, Any]]:
    """Return the rows of the leaderboard's CSV file.

    Each has every figure under its name, and all else that the page says of a method.
    """
    # of both kinds of runs the first figure is the score
    score, *others = standings.contest.runs.table_figures
    names = ["settings", score, "low", "high", *EFFECT]
    if standings.board[0].lost_tracks is not None:
        names.append("lost_tracks")
    names += ["runs", "failed", "warned", *others]
    rows = []
    for row in standings.board:
        values = row.as_dict()
        figures = {name: values[name] for name in names}
        rows.append({"method": row.name, **figures})
    return rows


def latex_table(standings: Standings) -> str:
    """Return the leaderboard as a LaTeX table."""
    score = standings.contest.runs.kind.score
    cells = [board_cells(score, row) for row in standings.board]
    columns = "l" + "r" * len(cells[0])
    lines = [f"\\begin{{tabular}}{{{columns}}}", "\\toprule"]
    lines.append(_latex_row(["method", *cells[0]]))
    lines.append("\\midrule")
    for row, texts in zip(standings.board, cells, strict=True):
        lines.append(_latex_row([row.name, *texts.values()]))
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
