"""Figures: what is drawn is what was given."""

import numpy as np
import pytest

from posefit.report import figures
from posefit.report.charts import Chart, Line

pytest.importorskip("matplotlib")

GRID = np.array([40.0, 400.0, 2440.0])


def axes_of(line, **more):
    chart = Chart(name="a", title="A", x_label="x", y_label="y", lines=[line], **more)
    return figures.chart_figure(["cma_$x$@full"], chart).axes[0]


def test_lines_and_bands_have_their_values():
    values = np.array([9.0, 5.0, 3.0])
    axes = axes_of(Line(GRID, values, values - 0.5, values + 1.0), log=True)
    assert axes.lines[0].get_ydata().tolist() == [9, 5, 3]
    band = axes.collections[0].get_paths()[0].vertices
    assert (band[:, 1].min(), band[:, 1].max()) == (2.5, 10.0)
    assert axes.get_xscale() == "log"
    line = axes_of(Line(GRID, np.array([0.1, 0.5, 1.0])), stepped=True, most=1.0).lines[
        0
    ]
    assert (line.get_xdata().tolist(), line.get_ydata().tolist()) == (
        GRID.tolist(),
        [0.1, 0.5, 1.0],
    )
    assert line.get_drawstyle() == "steps-post"
