"""Figures: what is drawn is what was given, and the files can be read."""

import sys

import cv2
import numpy as np
import pytest

from posefit.report import figures
from posefit.report.charts import Chart, Line
from posefit.statistics.intervals import Intervals

pytest.importorskip("matplotlib")

METHODS = ("sapso@pca", "cma_$x$@full", "vsmm")
SHARES = np.array([[0.1, 0.5, 1.0], [0.0, 0.3, 0.9], [0.0, 0.0, 0.2]])
GRID = np.array([40.0, 400.0, 2440.0])


def bands(*rows):
    return [Intervals(values, values - 0.5, values + 1.0) for values in np.array(rows, dtype=float)]


def chart(lines, **more):
    return figures.chart_figure(METHODS, Chart(name="a", title="A", x_label="x", y_label="y", lines=lines, **more))


def every():
    """Return one figure of each kind."""
    return {
        "curves": chart(
            [Line(GRID, b.values, b.low, b.high) for b in bands([9, 5, 3], [9, 8, 7], [9, 9, 9])], log=True
        ),
        "shares": chart([Line(GRID, share) for share in SHARES], stepped=True, most=1.0),
    }


def test_every_figure_is_written_with_the_same_bytes_and_the_colours_of_its_methods(tmp_path):
    starts = {".png": b"\x89PNG", ".pdf": b"%PDF"}
    once, again = every(), every()
    for name, figure in once.items():
        for suffix in starts if name == "shares" else (".png",):
            paths = [tmp_path / f"{name}{k}{suffix}" for k in range(2)]
            for path, drawn in zip(paths, (figure, again[name]), strict=True):
                figures.save(drawn, path)
            first, second = (path.read_bytes() for path in paths)
            assert first == second, name
            assert first.startswith(starts[suffix])
        image = cv2.imread(str(tmp_path / f"{name}0.png"))[:, :, ::-1].reshape(-1, 3).astype(int)
        for colour in figures.COLOURS[:3]:
            pixel = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
            assert (np.abs(image - pixel).max(axis=1) < 3).sum() > 50, (name, colour)


def test_lines_and_bands_have_their_values():
    axes = {name: figure.axes[0] for name, figure in every().items()}
    assert axes["curves"].lines[0].get_ydata().tolist() == [9, 5, 3]
    band = axes["curves"].collections[0].get_paths()[0].vertices
    assert (band[:, 1].min(), band[:, 1].max()) == (2.5, 10.0)
    assert axes["curves"].get_xscale() == "log"
    line = axes["shares"].lines[0]
    assert (line.get_xdata().tolist(), line.get_ydata().tolist()) == (GRID.tolist(), [0.1, 0.5, 1.0])
    assert axes["shares"].lines[0].get_drawstyle() == "steps-post"


def test_28_methods_are_drawn_and_no_two_lines_are_equal():
    names = [f"method-{k}-with-a-rather-long-name-for-a-figure" for k in range(28)]
    line = Line(np.array([0.0, 1.0]), np.array([0.0, 1.0]))
    shown = Chart(name="a", title="A", x_label="x", y_label="y", lines=[line] * 28)
    drawn = figures.chart_figure(names, shown)
    assert len({(line.get_color(), line.get_linestyle()) for line in drawn.axes[0].lines}) == 28


def test_without_matplotlib_the_error_names_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"figures need the library matplotlib: pip install posefit\[figures\]"):
        figures.library("figure")
