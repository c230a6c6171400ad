"""Figures: what is drawn is what was given, and the files can be read."""

import sys

import cv2
import numpy as np
import pytest

from posefit.report import figures
from posefit.statistics.intervals import Intervals
from posefit.statistics.ranks import Ranking, friedman

pytest.importorskip("matplotlib")

METHODS = ("sapso@pca", "cma_$x$@full", "vsmm")
BINS = [[30, 0.55, 0.4], [90, 0.95, 0.9]]
WIDTHS = [[20.0, 40.0, 80.0], [10.0, 20.0, 30.0], [50.0, 90.0, 160.0]]
GRID = np.array([40.0, 400.0, 2440.0])


def band(values):
    values = np.asarray(values, dtype=float)
    return Intervals(values, values - 0.5, values + 1.0)


def ranking(means, cliques, difference=0.8):
    return Ranking(np.array(means), 5.0, 0.04, difference, cliques)


def texts(figure):
    return [text.get_text() for axes in figure.axes for text in axes.texts]


def every():
    """Return one figure of each kind."""
    shares = np.array([[0.1, 0.5, 1.0], [0.0, 0.3, 0.9], [0.0, 0.0, 0.2]])
    return {
        "convergence": figures.curves_figure(METHODS, GRID, [band([9, 5, 3]), band([9, 8, 7]), band([9, 9, 9])]),
        "attainment": figures.attainment_figure(METHODS, GRID, shares),
        "profile": figures.profile_figure(METHODS, np.array([1.0, 2.0, 3.0]), shares),
        "joint_errors": figures.joint_errors_figure(
            METHODS, ["head", "l_foot"], [band([30, 60]), band([40, 50]), band([9, 9])]
        ),
        "reliability": figures.reliability_figure(METHODS, [BINS, BINS[:1], BINS[1:]]),
        "coverage": figures.coverage_figure(METHODS, (0.5, 0.8, 0.95), WIDTHS, shares),
        "critical_difference": figures.critical_difference_figure(METHODS, ranking([1.2, 1.8, 3.0], ((0, 1),))),
    }


def test_every_figure_is_written_with_the_same_bytes_and_the_colours_of_its_methods(tmp_path):
    starts = {".png": b"\x89PNG", ".pdf": b"%PDF", ".svg": b"<?xml"}
    once, again = every(), every()
    for name, figure in once.items():
        for suffix in figures.FORMATS if name in ("coverage", "critical_difference") else (".png",):
            figures.save(figure, tmp_path / f"{name}{suffix}")
            figures.save(again[name], tmp_path / f"{name}-again{suffix}")
            first, second = ((tmp_path / f"{name}{part}{suffix}").read_bytes() for part in ("", "-again"))
            assert first == second, name
            assert first.startswith(starts[suffix])
        image = cv2.imread(str(tmp_path / f"{name}.png"))[:, :, ::-1].reshape(-1, 3).astype(int)
        for colour in figures.COLOURS[:3]:
            wanted = [int(colour[k : k + 2], 16) for k in (1, 3, 5)]
            assert (np.abs(image - wanted).max(axis=1) < 3).sum() > 50, (name, colour)


def test_a_curve_has_its_values_and_its_band():
    axes = every()["convergence"].axes[0]
    assert axes.lines[0].get_ydata().tolist() == [9, 5, 3]
    reach = axes.collections[0].get_paths()[0].vertices
    assert (reach[:, 1].min(), reach[:, 1].max()) == (2.5, 10.0)


def test_a_reliability_diagram_has_its_diagonal_and_dots_as_large_as_there_are_frames():
    axes = every()["reliability"].axes[0]
    assert axes.lines[0].get_xdata().tolist() == axes.lines[0].get_ydata().tolist() == [0, 1]
    assert axes.lines[1].get_xdata().tolist() == [0.55, 0.95]
    assert axes.lines[1].get_ydata().tolist() == [0.4, 0.9]
    small, large = axes.collections[0].get_sizes()
    assert (small, large) == pytest.approx((8 + 20, 8 + 60))


def test_coverage_stands_over_width_among_the_levels():
    axes = every()["coverage"].axes[0]
    assert [line.get_ydata()[0] for line in axes.lines[:3]] == [0.5, 0.8, 0.95]
    assert axes.lines[4].get_xdata().tolist() == WIDTHS[1]
    assert axes.lines[4].get_ydata().tolist() == [0.0, 0.3, 0.9]


def test_bars_have_their_intervals_and_one_seed_has_none():
    errors = Intervals(np.array([3.0]), np.array([np.nan]), np.array([np.nan]))
    axes = figures.joint_errors_figure(("a", "b"), ["head"], [band([30]), errors]).axes[0]
    assert [bar.get_width() for bar in axes.patches] == [30, 3]
    whiskers = [one.get_segments()[0][:, 0].tolist() for one in axes.collections]
    assert whiskers == [[29.5, 31.0], [3.0, 3.0]]


def test_a_critical_difference_plot_names_methods_best_first_with_their_ranks():
    drawn = every()["critical_difference"]
    assert texts(drawn) == [
        "1",
        "2",
        "3",
        "sapso@pca  1.20",
        r"cma_\$x\$@full  1.80",
        "3.00  vsmm",
        "critical difference 0.80",
    ]


def test_a_bar_joins_what_is_not_told_apart():
    axes = figures.critical_difference_figure(
        ("a", "b", "c", "d"), ranking([1.0, 2.0, 3.2, 3.8], ((0, 1), (2, 3)))
    ).axes[0]
    bars = [line.get_xdata() for line in axes.lines if line.get_linewidth() == 3.5]
    assert [
        (min(ends) <= low, max(ends) >= high) for ends, (low, high) in zip(bars, ((1, 2), (3.2, 3.8)), strict=True)
    ] == [
        (True, True),
        (True, True),
    ]
    assert max(bars[0]) < 3.2


def test_a_critical_difference_longer_than_the_line_is_said_to_be():
    drawn = figures.critical_difference_figure(("a", "b"), friedman([[[1.0, 2.0]], [[2.0, 1.0]]]))
    # sqrt(2 * 3 / (6 * 2)) * 1.960 = 1.39, and the line is 1 long
    assert texts(drawn)[-1] == "critical difference 1.39, longer than the line"


def test_thirty_methods_are_drawn_and_no_two_lines_look_alike(tmp_path):
    names = [f"method-{k}-with-a-rather-long-name-for-a-figure" for k in range(28)]
    found = friedman(np.random.default_rng(0).gamma(2.0, size=(28, 5, 5)))
    figures.save(figures.critical_difference_figure(names, found), tmp_path / "cd.png")
    drawn = figures.profile_figure(names, np.array([0.0, 1.0]), np.tile([0.0, 1.0], (28, 1)))
    assert len({(line.get_color(), line.get_linestyle()) for line in drawn.axes[0].lines}) == 28


def test_another_format_is_refused_and_nothing_is_written(tmp_path):
    with pytest.raises(ValueError, match=r"a.bmp: expected a figure that ends in .png, .pdf, .svg, got '.bmp'"):
        figures.save(every()["profile"], tmp_path / "a.bmp")
    assert list(tmp_path.iterdir()) == []


def test_without_matplotlib_it_is_said_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(ImportError, match=r"figures need the library matplotlib: pip install posefit\[figures\]"):
        figures.check_figure("a.png")
