"""posefit's own measurements, by their commands: what they print, and what they say of a mistake."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result

import posefit
from posefit.cli import main
from posefit_experiments import accuracy, builds, degradation, methods, views

NAMES = ("sapso", "vsmm", "accuracy", "methods", "views", "degradation", "builds", "footage", "composites", "modes")
METHODS_OF_MODES = [word for name in ("known", "library", "cma*2", "annealed", "ribs") for word in ("--method", name)]


def run(*words: object, cmu: str = "") -> Result:
    return CliRunner(env={"POSEFIT_CMU": cmu}).invoke(main, ["reproduce", *map(str, words)])


def told(*words: object, cmu: str = "") -> dict[str, Any]:
    result = run(*words, "--json", cmu=cmu)
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    return found


def test_every_experiment_has_help_and_is_listed() -> None:
    listed = run("--help")
    for name in NAMES:
        assert f"\n  {name} " in listed.stdout
        assert run(name, "--help").exit_code == 0


def test_describing_the_commands_imports_none_of_the_experiments() -> None:
    code = "import sys, posefit_experiments.commands; print(*sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    own = {name.split(".")[1] for name in found if name.startswith("posefit_experiments.")}
    assert own == {"commands"}
    assert "numpy" not in found


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("accuracy",),
            "clips must be a folder of CMU clips such as 16/16_17.amc, by --clips or POSEFIT_CMU, got none",
        ),
        (("methods", "--clips", "nowhere"), "clips must be a folder of CMU clips such as 16/16_17.amc, got nowhere"),
        (("accuracy", "--seeds", "0"), "seeds must be at least 1, got 0"),
        (("views", "--seeds", "0"), "seeds must be at least 1, got 0"),
        (("views", "--workers", "0"), "workers must be at least 1, got 0"),
        (("degradation", "--seeds", "-1"), "seeds must be at least 1, got -1"),
        (("builds", "--subjects", "0"), "subjects must be at least 1, got 0"),
        (("builds", "--motion", "fly"), "motion must be one of"),
        (("footage", "no.mp4", "--roi", "1,2,3"), "expected X,Y,WIDTH,HEIGHT in pixels"),
        (("footage", "no.mp4"), "Missing option '--roi'"),
        (("footage", "no.mp4", "--roi", "0,0,9,9"), "posefit: no.mp4"),
        (("degradation", "--optimiser", "spaso"), "did you mean 'sapso'"),
        (("footage", "no.mp4", "--roi", "0,0,9,9", "--frames", "5"), "expected A:B"),
        (("vsmm", "--workers", "0"), "workers must be at least 1, got 0"),
        (("modes", "--instances", "0"), "instances must lie in 1 to 10000, got 0"),
        (("modes", "--evaluations", "0"), "evaluations must be at least 1, got 0"),
        (("modes", "--method", "cma*0"), "a method must be an optimiser such as cma, or cma*16"),
        (("modes", "--method", "known*2"), "a method must be an optimiser to be made several times"),
        (("modes", "--method", "spaso"), "did you mean 'sapso'"),
    ],
)
def test_a_mistake_is_one_line_and_status_2(words: tuple[str, ...], said: str) -> None:
    result = run(*words)
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    (line,) = result.stderr.splitlines()
    assert line.startswith("posefit: ")
    assert said in line


def test_accuracy_is_that_of_the_tracks_of_all_seeds(
    cmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(accuracy, "FRAMES", 3)
    monkeypatch.setattr(accuracy, "VIEWS", (45.0,))
    monkeypatch.setattr(accuracy, "WALKS", accuracy.WALKS[:1])
    ledger = tmp_path / "ledger"
    found = told("accuracy", "--seeds", 3, "--workers", 1, "--ledger", ledger, cmu=str(cmu))
    tracks = [
        posefit.track(
            cmu / "16" / "16_17.amc",
            train=[cmu / "16" / "16_15.amc"],
            prior="pca",
            view_degrees=45.0,
            frames=(0, 3),
            seed=seed,
        ).summary
        for seed in range(3)
    ]
    (row,) = found["rows"]
    errors = [one["error_degrees"]["mean"] for one in tracks]
    assert row["error_degrees"] == np.median(errors)
    assert row["worst_degrees"] == max(errors)
    assert row["mpjpe_mm"] == np.median([one["mpjpe_mm"] for one in tracks])
    assert row["baselines_degrees"] == tracks[0]["baselines_degrees"]
    again = run("accuracy", "--seeds", 3, "--ledger", ledger, "--clips", cmu)
    assert again.exit_code == 0
    assert "3 of 3 cells are done already" in again.stderr
    assert again.stdout.splitlines()[2].startswith(f"| 16_15 | 16_17 | 45 | {row['error_degrees']:.2f} |")
    page = tmp_path / "page.html"
    assert CliRunner().invoke(main, ["report", str(ledger), "--out", str(page)]).exit_code == 0
    assert page.stat().st_size > 0


def test_accuracy_of_several_tracks_is_that_of_those_that_are_kept(cmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(accuracy, "FRAMES", 3)
    monkeypatch.setattr(accuracy, "VIEWS", (90.0,))
    monkeypatch.setattr(accuracy, "WALKS", accuracy.WALKS[:1])
    found = told("accuracy", "--seeds", 1, "--tracks", 2, cmu=str(cmu))
    kept = posefit.track(
        cmu / "16" / "16_17.amc", train=[cmu / "16" / "16_15.amc"], view_degrees=90.0, frames=(0, 3), tracks=2
    )
    assert found["tracks"] == 2
    assert found["rows"][0]["mpjpe_mm"] == kept.measures.mpjpe_mm
    wrong = run("accuracy", "--tracks", 0, cmu=str(cmu))
    assert (wrong.exit_code, wrong.stderr) == (2, "posefit: tracks must be a whole number of at least 1, got 0\n")


def test_methods_are_compared_at_one_budget(cmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(methods, "FRAMES", 2)
    monkeypatch.setattr(methods, "VIEWS", (0.0, 90.0))
    monkeypatch.setattr(methods, "OPTIMISERS", ("sapso",))
    result = run("methods", "--seeds", 1, "--workers", 1, "--first-pose", "given", "--clips", cmu, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    assert [row["prior"] for row in found["rows"]] == list(methods.PRIORS)
    assert {row["evaluations"] for row in found["rows"]} == {2440.0}
    one = found["rows"][0]["walk"]
    assert one["error_degrees"] == pytest.approx(np.mean(one["by_view_degrees"]))  # one seed: the mean over views
    assert found["motions"]["run"]["frames"] == 2
    lines = list(methods.methods_lines(found))
    assert len(lines) == 2 + 3 + 2
    assert len({line.count("|") for line in lines[:5]}) == 1
    assert "first_pose must be one of searched, given" in run("methods", "--first-pose", "x", "--clips", cmu).stderr


def test_views_say_what_each_number_of_cameras_reaches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(views, "MOTIONS", ("walk",))
    monkeypatch.setattr(views, "VIEWS", ((90.0,),))
    monkeypatch.setattr(views, "RESTARTS", 1)
    found = told("views", "--seeds", 1)
    (row,) = found["rows"]
    assert (row["motion"], row["views_degrees"]) == ("walk", [90.0])
    assert 0.0 < row["error_degrees"] == row["least_degrees"] == row["worst_degrees"]
    (line,) = views.views_lines(found)
    assert line.startswith(f"walk     1 views  error {row['error_degrees']:5.2f} degrees (")


def test_damage_makes_tracks_worse_and_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(degradation, "KINDS", ("dropped frames",))
    monkeypatch.setattr(degradation, "STRENGTHS", (0.0, 1.0))
    out = tmp_path / "damage.png"
    result = run("degradation", "--seeds", 1, "--workers", 1, "--out", out, "--json")
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    ((none,), (all_,)) = found["kinds"]["dropped frames"]
    assert none["error_degrees"] < all_["error_degrees"]
    assert out.read_bytes().startswith(b"\x89PNG")
    assert [line[17:21] for line in degradation.degradation_lines(found)][:2] == ["0.00", "1.00"]
    assert "got one that exists" in run("degradation", "--out", out).stderr


def test_builds_say_how_far_parts_are_off(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(builds, "SETUPS", builds.SETUPS[:1])
    found = told("builds", "--subjects", 1)
    parts = found["percent_off"]["1 view, stature given"]
    assert set(parts) == {"fitted", "average"}
    # the stature was given, and a part of one subject is off by its mean
    assert parts["fitted"]["stature"]["most"] < 1.0
    assert all(one["mean"] == one["most"] for one in parts["average"].values())
    lines = list(builds.builds_lines(found))
    assert [line[:31] for line in lines] == ["1 view, stature given  fitted  ", "1 view, stature given  average "]


def test_modes_are_scored_by_method_and_the_known_ones_are_all_found() -> None:
    found = told("modes", "--instances", 2, "--evaluations", 400, "--workers", 1, *METHODS_OF_MODES)
    rows = {one["method"]: one for one in found["methods"]}
    assert list(rows) == ["known", "library", "cma*2", "annealed", "ribs"]
    assert rows["known"]["peak_ratio"] == [1.0, 1.0, 1.0]
    assert all(0.0 <= ratio <= 1.0 for one in rows.values() for ratio in one["peak_ratio"])
    assert all(one["reported"] <= 10.0 for one in rows.values())
    assert {row["instance"] for row in found["rows"]} == {10_000, 10_001}
    again = told("modes", "--instances", 2, "--evaluations", 400, "--workers", 1, *METHODS_OF_MODES)
    assert again == found
