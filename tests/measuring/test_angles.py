"""Clinical angles of whole bodies: zero where a person stands, one sign for both sides; and files for other programs."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.geometry.skeleton import ANGLES, JOINTS
from posefit.geometry.symmetry import mirrored_poses
from posefit.measuring.angles import COLUMNS, NEAR_POLE, clinical_angles
from posefit.measuring.c3d import MAX_EVENTS, write_c3d
from posefit.measuring.centres import CENTRES, PLACES, joint_centres
from posefit.measuring.gait import Gait, Step, gait_of
from posefit.measuring.tables import STEP_COLUMNS, write_angles, write_gait, write_trc
from posefit.motion import built_in, recorded
from posefit.motion.amc import write_amc
from posefit.motion.bvh import NAMES, write_bvh
from posefit.motion.motion import Motion
from posefit.motion.opensim import write_mot
from tests.cases import each
from tests.files import csv_rows
from tests.measuring.walker import angle

SKELETON = built_in.motion("walk", frames=1).skeleton


def measured(**turned: float) -> dict[str, float]:
    """Return the angles of the pose of rest with some angles, such as lfemur_x, set in degrees."""
    pose = np.zeros((1, ANGLES))
    for name, degrees in turned.items():
        pose[0, angle(*name.split("_"))] = np.radians(degrees)
    return {
        name: float(values[0])
        for name, values in clinical_angles(SKELETON, pose).items()
    }


def test_the_centres_are_where_bones_meet() -> None:
    motion = built_in.motion("walk", frames=3)
    centres = joint_centres(motion)
    assert tuple(centres) == CENTRES
    np.testing.assert_array_equal(
        centres["left_knee"], motion.joints[:, JOINTS.index("lfemur")]
    )
    assert len(set(PLACES)) == len(JOINTS)
    assert PLACES[JOINTS.index("lowerback")] == "lumbar"  # not of the left side


@each(("side", "inwards"), [("left", -20.0), ("right", 20.0)])
def test_a_straight_leg_has_zero_angles_and_moves_in_clinical_directions(
    side: str, inwards: float
) -> None:
    def leg(**turned: float) -> dict[str, float]:
        angles = measured(
            **{f"{side[0]}{name}": value for name, value in turned.items()}
        )
        return {
            name.removeprefix(f"{side}_"): round(value, 2)
            for name, value in angles.items()
            if name.startswith(side)
            and not abs(value) <= 1e-3
            and "shoulder" not in name
            and "elbow" not in name
        }

    # the legs of the pose of rest are apart by 20 degrees each
    assert leg(femur_z=inwards) == {}
    assert leg(femur_z=inwards, femur_x=-30.0) == {"hip_flexion": 30.0}
    assert leg(femur_z=inwards, tibia_x=60.0) == {"knee_flexion": 60.0}
    assert leg(femur_z=inwards, foot_x=-15.0) == {"ankle_dorsiflexion": 15.0}
    assert leg() == {"hip_adduction": -20.0}
    assert leg(femur_z=1.5 * inwards) == {"hip_adduction": 10.0}


@each("side", ["left", "right"])
def test_arms_at_rest_are_out_with_the_palms_down(side: str) -> None:
    rest = measured()
    assert rest[f"{side}_shoulder_plane"] == pytest.approx(0.0, abs=1e-6)
    assert rest[f"{side}_shoulder_elevation"] == pytest.approx(90.0)
    # the elbow's hinge is 30 degrees up from bending straight forwards, and the thumb points forwards
    assert rest[f"{side}_shoulder_internal_rotation"] == pytest.approx(-30.0)
    assert rest[f"{side}_elbow_flexion"] == pytest.approx(0.0, abs=1e-6)
    assert rest[f"{side}_elbow_pronation"] == pytest.approx(120.0)
    bent = measured(**{f"{side[0]}radius_x": 70.0})
    assert bent[f"{side}_elbow_flexion"] == pytest.approx(70.0)
    assert bent[f"{side}_elbow_adduction"] == pytest.approx(0.0, abs=1e-6)
    assert bent[f"{side}_elbow_pronation"] == pytest.approx(120.0)


def test_a_shoulder_near_its_pole_is_left_blank() -> None:
    # an arm that hangs, but for so many degrees
    for elevation, blank in ((3.0, True), (9.9, True), (10.1, False), (45.0, False)):
        angles = measured(lhumerus_z=0.0, lclavicle_z=-(90.0 - elevation))
        assert angles["left_shoulder_elevation"] == pytest.approx(elevation)
        assert np.isnan(angles["left_shoulder_plane"]) == blank
        assert np.isnan(angles["left_shoulder_internal_rotation"]) == blank


def test_a_mirrored_body_has_the_other_sides_angles_at_any_yaw() -> None:
    # the skeleton is the same on both sides
    poses = recorded.clip("02_01").motion().poses
    angles = clinical_angles(SKELETON, poses)
    mirrored = clinical_angles(SKELETON, mirrored_poses(SKELETON, poses))
    turned = clinical_angles(SKELETON, poses + 2.0 * np.eye(66)[0])
    for name, values in angles.items():
        side, _, angle_name = name.partition("_")
        exchanged = mirrored[f"{'right' if side == 'left' else 'left'}_{angle_name}"]
        np.testing.assert_allclose(exchanged, values, atol=1e-6, err_msg=name)
        np.testing.assert_allclose(turned[name], values, atol=1e-6, err_msg=name)


def test_the_knee_of_a_walk_bends_as_published() -> None:
    # Perry and Burnfield, Gait analysis, 2010: about 60 degrees in swing, about 20 in loading; hip 20 back, 25 forwards
    motion = recorded.clip("02_01").motion()
    angles = clinical_angles(motion.skeleton, motion.poses)
    for joint, low, high in (
        ("knee_flexion", (-5.0, 15.0), (50.0, 75.0)),
        ("hip_flexion", (-30.0, -5.0), (20.0, 40.0)),
        ("ankle_dorsiflexion", (-25.0, -5.0), (10.0, 25.0)),
    ):
        for side in ("left", "right"):
            values = angles[f"{side}_{joint}"]
            assert low[0] < values.min() < low[1]
            assert high[0] < values.max() < high[1]


TENTH = 1e-4  # metres
BLANK = {3, 4, 50}
NO_WALK = Gait(steps=[Step(foot="left", strike_seconds=1.0)], why="it is a dance")


@pytest.fixture(scope="module")
def walk() -> Motion:
    return recorded.clip("02_01").motion()


def read_c3d(path: Path) -> Any:
    return pytest.importorskip("ezc3d").c3d(str(path))


def test_another_reader_reads_the_same_c3d(walk: Motion, tmp_path: Path) -> None:
    write_c3d(tmp_path / "walk.c3d", walk, BLANK, gait_of(walk))
    read = read_c3d(tmp_path / "walk.c3d")
    points = read["data"]["points"]
    header = read["header"]["points"]
    parameters = {
        name: read["parameters"]["POINT"][name]["value"]
        for name in ("LABELS", "UNITS", "RATE")
    }
    assert parameters == {"LABELS": list(PLACES), "UNITS": ["mm"], "RATE": [30.0]}
    assert (header["frame_rate"], header["first_frame"], header["last_frame"]) == (
        30.0,
        0,
        len(walk) - 1,
    )
    metres = points[:3].transpose(2, 1, 0) / 1e3
    known = np.array([k not in BLANK for k in range(len(walk))])
    np.testing.assert_allclose(metres[known], walk.joints[known], atol=TENTH)
    assert np.isnan(metres[~known]).all()
    residuals = read["data"]["meta_points"]["residuals"][0].T
    assert (residuals[known] == 0.0).all()
    assert (residuals[~known] == -1.0).all()


def test_a_c3d_has_the_events_of_gait(walk: Motion, tmp_path: Path) -> None:
    gait = gait_of(walk)
    write_c3d(tmp_path / "walk.c3d", walk, (), gait)
    read = read_c3d(tmp_path / "walk.c3d")["parameters"]["EVENT"]
    events = {name: read[name]["value"] for name in ("CONTEXTS", "LABELS", "TIMES")}
    strikes = [k for k, label in enumerate(events["LABELS"]) if label == "Foot Strike"]
    assert [events["CONTEXTS"][k] for k in strikes] == [
        "Right",
        "Left",
        "Right",
        "Left",
    ]
    seconds = [step.strike_seconds for step in gait.steps]
    assert events["TIMES"][1][strikes] == pytest.approx(seconds)
    assert (events["TIMES"][0] == 0.0).all()
    assert events["LABELS"].count("Foot Off") == sum(
        step.toe_off_seconds is not None for step in gait.steps
    )
    write_c3d(tmp_path / "dance.c3d", walk, (), NO_WALK)
    used = (
        read_c3d(tmp_path / "dance.c3d")["parameters"]
        .get("EVENT", {})
        .get("USED", {"value": [0]})
    )
    assert used["value"][0] == 0


def test_a_long_c3d_counts_its_frames_and_its_events(
    walk: Motion, tmp_path: Path
) -> None:
    many = np.arange(70_000) % len(walk)
    longer = Motion(
        "long", walk.skeleton, walk.poses[many], walk.translations[many], 30.0
    )
    gait = Gait(
        steps=[Step(foot="left", strike_seconds=float(k)) for k in range(2_000)]
    )
    write_c3d(tmp_path / "long.c3d", longer, (), gait)
    read = read_c3d(tmp_path / "long.c3d")
    assert read["data"]["points"].shape[2] == 70_000
    times = read["parameters"]["EVENT"]["TIMES"]["value"]
    assert times.shape == (2, MAX_EVENTS)
    assert (times[0, -1], times[1, -1]) == (4.0, 14.0)  # the 255th is after 254 seconds


def test_a_plain_reader_reads_the_same_trc(walk: Motion, tmp_path: Path) -> None:
    write_trc(tmp_path / "walk.trc", walk, BLANK)
    lines = (tmp_path / "walk.trc").read_text().splitlines()
    assert (
        dict(zip(lines[1].split("\t"), lines[2].split("\t"), strict=True))["NumMarkers"]
        == "27"
    )
    assert lines[3].split() == ["Frame#", "Time", *PLACES]
    table = np.genfromtxt(lines[6:], delimiter="\t")
    known = np.setdiff1d(np.arange(len(walk)), [*BLANK])
    expected = walk.joints.reshape(len(walk), -1)[known]
    np.testing.assert_array_equal(table[:, 0], known + 1)
    np.testing.assert_allclose(table[:, 1], known / 30.0, atol=1e-6)
    np.testing.assert_allclose(table[:, 2:], expected, atol=TENTH)


def test_another_reader_reads_the_same_bvh(walk: Motion, tmp_path: Path) -> None:
    pybvh = pytest.importorskip("pybvh")
    write_bvh(tmp_path / "walk.bvh", walk)
    read = pybvh.read_bvh_file(tmp_path / "walk.bvh", world_up="+y")
    nodes = read.node_positions()  # its own forward kinematics
    points = np.empty((len(walk), len(JOINTS), 3))
    points[:, 0] = nodes[:, 0]
    for joint, name in enumerate(JOINTS[1:], 1):
        # begins where the bone begins
        node = next(one for one in read.nodes if one.name == NAMES[name])
        points[:, joint] = nodes[:, read.node_index[node.children[0].name]]
    np.testing.assert_allclose(points, walk.joints, atol=TENTH)


def test_angles_are_written_in_degrees_and_blank_if_unknown(
    walk: Motion, tmp_path: Path
) -> None:
    write_angles(tmp_path / "angles.csv", walk, BLANK)
    table = np.genfromtxt(tmp_path / "angles.csv", delimiter=",", names=True)
    count = len(walk)
    assert table.dtype.names == ("frame", "seconds", *COLUMNS)
    np.testing.assert_array_equal(table["frame"], np.arange(count))
    np.testing.assert_allclose(table["seconds"], np.arange(count) / 30.0, atol=1e-6)
    blank = np.isin(np.arange(count), [*BLANK])
    for name, values in clinical_angles(walk.skeleton, walk.poses).items():
        np.testing.assert_allclose(
            table[name], np.where(blank, np.nan, values), atol=1e-3
        )


def test_angles_of_recorded_people_do_not_jump() -> None:
    """35 of the 216 clips had jumps of a whole turn, such as of a forearm that turns past half of one."""
    for clip in recorded.clips():
        motion = clip.motion()
        for name, values in clinical_angles(motion.skeleton, motion.poses).items():
            known = values[np.isfinite(values)]
            assert np.abs(np.diff(known)).max(initial=0.0) <= 180.0, (clip.name, name)
            assert (
                -180.0 <= np.median(known) <= 180.0
                if len(known)
                else name.split("_")[1] == "shoulder"
            )


def test_a_whole_turn_of_a_joint_is_one_angle_that_grows() -> None:
    poses = np.zeros((73, ANGLES))
    # 5 degrees a frame
    poses[:, angle("lwrist", "y")] = np.radians(np.linspace(-170.0, 190.0, 73))
    turned = clinical_angles(SKELETON, poses)["left_elbow_pronation"]
    assert np.abs(np.diff(turned)) == pytest.approx(np.full(72, 5.0), abs=1e-6)
    poses = np.zeros((61, ANGLES))
    # a leg out to the side, past its pole
    poses[:, angle("lfemur", "z")] = np.radians(np.linspace(20.0, 140.0, 61))
    angles = clinical_angles(SKELETON, poses)
    adduction = angles["left_hip_adduction"]
    flexion = angles["left_hip_flexion"]
    near = np.abs(np.abs(adduction) - 90.0) < NEAR_POLE
    assert near.any()
    np.testing.assert_array_equal(np.isnan(flexion), near)
    np.testing.assert_array_equal(np.isnan(angles["left_hip_internal_rotation"]), near)


def test_a_part_of_a_motion_keeps_its_frame_numbers_and_times(
    walk: Motion, tmp_path: Path
) -> None:
    part = walk.frames(20, 80)
    gait = gait_of(part)
    write_angles(tmp_path / "a.csv", part)
    write_trc(tmp_path / "a.trc", part)
    write_c3d(tmp_path / "a.c3d", part, (), gait)
    write_mot(tmp_path / "a.mot", part)
    write_amc(tmp_path / "a.amc", part)
    rows = csv_rows(tmp_path / "a.csv")
    assert (rows[0]["frame"], rows[-1]["frame"]) == ("20", "79")
    assert float(rows[0]["seconds"]) == pytest.approx(20 / 30.0, abs=1e-6)
    lines = [line.split("\t") for line in (tmp_path / "a.trc").read_text().splitlines()]
    assert dict(zip(lines[1], lines[2], strict=True))["OrigDataStartFrame"] == "21"
    assert (lines[6][0], float(lines[6][1])) == (
        "21",
        pytest.approx(20 / 30.0, abs=1e-6),
    )
    read = read_c3d(tmp_path / "a.c3d")
    assert [
        read["header"]["points"][name] for name in ("first_frame", "last_frame")
    ] == [20, 79]
    assert read["data"]["points"].shape[2] == 60
    assert gait.steps[0].strike_seconds > 20 / 30.0
    assert read["parameters"]["EVENT"]["TIMES"]["value"][1].min() > 20 / 30.0
    table = (tmp_path / "a.mot").read_text().split("endheader\n")[1].splitlines()
    assert float(table[1].split("\t")[0]) == pytest.approx(20 / 30.0, abs=1e-6)
    assert (tmp_path / "a.amc").read_text().splitlines()[3] == "21"
    assert walk.frames(20, 80).frames(5, 10).first == 25


def test_each_step_has_a_row(walk: Motion, tmp_path: Path) -> None:
    gait = gait_of(walk)
    write_gait(tmp_path / "gait.csv", gait)
    rows = csv_rows(tmp_path / "gait.csv")
    assert list(rows[0]) == list(STEP_COLUMNS)
    assert [row["foot"] for row in rows] == ["right", "left", "right", "left"]
    assert rows[0]["step_length"] == ""  # it is unknown where it came from
    assert float(rows[1]["step_length"]) == pytest.approx(
        gait.steps[1].step_length, abs=1e-6
    )
    assert float(rows[1]["strike_seconds"]) == pytest.approx(
        gait.steps[1].strike_seconds, abs=1e-6
    )
    write_gait(tmp_path / "dance.csv", NO_WALK)
    assert csv_rows(tmp_path / "dance.csv") == []
