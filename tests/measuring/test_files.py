"""Files for other programs: read back by other readers, equal to 0.1 mm, with bones of one length."""

import csv
import importlib
import json
from pathlib import Path

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, PARENTS
from posefit.measuring.angles import COLUMNS, clinical_angles
from posefit.measuring.c3d import MAX_EVENTS, write_c3d
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait, Step, gait_of
from posefit.measuring.tables import STEP_COLUMNS, write_angles, write_gait, write_trc
from posefit.motion import recorded
from posefit.motion.bvh import write_bvh
from posefit.motion.motion import Motion

TENTH = 1e-4  # metres
BLANK = {3, 4, 50}
NO_WALK = Gait(steps=[Step(foot="left", strike_seconds=1.0)], why="it is a dance")


@pytest.fixture(scope="module")
def walk() -> Motion:
    return recorded.clip("02_01").motion()


def rigid(points: Array) -> bool:
    """Return whether every bone has one length in all frames, to 0.1 mm."""
    bones = points[:, 1:] - points[:, list(PARENTS[1:])]
    lengths = np.linalg.norm(bones, axis=2)
    return bool((np.nanmax(lengths, axis=0) - np.nanmin(lengths, axis=0) < TENTH).all())


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_c3d_is_what_another_reader_reads(walk: Motion, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    write_c3d(tmp_path / "walk.c3d", walk, BLANK, gait_of(walk))
    read = ezc3d.c3d(str(tmp_path / "walk.c3d"))
    points, expected = read["data"]["points"], walk.joints
    parameters = {name: read["parameters"]["POINT"][name]["value"] for name in ("LABELS", "UNITS", "RATE")}
    assert parameters == {"LABELS": list(PLACES), "UNITS": ["mm"], "RATE": [30.0]}
    assert read["header"]["points"]["frame_rate"] == 30.0
    assert (read["header"]["points"]["first_frame"], read["header"]["points"]["last_frame"]) == (0, len(walk) - 1)
    metres = points[:3].transpose(2, 1, 0) / 1e3
    known = np.array([k not in BLANK for k in range(len(walk))])
    np.testing.assert_allclose(metres[known], expected[known], atol=TENTH)
    assert np.isnan(metres[~known]).all()
    residuals = read["data"]["meta_points"]["residuals"][0].T
    assert (residuals[known] == 0.0).all()
    assert (residuals[~known] == -1.0).all()
    assert rigid(metres)


def test_a_c3d_has_the_events_of_gait(walk: Motion, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    gait = gait_of(walk)
    write_c3d(tmp_path / "walk.c3d", walk, (), gait)
    events = {
        name: ezc3d.c3d(str(tmp_path / "walk.c3d"))["parameters"]["EVENT"][name]["value"]
        for name in ("CONTEXTS", "LABELS", "TIMES")
    }
    strikes = [k for k, label in enumerate(events["LABELS"]) if label == "Foot Strike"]
    assert [events["CONTEXTS"][k] for k in strikes] == ["Right", "Left", "Right", "Left"]
    seconds = [step.strike_seconds for step in gait.steps]
    assert events["TIMES"][1][strikes] == pytest.approx(seconds)
    assert (events["TIMES"][0] == 0.0).all()
    assert events["LABELS"].count("Foot Off") == sum(step.toe_off_seconds is not None for step in gait.steps)
    write_c3d(tmp_path / "dance.c3d", walk, (), NO_WALK)
    used = ezc3d.c3d(str(tmp_path / "dance.c3d"))["parameters"].get("EVENT", {}).get("USED", {"value": [0]})
    assert used["value"][0] == 0


def test_a_long_c3d_counts_its_frames_and_its_events(walk: Motion, tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    many = np.arange(70_000) % len(walk)
    longer = Motion("long", walk.skeleton, walk.poses[many], walk.translations[many], 30.0)
    gait = Gait(steps=[Step(foot="left", strike_seconds=float(k)) for k in range(2_000)])
    write_c3d(tmp_path / "long.c3d", longer, (), gait)
    read = ezc3d.c3d(str(tmp_path / "long.c3d"))
    assert read["data"]["points"].shape[2] == 70_000
    times = read["parameters"]["EVENT"]["TIMES"]["value"]
    assert times.shape == (2, MAX_EVENTS)
    assert (times[0, -1], times[1, -1]) == (4.0, 14.0)  # the 255th is after 254 seconds


def test_a_trc_is_what_a_plain_reader_reads(walk: Motion, tmp_path: Path) -> None:
    write_trc(tmp_path / "walk.trc", walk, BLANK)
    lines = [line.split("\t") for line in (tmp_path / "walk.trc").read_text().split("\n")]
    assert dict(zip(lines[1], lines[2], strict=True))["NumMarkers"] == "27"
    names = [name for name in lines[3][2:] if name]
    assert names == list(PLACES)
    expected = walk.joints
    points = np.full(expected.shape, np.nan)
    for line in lines[6:]:
        if line == [""]:
            continue
        k = int(line[0]) - 1
        assert float(line[1]) == pytest.approx(k / 30.0, abs=1e-6)
        for column, value in enumerate(line[2:]):
            if value:
                points[k, column // 3, column % 3] = float(value)
    assert {int(k) for k in np.flatnonzero(np.isnan(points).all(axis=(1, 2)))} == BLANK
    known = [k for k in range(len(walk)) if k not in BLANK]
    np.testing.assert_allclose(points[known], expected[known], atol=TENTH)
    assert rigid(points)


def test_a_bvh_is_what_another_reader_reads(walk: Motion, tmp_path: Path) -> None:
    pybvh = pytest.importorskip("pybvh")
    write_bvh(tmp_path / "walk.bvh", walk)
    read = pybvh.read_bvh_file(tmp_path / "walk.bvh", world_up="+y")
    nodes = read.node_positions()  # its own forward kinematics
    points = np.empty((len(walk), len(JOINTS), 3))
    points[:, 0] = nodes[:, 0]
    named = importlib.import_module("posefit.motion.bvh").NAMES
    for joint, name in enumerate(JOINTS[1:], 1):
        node = next(one for one in read.nodes if one.name == named[name])  # begins where the bone begins
        points[:, joint] = nodes[:, read.node_index[node.children[0].name]]
    np.testing.assert_allclose(points, walk.joints, atol=TENTH)
    assert rigid(points)


def test_angles_are_written_in_degrees_and_blank_where_nobody_knows(walk: Motion, tmp_path: Path) -> None:
    write_angles(tmp_path / "angles.csv", walk, BLANK)
    rows, expected = rows_of(tmp_path / "angles.csv"), clinical_angles(walk.skeleton, walk.poses)
    assert list(rows[0]) == ["frame", "seconds", *COLUMNS]
    assert len(rows) == len(walk)
    for k, row in enumerate(rows):
        assert (row["frame"], float(row["seconds"])) == (str(k), pytest.approx(k / 30.0, abs=1e-6))
        for name in COLUMNS:
            written = float(row[name]) if row[name] else np.nan
            value = np.nan if k in BLANK else expected[name][k]
            assert written == pytest.approx(value, abs=1e-3, nan_ok=True)


def test_steps_are_written_one_a_row(walk: Motion, tmp_path: Path) -> None:
    gait = gait_of(walk)
    write_gait(tmp_path / "gait.csv", gait)
    rows = rows_of(tmp_path / "gait.csv")
    assert list(rows[0]) == list(STEP_COLUMNS)
    assert [row["foot"] for row in rows] == ["right", "left", "right", "left"]
    assert rows[0]["step_length"] == ""  # it is unknown where it came from
    assert float(rows[1]["step_length"]) == pytest.approx(gait.steps[1].step_length, abs=1e-6)
    assert float(rows[1]["strike_seconds"]) == pytest.approx(gait.steps[1].strike_seconds, abs=1e-6)
    write_gait(tmp_path / "dance.csv", NO_WALK)
    assert rows_of(tmp_path / "dance.csv") == []


def test_a_gait_is_json(walk: Motion) -> None:
    gait, none = (json.loads(json.dumps(each.as_dict())) for each in (gait_of(walk), NO_WALK))
    assert (gait["walk"], gait["why"], gait["steps"]) == (True, None, 3)
    names = ("cadence", "speed", "step_length", "stride_length", "step_width", "stance_share")
    assert none == {"walk": False, "why": "it is a dance", "steps": 0, **dict.fromkeys(names)}
