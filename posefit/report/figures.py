"""Figures for papers, drawn by matplotlib (posefit[figures]), and the folder of a report's figures and tables.

`methods` (m,) are names: a method has the same colour in every figure with the same names.
"""

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from posefit.errors import InputError
from posefit.files import new_file, new_folder
from posefit.geometry.skeleton import JOINTS
from posefit.report.charts import Chart, joint_errors, track_charts
from posefit.report.contest import contest_of, leaderboard
from posefit.report.export import latex_table, write_csv
from posefit.report.runs import Runs
from posefit.statistics.intervals import Intervals
from posefit.statistics.ranks import Ranking, friedman

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito, Color universal design, 2008, without their yellow; lines of the first seven methods, the next, ...
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STYLES = ("-", "--", ":", "-.")
METADATA: dict[str, dict[str, Any]] = {".png": {}, ".pdf": {"CreationDate": None}, ".svg": {"Date": None}}  # of formats
_SIZE = (6.4, 3.6)  # inches
# a critical-difference plot: inches a row; rows above the line, and from one bar to the next
_ROW, _ABOVE, _BAR = 0.24, 3.1, 0.4


def save(figure: "Figure", path: str | Path) -> None:
    """Write a figure as a new file, whose suffix is its format; the same figure gives the same bytes."""
    kind = Path(path).suffix.lower()
    if kind not in METADATA:
        raise InputError(f"{path}: expected a figure that ends in {', '.join(METADATA)}, got {kind!r}")
    with new_file(path) as building, library("").rc_context({"svg.hashsalt": "posefit"}):
        figure.savefig(building, dpi=200, bbox_inches="tight", metadata=METADATA[kind])  # long names too


def chart_figure(methods: Sequence[str], chart: Chart) -> "Figure":
    """Return a chart as the page has it: a line for each method, with its band and its dots."""
    figure, axes = _figure(chart.x_label, chart.y_label)
    for x, y, end, top in chart.guides:
        axes.plot([x, end], [y, top], color="0.7", linewidth=1, linestyle="--")
    for k, line in enumerate(chart.lines):
        if line is None:
            continue
        marker = "o" if line.dots else None
        axes.plot(line.x, line.y, marker=marker, drawstyle="steps-post" if chart.stepped else None, **_line(methods, k))
        if line.low is not None and line.high is not None:
            axes.fill_between(line.x, line.low, line.high, color=_colour(k), alpha=0.18, linewidth=0)
    axes.set_xscale("log" if chart.log else "linear")
    if chart.most is not None:
        axes.set_ylim(-0.02 * chart.most, 1.02 * chart.most)
    return _with_legend(figure, methods)


def joint_errors_figure(methods: Sequence[str], joints: Sequence[str], errors: Sequence[Intervals]) -> "Figure":
    """Return bars, a group for each joint with one for each method; of each method the intervals of all joints."""
    thick = 0.8 / len(methods)
    figure, axes = _figure("error, mm", "", (_SIZE[0], 1.1 + len(joints) * max(0.22, 0.09 * len(methods))))
    places = np.arange(len(joints))
    for k, error in enumerate(errors):
        axes.barh(
            places + (k - (len(methods) - 1) / 2) * thick,
            error.values,
            thick,
            xerr=np.nan_to_num([error.values - error.low, error.high - error.values]),  # one seed has no interval
            label=_plain(methods[k]),
            color=_colour(k),
            hatch=(None, "////", "....", "xxxx")[k // len(COLOURS) % 4],
            error_kw={"elinewidth": 0.8, "ecolor": "0.25"},
        )
    axes.set_yticks(places, map(_plain, joints))
    axes.set_ylim(len(joints) - 0.5, -0.5)
    axes.tick_params(axis="y", length=0)
    axes.set_xlim(left=0.0)
    return _with_legend(figure, methods)


def critical_difference_figure(methods: Sequence[str], ranking: Ranking) -> "Figure":
    """Return mean ranks on a line, best to the left; bars join methods that do not differ. Demšar, 2006."""
    count, half = len(methods), (len(methods) + 1) // 2
    names = 0.9 + _BAR * len(ranking.cliques)  # rows from the line to the first name
    rows = names + half
    figure: Figure = library("figure").Figure(figsize=(7.2, _ROW * (_ABOVE + rows)))
    axes = figure.add_axes((0.3, 0.0, 0.4, 1.0))
    beyond = 0.02 * (count - 1)
    axes.set_xlim(1.0 - beyond, count + beyond)
    axes.set_ylim(rows, -_ABOVE)
    axes.axis("off")
    axes.plot([1, count], [0, 0], color="black", linewidth=1)
    for rank in range(1, count + 1):
        axes.plot([rank, rank], [0, -0.35], color="black", linewidth=1)
        axes.text(rank, -0.5, str(rank), ha="center", va="bottom", fontsize=9)
    for k, clique in enumerate(ranking.cliques):
        low, high = ranking.mean_ranks[[clique[0], clique[-1]]]
        height = 0.45 + _BAR * k
        axes.plot([low - beyond / 2, high + beyond / 2], [height, height], color="black", linewidth=3.5)
    for place, method in enumerate(np.argsort(ranking.mean_ranks, kind="stable")):
        best = place < half  # half of the names on either side
        rank, row = ranking.mean_ranks[method], names + (place if best else count - 1 - place)
        line = _line(methods, int(method)) | {"linewidth": 1}
        axes.plot([rank, rank, axes.get_xlim()[0 if best else 1]], [0, row, row], **line)
        axes.plot([rank], [0], marker="o", markersize=4, color=line["color"])
        shown = [_plain(methods[method]), f"{rank:.2f}"]
        text = "  ".join(shown if best else shown[::-1])
        where = axes.get_yaxis_transform()
        axes.text(-0.01 if best else 1.01, row, text, transform=where, ha="right" if best else "left", va="center")
    _ruler(axes, ranking.critical_difference, count)
    return figure


def _ruler(axes: "Axes", difference: float, count: int) -> None:
    """Draw the critical difference above the line."""
    longer = difference > count - 1.0
    end, y = 1.0 + min(difference, count - 1.0), 0.6 - _ABOVE
    axes.plot([1, end], [y, y], color="black", linewidth=1.5)
    for x in (1.0, end)[: 1 if longer else 2]:
        axes.plot([x, x], [y - 0.15, y + 0.15], color="black", linewidth=1)
    label = f"critical difference {difference:.2f}" + (", longer than the line" if longer else "")
    axes.text(1, y + 0.25, label, va="top", fontsize=8)


def library(name: str) -> Any:
    """Return a module of matplotlib, or matplotlib itself. Raises ImportError without it."""
    try:
        return importlib.import_module(f"matplotlib.{name}" if name else "matplotlib")
    except ImportError as error:
        raise ImportError("figures need the library matplotlib: pip install posefit[figures]") from error


def _figure(x: str, y: str, size: tuple[float, float] = _SIZE) -> "tuple[Figure, Axes]":
    figure: Figure = library("figure").Figure(figsize=size, layout="constrained")
    axes = figure.add_subplot(xlabel=x, ylabel=y)
    axes.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _with_legend(figure: "Figure", methods: Sequence[str]) -> "Figure":
    figure.legend(loc="outside right upper", frameon=False, fontsize=8 if len(methods) < 20 else 6)
    return figure


def _colour(k: int) -> str:
    return COLOURS[k % len(COLOURS)]


def _line(methods: Sequence[str], k: int) -> dict[str, Any]:
    """Return the label and look of a method's line."""
    style = STYLES[k // len(COLOURS) % len(STYLES)]
    return {"label": _plain(methods[k]), "color": _colour(k), "linestyle": style}


def _plain(text: str) -> str:
    """Return text that matplotlib does not interpret as mathematics."""
    return text.replace("$", r"\$")


def write_figures(runs: Runs, path: str | Path) -> None:
    """Write a new folder of figures, as PNG and PDF, and the leaderboard as LaTeX and CSV.

    Figures are left out where the runs do not have the data. Raises ValueError where no run has an error, or where the
    folder exists or cannot be written.
    """
    contest = contest_of(runs)
    if contest is None:
        raise InputError("figures must be of runs with errors, got none")
    names = [runs.methods[m] for m in contest.methods]
    figures = {chart.name: chart_figure(names, chart) for chart in track_charts(contest, contest)}
    if joints := joint_errors(contest):
        figures["joints"] = joint_errors_figure(names, JOINTS, joints)
    if contest.testable:
        figures["critical-difference"] = critical_difference_figure(names, friedman(contest.tested_errors()))
    columns, (error, *others) = runs.kind.columns, runs.table_figures
    table = {"method": "name", columns[error].heading: error, "low": "low", "high": "high", "group": "letters"}
    table |= {**{columns[name].heading: name for name in others}, "runs": "runs"}
    rows = [{title: row[key] for title, key in table.items()} for row in leaderboard(contest)]
    with new_folder(path) as folder:
        for name, figure in figures.items():
            for kind in ("png", "pdf"):
                save(figure, folder / f"{name}.{kind}")
        latex = latex_table(list(table), [list(row.values()) for row in rows])
        (folder / "leaderboard.tex").write_text(latex, encoding="utf-8")
        write_csv(rows, folder / "leaderboard.csv")
