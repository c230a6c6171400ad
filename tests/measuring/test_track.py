"""The gait that a track writes and prints, and the lengths of bones in its files."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.geometry.skeleton import JOINTS, PARENTS
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import gait_of
from posefit.tracking.table import gait_line, table

TENTH = 1e-4  # metres


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


def test_bones_have_one_length_in_every_file_of_a_track(tracked: posefit.Track, out: Path) -> None:
    expected = tracked.motion.skeleton.lengths
    ends, starts = slice(1, None), list(PARENTS[1:])
    with (out / "frames.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    table_points = np.array([[[float(row[f"{place}_{axis}"]) for axis in "xyz"] for place in PLACES] for row in rows])
    lines = (out / "track.trc").read_text().splitlines()[6:]
    markers = np.array([[float(value) for value in line.split("\t")[2:]] for line in lines]).reshape(-1, len(JOINTS), 3)
    data = np.frombuffer((out / "track.c3d").read_bytes(), "<f4")
    whole = len(rows) * len(JOINTS) * 4
    start = 128 * (int.from_bytes((out / "track.c3d").read_bytes()[16:18], "little") - 1)  # of 512 bytes, 4 a number
    marked = data[start : start + whole].reshape(len(rows), len(JOINTS), 4)[:, :, :3] / 1e3
    for points in (table_points, markers, marked):
        lengths = np.linalg.norm(points[:, ends] - points[:, starts], axis=2)
        np.testing.assert_allclose(lengths, np.tile(expected, (len(rows), 1)), atol=TENTH)
