"""BVH files against forward kinematics done slowly from the file's own definition."""

import re
from pathlib import Path

import numpy as np
import pytest

from posefit import Body, Motion, Task, clinical_angles
from posefit.arrays import Array
from posefit.geometry.rotation import rotation_from_joint_angles, wrapped
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    ENDS,
    INNER,
    JOINTS,
    PARENTS,
    Skeleton,
)
from posefit.geometry.units import METRES, UNIT_NAMES, UNITS, Unit
from posefit.motion import built_in, bvh, recorded
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.bvh import NAMES, read_bvh, write_bvh
from posefit.motion.clips import load_motion, training_clips
from tests.cases import each
from tests.geometry.turns import about
from tests.motion.rigs import STYLES, Style, joint_after, places_of, write_rig

ACCLAIM = {name: joint for joint, name in NAMES.items()}


def any_motion(frames: int = 6) -> Motion:
    """Return a motion of random bones that turn at random; end bones do not turn by themselves."""
    rng = np.random.default_rng(5)
    free = tuple((JOINTS[joint], ("rx", "ry", "rz")) for joint in INNER)
    skeleton = Skeleton(
        "any",
        rng.normal(size=(len(BONES), 3)),
        np.tile(np.eye(3), (len(BONES), 1, 1)),
        free,
    )
    return Motion(
        "any",
        skeleton,
        rng.uniform(-1.4, 1.4, (frames, ANGLES)),
        rng.normal(size=(frames, 3)),
        120.0,
    )


# of each frame time as a file has it: the rate, and whether that is said
@each(
    ("written", "rate", "said"),
    [
        ("0.033333", 30.0, False),
        ("0.0333", 30.0, True),
        ("3.33e-2", 30.0, True),
        ("0.033", 30.0, True),
        ("0.0334", 30e3 / 1001.0, True),
        ("0.033367", 30e3 / 1001.0, False),
        ("0.0417", 24.0, True),
        ("0.04166", 24.0, True),
        ("0.01666", 60.0, True),
        ("0.0083", 120.0, True),
        ("0.008342", 120e3 / 1001.0, False),
        ("0.0041667", 240.0, False),
        ("0.004", 250.0, False),
        ("0.008", 125.0, False),
        ("0.0125", 80.0, False),
        ("0.0129", 1.0 / 0.0129, False),
        ("0.07", 1.0 / 0.07, False),
    ],
)
def test_a_rounded_frame_time_is_that_of_a_usual_rate(
    tmp_path: Path, written: str, rate: float, said: bool
) -> None:
    path = tmp_path / "x.bvh"
    write_bvh(path, any_motion())
    text = path.read_text().replace(
        f"Frame Time: {1 / 120!r}", f"Frame Time: {written}"
    )
    path.write_text(text)
    motion = read_bvh(path, unit="m")
    assert motion.fps == pytest.approx(rate)
    assert any("a second" in note for note in motion.notes) == said


@each(
    ("scale", "said"),
    [(1.0, ""), (np.pi / 180.0, "may be radians"), (1e-4, "")],
)
def test_angles_that_seem_to_be_radians_are_said(
    tmp_path: Path, scale: float, said: str
) -> None:
    path = tmp_path / "x.bvh"
    write_bvh(path, load_motion("walk").frames(0, 4))
    head, time, table = re.split(r"(Frame Time: .*\n)", path.read_text())
    rows = np.array([row.split() for row in table.splitlines()], dtype=float)
    rows[:, 3:] *= scale
    table = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    path.write_text(f"{head}{time}{table}\n")
    notes = " ".join(read_bvh(path).notes)
    assert ("radians" in notes) == bool(said)
    assert said in notes


@each("names", ["cgspeed", "acclaim"])
def test_joints_are_where_the_file_puts_them(tmp_path: Path, names: str) -> None:
    path = tmp_path / "x.bvh"
    names_in_file = dict(NAMES)
    write_bvh(path, any_motion())
    # as files state it
    text = path.read_text().replace(f"Frame Time: {1 / 120!r}", "Frame Time: 0.0083333")
    if names == "acclaim":
        names_in_file = {joint: joint for joint in JOINTS}
        text = re.sub(
            r"(ROOT|JOINT) (\w+)", lambda match: f"{match[1]} {ACCLAIM[match[2]]}", text
        )
    # as in the real files: a thumb hangs beside the hand
    hand = f"JOINT {names_in_file['lhand']}"
    text = text.replace(
        hand,
        f"JOINT LThumb\n{{\nOFFSET 0 0 0\nCHANNELS 0\nEnd Site\n{{\nOFFSET 1 1 1\n}}\n}}\n{hand}",
    )
    path.write_text(text)
    motion = read_bvh(path, unit="cm")
    places = places_of(path)
    assert (motion.name, len(motion), motion.fps) == ("x", 6, 120.0)
    # where a bone starts is the joint of its name, and its end is below
    for joint, parent in enumerate(PARENTS):
        name = names_in_file[JOINTS[joint]]
        starts = motion.joints[:, max(parent, 0)]
        np.testing.assert_allclose(starts, 0.01 * places[name], atol=1e-9)
        if joint in ENDS:
            np.testing.assert_allclose(
                motion.joints[:, joint], 0.01 * places[f"{name} end"], atol=1e-9
            )


@each(
    ("before", "after", "message"),
    [
        (
            "JOINT LeftLeg",
            "JOINT Knot",
            r"expected a BVH file with a person's joints, got a person without left shin",
        ),
        ("JOINT RightHand\n", "JOINT A\n", "got a person without right hand"),
        ("Frames: 6", "Frames: 7", "bvh:[0-9]+: expected 7 frames, got 6"),
        (
            f"Frame Time: {1 / 120!r}",
            "Frame Time: -1",
            "expected a frame time of 0.0001 to 10 s, got -1",
        ),
        (
            f"Frame Time: {1 / 120!r}",
            "Frame Time: nan",
            r"bvh:[0-9]+: expected finite numbers below 1e\+06",
        ),
        ("OFFSET", "OFFSET nan", "bvh:[0-9]+: expected 3 values for 'OFFSET', got 4"),
        (
            "CHANNELS 6 Xposition",
            "CHANNELS 6 Wposition",
            "expected channels such as Xposition or Zrotation",
        ),
        (
            "CHANNELS 6",
            "CHANNELS 5",
            "expected a number of at most 6 channels, and these channels",
        ),
        (
            "ROOT Hips\n{",
            "ROOT Hips\nOFFSET 0 0 0\n{",
            "expected HIERARCHY, ROOT, JOINT",
        ),
        ("\nMOTION\n", "\n", "expected HIERARCHY, .* or MOTION, got 'Frames: 6'"),
    ],
)
def test_mistakes_name_the_file_and_the_line(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    path = tmp_path / "x.bvh"
    write_bvh(path, any_motion())
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after, 1))
    with pytest.raises(ValueError, match=message) as caught:
        read_bvh(path, unit="cm")
    assert str(path) in str(caught.value)


def test_a_limb_in_another_order_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.bvh"
    write_bvh(path, any_motion())
    other = {"LeftUpLeg": "LeftLeg", "LeftLeg": "LeftUpLeg"}
    path.write_text(
        re.sub("|".join(other), lambda name: other[name[0]], path.read_text())
    )
    with pytest.raises(
        ValueError,
        match=r"without left shin \('LeftLeg'\) under left thigh \('LeftUpLeg'\)",
    ):
        read_bvh(path)


def farthest(
    path: Path, style: Style, motion: Motion, metres: float, world: Array
) -> float:
    """Return how far the joints of a rig's file are from those that were read, in metres."""
    places = places_of(path)
    off = 0.0
    for role, name in style.names.items():
        for side in style.sides if "{}" in name else ("",):
            joint = joint_after(role, style).format(side[:1].lower())
            if role in ("spine", "spine1", "chest") and "spine" not in style.names:
                continue
            expected = metres * places[name.format(side)] @ world
            off = max(
                off,
                float(
                    np.linalg.norm(
                        expected - motion.joints[:, JOINTS.index(joint)], axis=1
                    ).max()
                ),
            )
    return off


ABOUT = {
    "y": np.eye(3),
    "z": about(0, np.pi / 2),
    "x": about(2, -np.pi / 2),
    "-y": about(0, np.pi),
}
POSE = (
    "left_knee_flexion",
    "right_hip_flexion",
    "left_hip_adduction",
    "left_elbow_flexion",
)


@each(
    ("name", "rest"),
    [(name, rest) for name in STYLES for rest in ("cmu", "t", "along x")],
)
def test_joints_of_other_programs_are_where_their_files_put_them(
    tmp_path: Path, name: str, rest: str
) -> None:
    style = STYLES[name]
    walk = recorded.clip("16_15").motion().frames(10, 22)
    path = write_rig(tmp_path / "rig.bvh", walk, style, 100.0, ABOUT["z"], rest)
    motion = read_bvh(path)
    assert farthest(path, style, motion, 0.01, ABOUT["z"]) < 1e-5
    angles, expected = (
        clinical_angles(each.skeleton, each.poses) for each in (motion, walk)
    )
    for angle in POSE:  # legs and arms bend as they do, whatever the pose of rest
        np.testing.assert_allclose(angles[angle], expected[angle], atol=2.0)
    assert any("z is taken to be up" in note for note in motion.notes)
    assert any("centimetres" in note for note in motion.notes)


def test_hinges_bend_as_people_s_do_where_no_frame_is_like_the_pose_of_rest(
    tmp_path: Path,
) -> None:
    run = recorded.clip("09_01").motion()  # knees and elbows are never straight
    motion = read_bvh(
        write_rig(tmp_path / "rig.bvh", run, STYLES["lafan1"], 100.0, rest="along x")
    )
    angles, expected = (
        clinical_angles(each.skeleton, each.poses) for each in (motion, run)
    )
    for hinge in ("left_knee", "left_elbow", "right_knee", "right_elbow"):
        np.testing.assert_allclose(
            angles[f"{hinge}_flexion"], expected[f"{hinge}_flexion"], atol=1.0
        )
        assert np.abs(angles[f"{hinge}_adduction"]).max() < 3.0


def test_missing_joints_of_a_rig_are_at_rest_and_reported(tmp_path: Path) -> None:
    walk = recorded.clip("16_15").motion().frames(10, 14)
    motion = read_bvh(write_rig(tmp_path / "rig.bvh", walk, STYLES["vrm"]))
    (note,) = motion.notes
    assert (
        "the file lacks ltoes, rtoes, upperneck, head, lwrist, lhand, rwrist, rhand; an average person's are added"
        in note
    )
    forwards = (
        motion.joints[:, JOINTS.index("ltoes")]
        - motion.joints[:, JOINTS.index("lfoot")]
    )
    assert (np.linalg.norm(forwards, axis=1) > 0.03).all()
    whole = read_bvh(write_rig(tmp_path / "whole.bvh", walk, STYLES["motionbuilder"]))
    assert whole.notes == ()
    path = write_rig(
        tmp_path / "short.bvh", walk, STYLES["biovision to wrists and ankles"]
    )
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())  # as some editors save it
    short = read_bvh(path)
    assert (
        "the file lacks lfoot, ltoes, rfoot, rtoes, lwrist, lhand, rwrist, rhand; an average person's are added"
        in short.notes[0]
    )
    above = [
        JOINTS.index(name) for name in ("lhumerus", "rhumerus", "lfemur", "rfemur")
    ]
    ends = [JOINTS.index(name) for name in ("lradius", "rradius", "ltibia", "rtibia")]
    shanks, expected = (
        each.joints[:, ends] - each.joints[:, above] for each in (short, walk)
    )
    np.testing.assert_allclose(shanks, expected, atol=1e-5)


@each(
    ("unit", "axis"),
    [(unit, axis) for unit in UNITS for axis in ("y", "z")]
    + [("m", "x"), ("cm", "-y")],
)
def test_unit_and_axis_are_recognised_reported_and_settable(
    tmp_path: Path, unit: Unit, axis: str
) -> None:
    walk = recorded.clip("16_15").motion().frames(10, 14)
    path = write_rig(
        tmp_path / "a.bvh",
        walk,
        STYLES["motionbuilder"],
        1.0 / METRES[unit],
        ABOUT[axis],
    )
    motion = read_bvh(path)
    assert Body.of(motion.skeleton).stature == pytest.approx(
        Body.of(walk.skeleton).stature, abs=1e-5
    )
    # it has no fingers
    wrists = [
        JOINTS.index(f"{side}{bone}") for side in "lr" for bone in ("wrist", "hand")
    ]
    expected, joints = (
        np.delete(each.joints, wrists, axis=1) for each in (walk, motion)
    )
    np.testing.assert_allclose(joints, expected, atol=1e-5)
    of_axis = [note for note in motion.notes if "taken to be" in note]
    assert [f"{axis} is taken to be up" in note for note in of_axis] == [True] * (
        axis != "y"
    )
    assert sum(UNIT_NAMES[unit] in note for note in motion.notes) == (unit != "m")
    if axis in ("x", "y", "z"):
        stated = read_bvh(path, unit=unit, up=axis)  # type: ignore[arg-type]
        np.testing.assert_array_equal(stated.joints, motion.joints)
        assert stated.notes == ()


def test_an_implausible_stature_is_refused_or_reported(tmp_path: Path) -> None:
    walk = recorded.clip("16_15").motion().frames(10, 12)
    path = write_rig(tmp_path / "a.bvh", walk, STYLES["motionbuilder"], 3e-3)
    with pytest.raises(
        ValueError,
        match=r"a.bvh: expected a person whose height is plausible .* --unit m\|cm.*, got a height of 0.005",
    ):
        read_bvh(path)
    (note,) = read_bvh(path, unit="cm").notes
    assert "with lengths in centimetres the person is 0.00 m tall" in note
    with pytest.raises(
        ValueError, match="unit must be one of m, cm, mm, inch, foot, cmu, got 'ell'"
    ):
        read_bvh(path, unit="ell")  # type: ignore[arg-type]


def test_bones_that_change_their_lengths_are_followed_and_reported(
    tmp_path: Path,
) -> None:
    walk = recorded.clip("16_15").motion().frames(10, 22)
    path = write_rig(tmp_path / "a.bvh", walk, STYLES["lafan1"])
    head, table = path.read_text().split("MOTION\n")
    rows = [line.split() for line in table.splitlines()[2:]]
    names = re.findall(r"(?:ROOT|JOINT) (\S+)", head)
    # its first position: the length of the upper arm
    column = 6 * names.index("LeftForeArm")
    for k, row in enumerate(rows):
        row[column] = f"{float(row[column]) + 0.004 * (-1) ** k:.6f}"
    path.write_text(
        f"{head}MOTION\n"
        + "\n".join([*table.splitlines()[:2], *map(" ".join, rows)])
        + "\n"
    )
    motion = read_bvh(path)
    assert 0.0039 < farthest(path, STYLES["lafan1"], motion, 1.0, np.eye(3)) < 0.0045
    assert any(
        "change their length" in note and "4.0 mm" in note for note in motion.notes
    )


def test_a_bvh_and_an_amc_of_one_motion_are_one_source_and_one_training(
    tmp_path: Path,
) -> None:
    walk = recorded.clip("16_15").motion().frames(10, 40)
    write_asf(tmp_path / "a.asf", walk.skeleton)
    write_amc(tmp_path / "a.amc", walk)
    write_bvh(tmp_path / "a.bvh", walk)
    for source in (tmp_path / "a.amc", tmp_path / "a.bvh"):
        motion, (learned,) = load_motion(source), training_clips([source])
        for poses in (motion.poses, learned.motion(30.0).poses):
            np.testing.assert_allclose(wrapped(poses - walk.poses), 0.0, atol=1e-7)
        np.testing.assert_allclose(motion.joints, walk.joints, atol=1e-7)
        np.testing.assert_array_equal(motion.skeleton.free, walk.skeleton.free)
        np.testing.assert_allclose(motion.skeleton.axes, walk.skeleton.axes, atol=1e-12)


def test_joint_angles_cross_skeletons_as_rotations_in_space() -> None:
    walk = recorded.clip("16_15").motion().frames(10, 20)
    axes = rotation_from_joint_angles(
        np.random.default_rng(3).uniform(-3.0, 3.0, (len(BONES), 3))
    )
    other = Skeleton(
        "other", walk.skeleton.offsets, axes, any_motion().skeleton.channels
    )
    turned = walk.about_axes_of(other)
    np.testing.assert_allclose(turned.joints, walk.joints, atol=1e-9)
    assert np.abs(turned.poses[:, 3:] - walk.poses[:, 3:]).max() > 0.3
    np.testing.assert_allclose(
        turned.about_axes_of(walk.skeleton).joints, walk.joints, atol=1e-9
    )
    task = Task(Body.of(other), [], 1, None, np.zeros(3), training=[walk, turned])
    np.testing.assert_allclose(
        task.angles[: len(walk)], task.angles[len(walk) :], atol=1e-9
    )


def test_angles_are_written_without_jumps(tmp_path: Path) -> None:
    count = 60
    poses = np.zeros((count, ANGLES))
    poses[:, 0] = np.linspace(0.0, 4.0 * np.pi, count)  # twice around
    # and bowing beyond the pole of one order of angles
    poses[:, 1] = 1.4 * np.sin(np.linspace(0.0, 6.0, count))
    poses[:, 3:6] = np.linspace(0.0, 2.0, count)[:, None]
    motion = Motion(
        "spin", built_in.average_skeleton(), poses, np.zeros((count, 3)), 30.0
    )
    write_bvh(tmp_path / "a.bvh", motion)
    table = (tmp_path / "a.bvh").read_text().split("Frame Time:")[1].splitlines()[1:]
    rows = np.array([line.split() for line in table], dtype=np.float64)
    assert np.abs(np.diff(rows, axis=0)).max() < 90.0
    np.testing.assert_allclose(
        read_bvh(tmp_path / "a.bvh", up="y").joints, motion.joints, atol=1e-6
    )


def test_the_unpacked_size_of_a_file_is_limited(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.bvh"
    write_bvh(path, built_in.motion("walk", frames=6))
    text = path.read_text()
    # 30 frames of 70,000,000 s were 2.1e9 at 30 a second
    path.write_text(re.sub("Frame Time: .*", "Frame Time: 70000000", text))
    with pytest.raises(
        ValueError, match=r"a.bvh:.*: expected finite numbers below 1e\+06 for b?'?"
    ):
        read_bvh(path)
    path.write_text(text)
    monkeypatch.setattr(bvh, "LONGEST", 5)
    with pytest.raises(
        ValueError,
        match="a.bvh:.*: expected at most 5 frames and 20000000 numbers, got more",
    ):
        read_bvh(path)
    monkeypatch.setattr(bvh, "NODES", 20)
    with pytest.raises(
        ValueError, match="a.bvh:.*: expected at most 20 joints and ends, got more"
    ):
        read_bvh(path)


@each("below", ["roots", "one root"])
def test_the_other_people_of_a_file_are_named(tmp_path: Path, below: str) -> None:
    write_bvh(tmp_path / "one.bvh", built_in.motion("walk", frames=3))
    text = (tmp_path / "one.bvh").read_text()
    hierarchy, motion = text.split("MOTION\n")
    tree = hierarchy.removeprefix("HIERARCHY\n")
    other = re.sub(r"(ROOT|JOINT) (\w+)", r"\1 Partner_\2", tree)
    rows = motion.splitlines()
    if below == "roots":
        hierarchy = f"HIERARCHY\n{tree}{other}"
        rows[2:] = [f"{row} {row}" for row in rows[2:]]
    else:
        inner = (tree + other).replace("ROOT", "JOINT")
        hierarchy = f"HIERARCHY\nROOT Scene\n{{\nOFFSET 0 0 0\nCHANNELS 0\n{inner}}}\n"
        rows[2:] = [f"{row} {row}" for row in rows[2:]]
    (tmp_path / "two.bvh").write_text(hierarchy + "\n".join(["MOTION", *rows, ""]))
    one, two = (read_bvh(tmp_path / name) for name in ("one.bvh", "two.bvh"))
    np.testing.assert_allclose(two.joints, one.joints, atol=1e-6)
    assert not any("left out" in note for note in one.notes)
    (note,) = [note for note in two.notes if "left out" in note]
    assert "the person with the root 'Hips' is read, 'Partner_Hips' left out" in note
