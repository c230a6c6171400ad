"""Figures: what is drawn is what was given."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.report import figures
from posefit.report.charts import Chart, Line
from posefit.report.page import LIGHT
from tests.report.contests import contest_of_errors, full, standings

pytest.importorskip("matplotlib")

GRID = np.array([40.0, 400.0, 2440.0])


def axes_of(line, **more):
    chart = Chart(name="a", title="A", x_label="x", y_label="y", lines=[line], **more)
    return figures.chart_figure(["cma_$x$@full"], chart, [8], [0]).axes[0]


def test_lines_and_bands_have_their_values():
    values = np.array([9.0, 5.0, 3.0])
    axes = axes_of(Line(GRID, values, values - 0.5, values + 1.0), log=True)
    assert axes.lines[0].get_ydata().tolist() == [9, 5, 3]
    band = axes.collections[0].get_paths()[0].vertices
    assert (band[:, 1].min(), band[:, 1].max()) == (2.5, 10.0)
    # steps: no corner between two of the values
    assert set(band[:, 1].tolist()) <= {*(values - 0.5), *(values + 1.0)}
    assert axes.get_xscale() == "log"
    line = axes_of(Line(GRID, np.array([0.1, 0.5, 1.0])), most=1.0).lines[0]
    assert (line.get_xdata().tolist(), line.get_ydata().tolist()) == (
        GRID.tolist(),
        [0.1, 0.5, 1.0],
    )
    assert line.get_drawstyle() == "steps-post"


def test_a_method_has_the_colour_of_the_page_and_the_legend_the_leaderboards_order():
    lines = [Line(GRID, np.full(3, float(k))) for k in range(3)]
    chart = Chart(name="a", title="A", x_label="x", y_label="y", lines=lines)
    figure = figures.chart_figure(["a", "b", "c"], chart, [9, 1, 0], [2, 0, 1])
    drawn = {line.get_label(): line for line in figure.axes[0].lines}
    colours = [*LIGHT.values()]
    assert [drawn[name].get_color() for name in "abc"] == [
        colours[2], colours[1], colours[0],
    ]  # fmt: skip
    assert drawn["a"].get_linestyle() == "--"  # of the second seven
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [
        "c",
        "a",
        "b",
    ]


def test_a_name_that_begins_with_an_underscore_is_in_the_legend():
    chart = Chart(
        name="a", title="A", x_label="x", y_label="y", lines=[Line(GRID, GRID)]
    )
    figure = figures.chart_figure(["_search"], chart, [0], [0])
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [" _search"]


def test_the_leaderboard_is_a_picture_with_its_rows_from_top_to_bottom(tmp_path):
    contest = contest_of_errors(tmp_path, full({"a": 1.0, "b": 2.0}, instances=4))
    made = standings(contest)
    other = replace(made.board[1], interval=None)
    axes = figures.board_figure(replace(made, board=[made.board[0], other])).axes[0]
    assert [text.get_text() for text in axes.get_yticklabels()] == ["a", "b"]
    assert axes.yaxis_inverted()
    interval, first, second, baseline, *_ = axes.lines
    assert tuple(interval.get_xdata()) == made.board[0].interval
    # errors are 0.1 higher on each instance, and 0.01 higher with the second seed
    values = [float(one.get_xdata()[0]) for one in (first, second, baseline)]
    assert values == pytest.approx([1.155, 2.155, 4.0])
    assert first.get_color() == figures.COLOURS[0]
