"""Every study can be started, every plan beside them is one, and the table of rows is right."""

import importlib
import os
from pathlib import Path

import click
import pytest
from click.testing import CliRunner

from posefit.sweep.plan import Plan
from tests.docs.pages import DOCS

STUDIES = DOCS / "studies"


def test_every_study_starts_and_is_named_by_a_page() -> None:
    pages = "".join(path.read_text("utf-8") for path in DOCS.rglob("*.md"))
    for path in sorted(STUDIES.glob("*.py")):
        study = importlib.import_module(path.stem)
        if isinstance(getattr(study, "main", None), click.Command):
            result = CliRunner().invoke(study.main, ["--help"])
            assert result.exit_code == 0, path.name
            assert f"docs/studies/{path.name}" in pages, path.name
    for path in sorted(STUDIES.glob("*.toml")):
        assert f"docs/studies/{path.name}" in pages, path.name


def test_plans_of_built_in_motions_are_plans() -> None:
    assert [len(Plan.read(STUDIES / f"{name}.toml")) for name in ("views", "degradation")] == [45, 45]


def test_plans_of_recorded_clips_are_plans(cmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(cmu)
    assert [len(Plan.read(STUDIES / f"{name}.toml")) for name in ("accuracy", "methods")] == [90, 450]


def test_the_table_of_a_plan_has_a_line_a_group(tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    plan.write_text(
        '[defaults]\nframes = 2\nevaluations = 80\n[product]\nmethods = ["random@pca"]\nmotions = ["walk"]\n'
        "corruptions = [{}, { holes = 0.5 }]\nseeds = 2\n"
    )
    table = importlib.import_module("table")
    before = Path.cwd()
    words = [str(plan), "--by", "method", "--by", "corruption", "--workers", "1"]
    result = CliRunner(env={"POSEFIT_CMU": ""}).invoke(table.main, words)
    os.chdir(before)
    assert result.exit_code == 0, result.output
    lines = [line for line in result.stdout.splitlines() if line.startswith("|")]
    assert [line.split(" | ")[:3] for line in lines[2:]] == [
        ["| random@pca", "-", "2"],
        ["| random@pca", "holes 0.5", "2"],
    ]


def test_rows_are_written_as_they_come_and_read_again(tmp_path: Path) -> None:
    table, path = importlib.import_module("table"), str(tmp_path / "rows.jsonl")
    rows = {name: {"name": name, "cost": cost} for name, cost in (("one", 1.5), ("other", 2.5))}
    assert table.earlier(path, lambda row: row["name"]) == {}
    coming = table.kept(path, iter(rows.items()), 2)
    assert next(coming) == ("one", rows["one"])
    assert table.earlier(path, lambda row: row["name"]) == {"one": rows["one"]}
    assert list(coming) == [("other", rows["other"])]
    assert table.earlier(path, lambda row: row["name"]) == rows


def test_an_interval_holds_the_median() -> None:
    import numpy as np

    table = importlib.import_module("table")
    values = np.array([1.0, 2.0, 3.0, 4.0, 5.0])
    low, high = table.interval(values, "abcde")
    assert 1.0 <= low <= 3.0 <= high <= 5.0
    assert table.interval(values, "aaaaa") == (3.0, 3.0)


def test_the_models_ridge_is_in_normalised_units_with_an_offset_towards_a_target() -> None:  # Interpretation V5
    import numpy as np

    rng, models = np.random.default_rng(1), importlib.import_module("make_models")
    before = np.column_stack([np.zeros((90, 3)), rng.normal(0.0, 0.3, (90, 40))])
    after = before + rng.normal(0.0, 0.05, before.shape)
    inputs, target = before[:, 3:], 0.1 * rng.normal(size=(43, 40))
    matrix, offset = models.normalised_ridge(before, after, target, 0.15)
    unit = np.sqrt(inputs.var(axis=0).sum() / 10.0)
    scaled = (inputs - inputs.mean(axis=0)) / unit
    wanted = after - before - inputs @ target.T
    wanted[:, [0, 2]] = 0.0  # the way over the ground
    rows = np.vstack([scaled, np.sqrt(0.15 * len(scaled)) * np.eye(40)])
    outputs = np.vstack([wanted - wanted.mean(axis=0), np.zeros((40, 43))])
    flow = np.linalg.lstsq(rows, outputs, rcond=None)[0]
    assert np.allclose(matrix, flow.T / unit + target)
    assert np.allclose(inputs @ (matrix - target).T + offset, scaled @ flow + wanted.mean(axis=0))
