"""The rows of a ledger as numbers: named apart, in an order of their own, and with gaps where a row has none."""

import json
import random
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from posefit.report.columns import FIGURES
from posefit.report.runs import Runs, runs_of
from posefit.sweep.cell import TrackCell
from posefit.sweep.ledger import Ledger
from tests.report.browser import ledger, result
from tests.sweep.fake import cells

FIRST = cells(1)[0]
SAPSO, COOLER = replace(FIRST, method="sapso@pca"), replace(FIRST, method="sapso@pca", settings={"sapso.cooling": 0.9})


def read(path: Path, cells: list[tuple[TrackCell, float]]) -> Runs:
    return runs_of(Ledger(ledger(path / "results", [result(cell, error) for cell, error in cells])))


def test_methods_are_told_apart_by_what_they_differ_in_and_come_best_first(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        [
            (SAPSO, 3.0),
            (COOLER, 2.0),
            (replace(COOLER, evaluations=400), 5.0),
            (FIRST, 1.0),
            (replace(FIRST, version=f"{FIRST.version}, posefit-spiral 1.2"), 4.0),
        ],
    )
    assert found.methods == (
        "random@pca",
        "sapso@pca, sapso.cooling=0.9, 2440 evaluations",
        "sapso@pca, 2440 evaluations",
        "random@pca, posefit-spiral 1.2",
        "sapso@pca, sapso.cooling=0.9, 400 evaluations",
    )
    assert [one["settings"] for one in found.variants][1] == "sapso.cooling=0.9"


def test_instances_are_told_apart_by_all_that_a_method_does_not_choose(tmp_path: Path) -> None:
    found = read(
        tmp_path,
        [
            (replace(FIRST, corruption={"holes": 0.5}), 1.0),
            (replace(FIRST, instance=2), 1.0),
            (replace(FIRST, frames=30), 1.0),
            (FIRST, 1.0),
            (replace(FIRST, seed=1), 1.0),
        ],
    )
    assert found.instances == (
        "walk, view 45°, instance 0, frames 30",
        "walk, view 45°, instance 0, frames 60",
        "walk, view 45°, instance 2",
        "walk, view 45°, holes 0.5, instance 0",
    )
    assert np.bincount(found.instance).tolist() == [1, 2, 1, 1]


def test_the_order_is_that_of_the_specs_whoever_finished_first(tmp_path: Path) -> None:
    chosen = [(replace(FIRST, method=m, instance=i, seed=s), 1.0 + i) for m in "ab" for i in range(3) for s in range(2)]
    mixed = random.Random(0).sample(chosen, len(chosen))
    one, other = read(tmp_path / "one", chosen), read(tmp_path / "other", mixed)
    assert one.keys == other.keys
    assert (one.figures["error"] == other.figures["error"]).all()
    assert one.heads == other.heads
    assert (one.head == other.head).all()


def test_a_row_without_a_figure_has_none(tmp_path: Path) -> None:
    skill = {"mean_pose": None, "persistence": 0.5, "nearest": 0.25}
    bare = result(
        FIRST, 1.0, error_degrees=None, skill=skill, baselines_degrees=None, trace={"evaluations": [], "cost": []}
    )
    found = runs_of(Ledger(ledger(tmp_path / "results", [bare])))
    assert {name for name in FIGURES if np.isnan(found.figures[name][0])} == {
        "error", "skill_mean_pose", "baseline_mean_pose", "baseline_persistence", "baseline_nearest", "unknown",
        *(f"{kind}_{level}" for kind in ("coverage", "interval") for level in (50, 80, 95)),
    }  # fmt: skip
    assert found.figures["skill_nearest"].tolist() == [0.25]
    assert found.figures["evaluations"].tolist() == [FIRST.evaluations]
    assert found.figures["ms"].tolist() == [10.0]
    assert len(found.traces[0][0]) == 0


def test_what_only_some_methods_say_is_shown_where_one_does(tmp_path: Path) -> None:
    said = {"unknown_rate": 0.25, "coverage": {"50": 0.4, "80": 0.7, "95": 0.9}, "interval_mm": None}
    silent = result(replace(FIRST, seed=1), 1.0)  # of a ledger from before there were posteriors
    older = runs_of(Ledger(ledger(tmp_path / "older", [silent])))
    newer = runs_of(Ledger(ledger(tmp_path / "newer", [silent, result(FIRST, 1.0, **said)])))
    assert [name for name in newer.table_figures if name not in older.table_figures] == ["unknown", "coverage_80"]
    assert newer.figures["coverage_80"][newer.seed == 0].tolist() == [0.7]


def test_modes_are_counted_by_how_likely_they_are(tmp_path: Path) -> None:
    made = result(FIRST, 1.0, mode_reliability=[[4, 0.55, 0.25], [2, 1.0, 0.5]])
    (bins,) = runs_of(Ledger(ledger(tmp_path / "results", [made]))).modes
    np.testing.assert_allclose(bins[[5, 9]], [[4, 2.2, 1], [2, 2, 1]], rtol=1e-6)
    assert not np.delete(bins, [5, 9], axis=0).any()


def test_seeds_of_any_size_keep_every_digit(tmp_path: Path) -> None:
    found = read(tmp_path, [(replace(FIRST, seed=2**70 + 1), 1.0), (replace(FIRST, seed=2**70), 2.0)])
    assert [found.seeds[k] for k in found.seed] == [2**70, 2**70 + 1]


def test_a_ledger_without_rows_is_refused(tmp_path: Path) -> None:
    empty = ledger(tmp_path / "results", [])
    with pytest.raises(ValueError, match="results: expected a ledger with finished rows, got one with none"):
        runs_of(Ledger(empty))


def test_failures_keep_their_reasons_and_their_command(tmp_path: Path) -> None:
    made = ledger(tmp_path / "results", [result(FIRST, 1.0)], [(SAPSO, ["slow", "slow", "dead"])])
    found = runs_of(Ledger(made))
    other = ledger(tmp_path / "other", [result(SAPSO, 1.0), result(COOLER, 2.0)], [(replace(COOLER, seed=1), ["slow"])])
    assert runs_of(Ledger(other)).failed == (0, 1)
    assert found.failed == (0,)
    assert found.unfinished == ("sapso@pca",)
    assert found.failures[0]["name"] == str(SAPSO)
    assert found.failures[0]["reasons"] == ["slow", "dead"]
    assert 'method = "sapso@pca"' in found.failures[0]["command"]
    assert json.dumps(found.failures)
