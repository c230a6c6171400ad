"""Figures for papers, drawn by matplotlib (posefit[figures]), and their folder."""

import os
from collections.abc import Sequence
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING

from posefit.errors import InputError
from posefit.files import other_entries, replaced_folder
from posefit.report.charts import Chart, track_charts
from posefit.report.leaderboard import Standings
from posefit.report.page import LIGHT
from posefit.report.table import board_rows
from posefit.sweep.table import write_csv

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# A method has the same colour and marker as on the page. The first seven methods have
# lines of the first style, the next seven of the second, and so on.
COLOURS = tuple(LIGHT.values())
STYLES = ("-", "--", ":", "-.")
MARKERS = ("o", "s", "^", "D", "v", "X", "*", "h")
TABLE = "leaderboard.csv"
TABLE_MARK = b"method,settings,"
CHARTS = ("leaderboard", "convergence", "profile")
FOLDER_FILES = (
    *(f"{chart}.{kind}" for chart in CHARTS for kind in ("png", "pdf")),
    TABLE,
)
WIDTH = 6.4  # inches


def save(figure: "Figure", path: Path) -> None:
    """Write a figure as a new .png or .pdf file. Equal figures have the same bytes."""
    metadata = {"CreationDate": None} if path.suffix == ".pdf" else {}
    # a tight box leaves room for long names
    figure.savefig(path, dpi=200, bbox_inches="tight", metadata=metadata)


def chart_figure(
    names: Sequence[str], chart: Chart, numbers: Sequence[int], order: Sequence[int]
) -> "Figure":
    """Return a chart of the page as a figure: a line with its band for each method.

    Args:
        names: The names of the chart's methods.
        chart: The chart.
        numbers: The number of each of these methods in the report, which decides its
            colour.
        order: The methods in the order of the legend, by their indices in `names`.

    Returns:
        The figure.

    Raises:
        ImportError: Matplotlib is not installed.
    """
    figure = empty_figure()
    axes = figure.add_subplot(xlabel=chart.x_label, ylabel=chart.y_label)
    axes.spines[["top", "right"]].set_visible(False)
    for k in order:
        line = chart.lines[k]
        if line is None:
            continue
        colour = COLOURS[numbers[k] % len(COLOURS)]
        # steps, because a best cost holds until the next improvement
        axes.plot(
            line.x,
            line.y,
            color=colour,
            linestyle=STYLES[numbers[k] // len(COLOURS) % len(STYLES)],
            drawstyle="steps-post",
            label=_plain(names[k]),
        )
        if line.low is not None and line.high is not None:
            axes.fill_between(
                line.x,
                line.low,
                line.high,
                step="post",
                color=colour,
                alpha=0.12,
                linewidth=0,
            )
    axes.set_xscale("log" if chart.log else "linear")
    if chart.most is not None:
        axes.set_ylim(-0.02 * chart.most, 1.02 * chart.most)
    else:
        axes.set_ylim(bottom=0.0)
    figure.legend(
        loc="outside right upper", frameon=False, fontsize=8 if len(names) < 20 else 6
    )
    return figure


def board_figure(standings: Standings) -> "Figure":
    """Return a figure of the leaderboard.

    Each method has a marker and an interval, and each baseline a vertical line.

    Raises ImportError if matplotlib is not installed.
    """
    score = standings.contest.runs.kind.score
    rows = []
    for row in standings.board:
        if (value := row.figures[score.name]) is not None:
            rows.append((row, value))
    baselines = []
    for baseline in standings.baselines:
        if (value := baseline.figures[score.name]) is not None:
            baselines.append((baseline.title, value))
    height = 0.9 + 0.3 * len(rows) + 0.15 * len(baselines)
    bottom = len(rows) - 0.5
    top = -0.6
    figure = empty_figure(height)
    axes = figure.add_subplot(xlabel=score.axis)
    axes.spines[["top", "right", "left"]].set_visible(False)
    axes.tick_params(axis="y", length=0)
    for y, (row, value) in enumerate(rows):
        colour = COLOURS[row.method % len(COLOURS)]
        if row.interval:
            axes.plot(row.interval, [y, y], color=colour)
        marker = MARKERS[row.method % len(MARKERS)]
        axes.plot(value, y, marker=marker, color=colour)
    # each name is above the one to the left, because baselines may be close together
    for name, value in sorted(baselines, key=itemgetter(1)):
        top -= 0.5
        axes.plot(
            [value, value], [top, bottom], color="0.5", linestyle=":", lw=1.0, zorder=0
        )
        axes.text(value, top, f" {_plain(name)}", va="top", fontsize=7, color="0.35")
    axes.set_yticks(range(len(rows)), [_plain(row.name) for row, _ in rows])
    axes.set_ylim(bottom, top)
    axes.set_xlim(left=0.0)
    return figure


def empty_figure(height: float = 3.6) -> "Figure":
    """Return a figure of this height in inches.

    Raises ImportError if matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise ImportError(
            "figures need the library matplotlib: pip install posefit[figures]"
        ) from error
    return Figure(figsize=(WIDTH, height), layout="constrained")


def check_folder(path: str | Path) -> None:
    """Raise InputError if a path exists and is not an earlier folder of figures."""
    folder = Path(path)
    if not os.path.lexists(folder):
        return
    table = folder / TABLE
    is_earlier = (
        folder.is_dir()
        and not folder.is_symlink()
        and not other_entries(folder, FOLDER_FILES)
        and table.is_file()
        and table.read_bytes().startswith(TABLE_MARK)
    )
    if not is_earlier:
        raise InputError(
            f"{path}: expected a new name or an earlier folder of figures, "
            "got something else"
        )


def write_figures(standings: Standings, path: str | Path) -> None:
    """Write a folder of figures, as PNG and PDF, and of the leaderboard, as CSV.

    An earlier folder of figures is replaced. Figures without data are left out.

    Args:
        standings: The standings of the methods of a ledger of tracks.
        path: The folder.

    Raises:
        ValueError: The path exists and is not a folder of figures, or it cannot be
            written.
        ImportError: Matplotlib is not installed.
    """
    contest = standings.contest
    names = [contest.runs.methods[m] for m in contest.methods]
    order = []
    for row in standings.board:
        if row.taking_part:
            order.append(contest.methods.index(row.method))
    figures = {"leaderboard": board_figure(standings)}
    for chart in track_charts(contest):
        figures[chart.name] = chart_figure(names, chart, contest.methods, order)
    with replaced_folder(path, check_folder, FOLDER_FILES) as building:
        for name, figure in figures.items():
            for kind in ("png", "pdf"):
                save(figure, building / f"{name}.{kind}")
        write_csv(board_rows(standings), building / TABLE)


def _plain(name: str) -> str:
    """Return a name that matplotlib shows as it is.

    It reads `$` as the start of a formula, and leaves a line whose name begins with an
    underscore, such as a private factory's, out of the legend.
    """
    plain = name.replace("$", r"\$")
    return f" {plain}" if plain.startswith("_") else plain
