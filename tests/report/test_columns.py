"""The report's figures: each has its place in a row."""

import math
from dataclasses import replace

import pytest

from posefit.evaluation.measures import BASELINES, MEASURES
from posefit.report.tracks import TRACKS
from posefit.sweep.cell import run_cell
from tests.report.contests import FIRST

COLUMNS = TRACKS.columns
CELL = replace(FIRST, method="random@pca", frames=3, size=(80, 60), evaluations=80)


@pytest.fixture(scope="module")
def row():
    """Return the row of a method that has a posterior."""
    return run_cell(replace(CELL, method="exemplars", evaluations=800)).row


def test_every_figure_has_its_place_in_a_row(row):
    values = {name: column.value(row) for name, column in COLUMNS.items()}
    assert all(map(math.isfinite, values.values()))
    expected = {
        "coverage_80": row["coverage"]["80"],
        "interval_95": row["interval_mm"]["95"],
        "unknown": row["unknown_rate"],
        "error": row["error_degrees"]["mean"],
        "ms": 1e3 * row["seconds_per_frame"],
        "cpu_ms": 1e3 * row["cpu_seconds_per_frame"],
        "evaluations": row["evaluations_used"] / 3,
        **{f"skill_{name}": row["skill"][name] for name in BASELINES},
        **{f"baseline_{name}": row["baselines_degrees"][name] for name in BASELINES},
    }
    assert {name: values[name] for name in expected} == expected


def test_a_figure_is_shown_as_that_of_a_single_track_is(row):
    renamed = {"evaluations_used": "evaluations"}
    for name, column in COLUMNS.items():
        raw = row
        for part in column.path:
            raw = raw[part]
        if column.per_frame:
            raw /= row["spec"]["frames"]
        place = column.path[0]
        measure = MEASURES[renamed.get(place, place)]
        shown = column.measure.factor * column.value(row)
        assert shown == pytest.approx(measure.factor * raw), name


def test_a_row_has_how_often_the_likeliest_mode_was_right(row):
    counts, probabilities, right = zip(*row["mode_reliability"], strict=True)
    assert sum(counts) == 3
    assert all(0.0 < probability <= 1.0 for probability in probabilities)
    assert all(0.0 <= share <= 1.0 for share in right)
    without = run_cell(replace(CELL, frames=2)).row
    assert (without["mode_reliability"], without["interval_mm"]) == ([], None)
