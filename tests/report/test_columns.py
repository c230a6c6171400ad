"""The report's figures: each has its place in a row, and its words from the one table of a track's figures."""

import math
from dataclasses import replace

import pytest

from posefit.report.columns import COLUMNS, FIGURES, TABLE_FIGURES
from posefit.sweep.cell import run_cell
from posefit.tracking.measures import BASELINES, MEASURES
from tests.sweep.fake import cells


@pytest.fixture(scope="module")
def row():
    settings = {"tracker.modes": 4}  # searches, which make a posterior
    return run_cell(
        replace(cells(1)[0], method="random@pca", frames=3, size=(80, 60), evaluations=80, settings=settings)
    ).row


def test_every_figure_has_its_place_in_a_row(row):
    for column in COLUMNS.values():
        assert math.isfinite(column.value(row)), column.name
    assert COLUMNS["coverage_80"].value(row) == row["coverage"]["80"]
    assert COLUMNS["interval_95"].value(row) == row["interval_mm"]["95"]
    assert COLUMNS["unknown"].value(row) == row["unknown_rate"]
    assert COLUMNS["error"].value(row) == row["error_degrees"]["mean"]
    assert COLUMNS["ms"].value(row) == 1e3 * row["seconds_per_frame"]
    assert COLUMNS["cpu_ms"].value(row) == 1e3 * row["cpu_seconds_per_frame"]
    assert COLUMNS["evaluations"].value(row) == row["evaluations_used"] / 3
    for name in BASELINES:
        assert COLUMNS[f"skill_{name}"].value(row) == row["skill"][name]
        assert COLUMNS[f"baseline_{name}"].value(row) == row["baselines_degrees"][name]


def test_a_row_that_lacks_a_figure_has_nan(row):
    for column in COLUMNS.values():
        without = {name: value for name, value in row.items() if name != column.path[0]}
        assert math.isnan(column.value(without)), column.name
        assert math.isnan(column.value({**row, column.path[0]: None})), column.name
    assert math.isnan(COLUMNS["skill_nearest"].value({**row, "skill": {"nearest": None}}))


def test_a_row_says_how_often_the_likeliest_mode_was_right(row):
    counts, told, right = zip(*row["mode_reliability"], strict=True)
    assert sum(counts) == 3
    assert all(0.0 < one <= 1.0 for one in told)
    assert all(0.0 <= one <= 1.0 for one in right)
    silent = run_cell(replace(cells(1)[0], method="random@pca", frames=2, size=(80, 60), evaluations=80)).row
    assert silent["mode_reliability"] == []
    assert silent["interval_mm"] is None


def test_labels_and_meanings_are_those_of_the_measures():
    about = {name: COLUMNS[name].as_dict() for name in TABLE_FIGURES}
    for name, measure in {"error": "error_degrees", "lost": "lost_rate", "iou": "iou", "mpjpe": "mpjpe_mm"}.items():
        assert about[name]["label"] == MEASURES[measure].label
        assert about[name]["about"] == MEASURES[measure].meaning
    assert about["error"]["title"] == "error °"
    assert about["lost"] | {"title": "lost %", "factor": 100.0, "digits": 1} == about["lost"]
    assert about["coverage_80"]["title"] == "80 % interval holds %"
    assert about["interval_80"]["title"] == "80 % interval mm"
    assert about["unknown"]["title"] == "said unknown %"
    assert about["ms"] | {"title": "time ms a frame", "factor": 1.0, "digits": 1} == about["ms"]
    for name, label in BASELINES.items():
        assert about[f"skill_{name}"]["title"] == f"skill: {label}"
    assert all(one["about"] for one in about.values())
    assert COLUMNS["mpjpe"].heading == "MPJPE (mm)"
    assert COLUMNS["lost"].heading == "lost"  # a share in files


def test_a_page_is_given_a_digit_more_than_it_shows():
    kept = {name: COLUMNS[name].stored_digits for name in TABLE_FIGURES}
    assert kept == {
        "error": 3, "skill_mean_pose": 3, "skill_persistence": 3, "skill_nearest": 3, "lost": 4, "swapped": 4,
        "unknown": 4, "coverage_80": 4, "interval_80": 1, "mpjpe": 1, "iou": 4, "ms": 2, "cpu_ms": 2, "evaluations": 1,
    }  # fmt: skip
    assert set(TABLE_FIGURES) < set(FIGURES)
