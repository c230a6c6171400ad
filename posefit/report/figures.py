"""Figures for papers, drawn by matplotlib (posefit[figures]), and the folder of a report's figures.

`methods` (m,) are names: a method has the same colour in every figure with the same names.
"""

import importlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from posefit.errors import InputError
from posefit.files import new_folder
from posefit.report.charts import Chart, track_charts
from posefit.report.kind import Runs
from posefit.report.leaderboard import contest_of, leaderboard
from posefit.sweep.table import write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Okabe and Ito, Color universal design, 2008, without their yellow; lines of the first seven methods, the next, ...
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
STYLES = ("-", "--", ":", "-.")
_SIZE = (6.4, 3.6)  # inches


def save(figure: "Figure", path: Path) -> None:
    """Write a figure as a new .png or .pdf; the same figure gives the same bytes."""
    metadata = {"CreationDate": None} if path.suffix == ".pdf" else {}
    # long names too
    figure.savefig(path, dpi=200, bbox_inches="tight", metadata=metadata)


def chart_figure(methods: Sequence[str], chart: Chart) -> "Figure":
    """Return a chart as the page has it: a line for each method, with its band."""
    figure: Figure = library("figure").Figure(figsize=_SIZE, layout="constrained")
    axes = figure.add_subplot(xlabel=chart.x_label, ylabel=chart.y_label)
    axes.spines[["top", "right"]].set_visible(False)
    for k, line in enumerate(chart.lines):
        if line is None:
            continue
        colour = COLOURS[k % len(COLOURS)]
        style = STYLES[k // len(COLOURS) % len(STYLES)]
        # no mathematics
        label = methods[k].replace("$", r"\$")
        step = "steps-post" if chart.stepped else None
        axes.plot(
            line.x, line.y, color=colour, linestyle=style, drawstyle=step, label=label
        )
        if line.low is not None and line.high is not None:
            axes.fill_between(
                line.x, line.low, line.high, color=colour, alpha=0.18, linewidth=0
            )
    axes.set_xscale("log" if chart.log else "linear")
    if chart.most is not None:
        axes.set_ylim(-0.02 * chart.most, 1.02 * chart.most)
    figure.legend(
        loc="outside right upper", frameon=False, fontsize=8 if len(methods) < 20 else 6
    )
    return figure


def library(name: str) -> Any:
    """Return a module of matplotlib, or matplotlib itself. Raises ImportError without it."""
    try:
        return importlib.import_module(f"matplotlib.{name}" if name else "matplotlib")
    except ImportError as error:
        raise ImportError(
            "figures need the library matplotlib: pip install posefit[figures]"
        ) from error


def write_figures(runs: Runs, path: str | Path) -> None:
    """Write a new folder of figures, as PNG and PDF, and the leaderboard as CSV.

    Figures are left out where the runs do not have the data. Raises ValueError where no run has an error, or where the
    folder exists or cannot be written.
    """
    contest = contest_of(runs)
    if contest is None:
        raise InputError("figures must be of runs with errors, got none")
    names = [runs.methods[m] for m in contest.methods]
    figures = {
        chart.name: chart_figure(names, chart)
        for chart in track_charts(contest, contest)
    }
    columns, (error, *others) = runs.kind.columns, runs.table_figures
    table = {
        "method": "name",
        columns[error].heading: error,
        "low": "low",
        "high": "high",
    }
    table |= {**{columns[name].heading: name for name in others}, "runs": "runs"}
    rows = [
        {title: row[key] for title, key in table.items()}
        for row in leaderboard(contest)
    ]
    with new_folder(path) as folder:
        for name, figure in figures.items():
            for kind in ("png", "pdf"):
                save(figure, folder / f"{name}.{kind}")
        write_csv(rows, folder / "leaderboard.csv")
