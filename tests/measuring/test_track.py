"""The gait that a track writes and prints, and the lengths of bones in its files."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest

import posefit
from posefit.measuring.gait import gait_of
from posefit.tracking.table import gait_line, table


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("track") / "out"


@pytest.fixture(scope="module")
def tracked(out: Path) -> posefit.Track:
    return posefit.track("walk", size=(160, 120), out=out)


def test_a_track_of_a_walk_has_its_gait(tracked: posefit.Track, out: Path) -> None:
    gait = json.loads((out / "summary.json").read_text())["gait"]
    assert gait == tracked.summary["gait"]
    assert gait["walk"] is True
    assert tracked.truth is not None
    true = gait_of(tracked.truth)
    assert gait["cadence"] == pytest.approx(true.cadence, abs=3.0)
    assert gait["speed"] == pytest.approx(true.speed, abs=0.05)
    assert gait_line(gait) in table(tracked.summary).splitlines()
    assert gait_line(gait).startswith(f"gait: {gait['cadence']:.0f} steps a minute, step ")
    with (out / "gait.csv").open(newline="") as file:
        steps = list(csv.DictReader(file))
    assert sum(step["step_seconds"] != "" for step in steps) == gait["steps"]


def test_a_track_of_no_walk_reports_why_and_a_single_frame_nothing() -> None:
    quick: dict[str, Any] = {"size": (80, 60), "population_size": 10, "iterations": 2}
    summary = posefit.track("jacks", frames=(0, 20), **quick).summary
    assert summary["gait"]["walk"] is False
    assert "no figures of gait: no strikes of a foot detected" in table(summary).splitlines()
    assert "gait" not in table(posefit.fit("walk", **quick).summary)
