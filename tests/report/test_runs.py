"""The rows of a ledger as numbers: distinct names, a stable order, and nan where a row has no figure."""

import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.report.contest import Runs
from posefit.report.names import distinct
from posefit.report.tracks import TRACKS
from tests.report.browser import ledger, result
from tests.report.contests import FIRST, full, results_of, runs_in

SAPSO = replace(FIRST, method="sapso@pca")
COOLER = replace(FIRST, method="sapso@pca", settings={"sapso.cooling": 0.9})


def read(path: Path, *results: dict[str, Any]) -> Runs:
    return runs_in(ledger(path / "results", results))


def test_methods_of_the_same_name_are_named_by_their_differences_best_first(
    tmp_path: Path,
) -> None:
    runs = read(
        tmp_path,
        result(SAPSO, 3.0),
        result(COOLER, 2.0),
        result(replace(COOLER, evaluations=400), 5.0),
        result(FIRST, 1.0),
        result(replace(FIRST, version=f"{FIRST.version}, posefit-spiral 1.2"), 4.0),
    )
    assert runs.methods == (
        "random@pca",
        "sapso@pca (cooling 0.9, evaluations 2440)",
        "sapso@pca (evaluations 2440)",
        "random@pca (posefit-spiral 1.2)",
        "sapso@pca (cooling 0.9, evaluations 400)",
    )
    assert runs.settings[1] == "sapso.cooling=0.9"


def test_settings_of_one_plain_name_have_their_plugins(tmp_path: Path) -> None:
    all_of_them = {"sapso.seed": 1, "pca.seed": 2, "sapso.cooling": 0.9}
    several = [all_of_them, {"sapso.seed": 1, "pca.seed": 2}, {"pca.seed": 3}]
    runs = read(
        tmp_path,
        *(result(replace(SAPSO, settings=s), 1.0 + k) for k, s in enumerate(several)),
    )
    assert runs.methods == (
        "sapso@pca (pca.seed 2, cooling 0.9, sapso.seed 1)",
        "sapso@pca (pca.seed 2, sapso.seed 1)",
        "sapso@pca (pca.seed 3)",
    )


def test_names_are_distinct_and_printable_with_any_content() -> None:
    details = [
        {"version": "1", "evaluations": "2"},
        {"version": "1", "evaluations": "3"},
        {},
        {},
    ]
    assert distinct(["cold", "cold", "a", "a (2)"], details) == (
        "cold (evaluations 2)", "cold (evaluations 3)", "a", "a (2)",
    )  # fmt: skip
    assert distinct(["a", "a", "a (2)"], [{}] * 3) == ("a", "a (2)", "a (2) (2)")
    names = distinct(["\x1b[31mred\nb", "\\x1b[31mred\\nb", "\u202e"], [{}] * 3)
    assert len(set(names)) == 3
    assert all(map(str.isprintable, names))


def test_instances_differ_in_all_that_a_method_does_not_choose(tmp_path: Path) -> None:
    changes: list[dict[str, Any]] = [
        {"corruption": {"holes": 0.5}},
        {"instance": 2},
        {"frames": 30},
        {},
        {"seed": 1},
    ]
    runs = read(
        tmp_path, *(result(replace(FIRST, **change), 1.0) for change in changes)
    )
    assert runs.instances == (
        "walk, view 45°, instance 0 (frames 30)",
        "walk, view 45°, instance 0 (frames 60)",
        "walk, view 45°, instance 2",
        "walk, view 45°, holes 0.5, instance 0",
    )
    assert np.bincount(runs.instance).tolist() == [1, 2, 1, 1]


def test_the_order_follows_the_specs_and_not_the_order_in_which_cells_finish(
    tmp_path: Path,
) -> None:
    made = results_of(full({"a": 1.0, "b": 1.0}, instances=3))
    runs = read(tmp_path / "a", *made)
    mixed = read(tmp_path / "b", *random.Random(0).sample(made, len(made)))
    assert runs.keys.tolist() == mixed.keys.tolist()
    assert (runs.scores == mixed.scores).all()


def test_a_row_without_a_figure_has_nan(tmp_path: Path) -> None:
    skill = {"mean_pose": None, "persistence": 0.5, "nearest": 0.25}
    empty = {"evaluations": [], "cost": []}
    runs = read(
        tmp_path,
        result(
            FIRST,
            1.0,
            error_degrees=None,
            skill=skill,
            baselines_degrees=None,
            trace=empty,
        ),
    )
    assert {name for name in TRACKS.columns if np.isnan(runs.figures[name][0])} == {
        "error_with_losses_degrees", "error_degrees.mean", "skill.mean_pose", "unknown_rate",
        *(f"baselines_degrees.{name}" for name in ("mean_pose", "persistence", "nearest")),
        *(f"{kind}.{level}" for kind in ("coverage", "interval_mm") for level in (50, 80, 95)),
    }  # fmt: skip
    names = ("skill.nearest", "evaluations_used", "seconds_per_frame")
    figures = [runs.figures[name].item() for name in names]
    assert figures == [0.25, FIRST.evaluations * FIRST.frames, 0.01]
    assert len(runs.data["traces"][0][0]) == 0


def test_seeds_of_any_size_keep_every_digit(tmp_path: Path) -> None:
    runs = read(
        tmp_path,
        *(result(replace(FIRST, seed=seed), 1.0) for seed in (2**70 + 1, 2**70)),
    )
    assert [runs.seeds[k] for k in runs.seed] == [2**70, 2**70 + 1]


def test_reports_of_some_methods_name_them_as_the_report_of_all_does(
    tmp_path: Path,
) -> None:
    made = [
        result(SAPSO, 3.0),
        result(COOLER, 2.0),
        result(FIRST, 1.0),
        result(replace(FIRST, instance=5), 1.0),
    ]
    path = ledger(tmp_path / "results", made, [(replace(SAPSO, seed=9), ["no"])])
    both = ("sapso@pca (cooling 0.9)", "sapso@pca")
    runs = runs_in(path, "sapso@pca")
    assert runs.methods == both
    assert runs.failed == {"sapso@pca": 1}
    assert runs.instances == ("walk, view 45°, instance 0",)
    assert runs_in(path, both[0]).methods == both[:1]
    assert len(runs_in(path, both[0]).failures) == 0
    everything = runs_in(path)
    some = runs_in(path, "sapso@pca", "random@pca")
    assert some.methods == everything.methods
    assert some.keys.tolist() == everything.keys.tolist()
    with pytest.raises(ValueError, match="got 'sapso'; did you mean 'sapso@pca'"):
        runs_in(path, "sapso")


def test_the_installed_version_counts_or_else_the_latest(tmp_path: Path) -> None:
    def of(version: str, seed: int = 0, **more: Any) -> dict[str, Any]:
        return result(replace(FIRST, version=version, seed=seed, **more), 1.0)

    old, older = "posefit 0.0.2 bb", "posefit 0.0.1 aa"
    now = FIRST.version
    runs = runs_in(ledger(tmp_path / "a", [of(now), of(older), of(old)]), latest=True)
    assert (runs.methods, runs.values("version")) == (("random@pca",), [now])
    runs = runs_in(ledger(tmp_path / "b", [of(older), of(old, 1)]), latest=True)
    assert (runs.values("version"), runs.seeds) == ([old], (1,))
    # another setting is another method
    warm = {"settings": {"pca.components": 4}}
    runs = runs_in(ledger(tmp_path / "c", [of(older, **warm), of(now)]), latest=True)
    assert len(runs.methods) == 2
    assert len(runs_in(tmp_path / "a").methods) == 3
