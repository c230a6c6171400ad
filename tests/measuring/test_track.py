"""What a track writes and prints for people who measure."""

import csv
import json
from pathlib import Path

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


def test_a_track_of_a_walk_says_its_gait(tracked: posefit.Track, out: Path) -> None:
    told = json.loads((out / "summary.json").read_text())["gait"]
    assert told == tracked.summary["gait"]
    assert told["walk"] is True
    true = gait_of(tracked.truth)  # type: ignore[arg-type]
    assert told["cadence"] == pytest.approx(true.cadence, abs=3.0)
    assert told["speed"] == pytest.approx(true.speed, abs=0.05)
    assert gait_line(told) in table(tracked.summary).splitlines()
    assert gait_line(told).startswith(f"gait: {told['cadence']:.0f} steps a minute, step ")
    with (out / "gait.csv").open(newline="") as file:
        steps = list(csv.DictReader(file))
    assert sum(step["step_seconds"] != "" for step in steps) == told["steps"]


def test_a_track_of_no_walk_says_so() -> None:
    summary = posefit.track("jacks", size=(80, 60), population_size=10, iterations=2, frames=(0, 20)).summary
    assert summary["gait"]["walk"] is False
    assert "no figures of gait: no strikes of a foot detected" in table(summary).splitlines()


def test_a_single_frame_is_not_asked_for_a_gait() -> None:
    summary = posefit.fit("walk", size=(80, 60), population_size=10, iterations=2).summary
    assert "gait" not in table(summary)


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
