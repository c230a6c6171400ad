"""The report's figures: each has its place in a row."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.report.tracks import TRACKS
from posefit.sweep.cell import run_cell
from posefit.sweep.table import flat
from tests.report.contests import FIRST

COLUMNS = TRACKS.columns
CELL = replace(FIRST, method="random@pca", frames=3, size=(80, 60), evaluations=80)


@pytest.fixture(scope="module")
def row():
    """Return the row of a method that has a posterior."""
    return run_cell(replace(CELL, method="exemplars", evaluations=800))


def test_every_figure_has_its_place_in_a_row(row):
    computed = TRACKS.computed(row)
    figures, _ = TRACKS.read(row)
    assert np.isfinite(figures).all()
    columns = flat(row) | computed
    assert dict(zip(COLUMNS, figures, strict=True)) == {
        name: columns[name] for name in COLUMNS
    }
    assert computed.keys() == {"error_with_losses_degrees"}


def test_figures_have_the_units_of_the_csv_and_pages_multiply_them(row):
    assert COLUMNS["cpu_seconds_per_frame"].value(row) == row["cpu_seconds_per_frame"]
    shown = COLUMNS["cpu_seconds_per_frame"].as_dict()
    assert (shown["title"], shown["factor"]) == ("CPU time ms a frame", 1e3)
    shown = COLUMNS["coverage.80"].as_dict()
    assert (shown["title"], shown["factor"]) == ("within 80 % intervals %", 100.0)


def test_a_row_has_how_often_the_likeliest_mode_was_right(row):
    counts, probabilities, right = zip(*row["mode_reliability"], strict=True)
    assert sum(counts) == 3
    assert all(0.0 < probability <= 1.0 for probability in probabilities)
    assert all(0.0 <= share <= 1.0 for share in right)
    without = run_cell(replace(CELL, frames=2))
    assert (without["mode_reliability"], without["interval_mm"]) == ([], None)
