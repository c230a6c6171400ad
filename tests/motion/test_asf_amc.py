"""Acclaim files: real ones against a slow reader of the same text, small ones against numbers worked by hand."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from posefit import Body, Motion
from posefit.arrays import Array
from posefit.geometry.rotation import geodesic, rotation_from_root_angles
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    ENDS,
    JOINTS,
    PARENTS,
    Skeleton,
    angle_index,
)
from posefit.geometry.units import CMU_UNIT
from posefit.motion import recorded
from posefit.motion.amc import read_amc, read_clip, write_amc
from posefit.motion.asf import parse_asf, write_asf
from posefit.motion.clips import skeleton_file
from tests.cases import each
from tests.geometry.turns import about, chained

CHILDREN = "".join(
    " ".join(
        [
            name,
            *(
                child
                for child, above in zip(JOINTS, PARENTS, strict=True)
                if above == joint
            ),
        ]
    )
    + "\n"
    for joint, name in enumerate(JOINTS)
    if joint not in ENDS
).replace("lwrist lhand", "lwrist lhand lthumb")
DOF = {
    "lfemur": "rx ry rz",
    "ltibia": "rx",
    "ltoes": "rx",
    "lthumb": "rx rz",
    "rwrist": "ry",
    "rfoot": "rx rz",
}
HEADER = "#!OML:ASF C:\\person.ASF\n:FULLY-SPECIFIED\n:DEGREES\n"
FRAME = """\
root 1 2 3 0 90 0
lfemur 10 20 30
ltibia 40
ltoes 5
lthumb 6 7
rwrist 50
rfoot -10 -20
"""


def asf_text(length: str = "0.45", angle: str = "deg", turn: str = "20") -> str:
    text = f"# made by a test\n:version 1.10\n:name VICON\n:units\n  mass 1.0\n  length {length}\n  angle {angle}\n"
    text += (
        ":documentation\n  any words\n:root\n  order TX TY TZ RX RY RZ\n  axis XYZ\n"
    )
    text += "  position 0 0 0\n  orientation 0 0 0\n:bonedata\n"
    for number, bone in enumerate(
        dict.fromkeys(CHILDREN.replace("root ", "", 1).split()), 1
    ):
        text += f"  begin\n     id {number}\n     name {bone}\n     direction 0 -2 0\n     length {number}\n"
        text += f"     axis 0 0 {turn}  XYZ\n"
        if bone in DOF:
            text += (
                f"    dof {DOF[bone]}\n    limits (-160.0 20.0)\n"
                + "           (-70 70)\n" * DOF[bone].count(" ")
            )
        text += "  end\n"
    return text + ":hierarchy\n  begin\n" + CHILDREN + "  end\n"


def amc_text(*frames: str) -> str:
    return HEADER + "".join(
        f"{number}\n{frame}" for number, frame in enumerate(frames or (FRAME, FRAME), 1)
    )


@pytest.fixture
def skeleton(tmp_path: Path) -> Skeleton:
    (tmp_path / "small.asf").write_text(asf_text())
    return parse_asf(tmp_path / "small.asf").skeleton


def amc_file(folder: Path, text: str) -> Path:
    path = folder / "clip.amc"
    path.write_text(text, newline="")
    return path


def angles_of(motion: Motion, bone: str) -> Array:
    start = angle_index(JOINTS.index(bone))
    return np.degrees(motion.poses[:, start : start + 3])


def turn(x: float, y: float, z: float) -> Array:
    """Return Rz @ Ry @ Rx of angles in degrees."""
    return np.asarray(
        about(2, np.radians(z)) @ about(1, np.radians(y)) @ about(0, np.radians(x))
    )


def slow_clip(skeleton: Path, clip: Path, frame: int) -> Array:
    """Return the joints (27, 3) of a frame, straight from the words of both files. A unit is 1 / 0.45 inch."""
    bones = skeleton.read_text().split(":bonedata")[1].split(":hierarchy")[0]
    definition: dict[str, dict[str, list[str]]] = {}
    for block in bones.split("begin")[1:]:
        words = {
            line.split()[0]: line.split()[1:]
            for line in block.splitlines()
            if line.split()
        }
        definition[words["name"][0]] = words
    lines = clip.read_text().splitlines()
    start = lines.index(str(frame))
    stop = lines.index(str(frame + 1)) if str(frame + 1) in lines else len(lines)
    values = {
        line.split()[0]: [float(word) for word in line.split()[1:]]
        for line in lines[start + 1 : stop]
    }
    axes = []
    offsets = []
    turns = []
    for bone in BONES:
        words = definition[bone]
        angles = {"rx": 0.0, "ry": 0.0, "rz": 0.0}
        if JOINTS.index(bone) not in ENDS:
            angles |= dict(zip(words.get("dof", []), values.get(bone, []), strict=True))
        direction = np.array([float(word) for word in words["direction"]])
        axes.append(turn(*(float(word) for word in words["axis"][:3])))
        offsets.append(
            direction / np.linalg.norm(direction) * float(words["length"][0])
        )
        turns.append(turn(*angles.values()))
    return (
        chained(
            turn(*values["root"][3:]),
            np.array(values["root"][:3]),
            turns,
            axes,
            offsets,
        )
        / 0.45
        * 0.0254
    )


@each("clip", ["02/02_01", "127/127_03", "49/49_02", "16/16_15"])
def test_joints_are_where_acclaim_puts_them(cmu: Path, clip: str) -> None:
    moving = cmu / f"{clip}.amc"
    skeleton = next(moving.parent.glob("*.asf"))
    motion = read_clip(skeleton, moving)
    for frame in (1, 40, 163, len(motion)):
        joints = motion.skeleton.joints(
            motion.poses[frame - 1], motion.translations[frame - 1]
        )
        np.testing.assert_allclose(
            joints, slow_clip(skeleton, moving, frame), atol=1e-9
        )


def test_a_skeleton_by_hand(skeleton: Skeleton, tmp_path: Path) -> None:
    # bone 2, lfemur's place in the text below root's three children, has length 4 in the direction -y
    assert pytest.approx(0.056444, abs=1e-6) == CMU_UNIT
    np.testing.assert_allclose(
        skeleton.offsets[BONES.index("lfemur")],
        [0.0, -4 * 0.0254 / 0.45, 0.0],
        atol=1e-12,
    )
    np.testing.assert_allclose(skeleton.axes[7], turn(0.0, 0.0, 20.0), atol=1e-12)
    (tmp_path / "rad.asf").write_text(asf_text(angle="rad", turn=repr(np.pi / 9)))
    np.testing.assert_allclose(
        parse_asf(tmp_path / "rad.asf").skeleton.axes, skeleton.axes, atol=1e-12
    )
    # in the file's order, those of bones outside the tree, too
    names = [bone for bone, _ in skeleton.channels]
    assert set(names) == set(DOF)
    assert names.index("lfemur") < names.index("ltibia") < names.index("ltoes")
    assert dict(skeleton.channels)["lthumb"] == ("rx", "rz")


@each(
    ("before", "after", "message"),
    [
        (
            "name lfemur",
            "name femur",
            "small.asf: the skeleton needs bone 'lfemur', which this file does not define",
        ),
        (
            "order TX TY TZ RX RY RZ",
            "order TX TY TZ RZ RY RX",
            "11: expected root order TX TY TZ RX RY RZ, got 'order",
        ),
        ("axis 0 0 20  XYZ", "axis 0 0 20  ZYX", "21: expected axis order XYZ"),
        ("angle deg", "angle rad", "21: expected an axis of up to 360 degrees"),
        (
            "direction 0 -2 0",
            "direction 0 0 0",
            "19: expected a direction that is not zero",
        ),
        ("length 1\n", "length -1\n", "20: expected a length of 0 or more"),
        (
            "dof rx ry rz",
            "dof rz ry rx",
            "expected dof out of rx ry rz, in this order, got 'dof rz ry rx'",
        ),
        ("lhipjoint lfemur\n", "", "expected bone 'lfemur' in the hierarchy"),
        (
            "lhipjoint lfemur\n",
            "rhipjoint lfemur\n",
            "expected bone 'lfemur' under 'lhipjoint', got it under 'rhip",
        ),
        (
            ":hierarchy",
            ":hierarch",
            "expected a section :hierarchy, got the end of the file",
        ),
    ],
)
def test_mistakes_in_a_skeleton_are_named(
    tmp_path: Path, before: str, after: str, message: str
) -> None:
    assert before in asf_text()
    path = tmp_path / "small.asf"
    path.write_text(asf_text().replace(before, after, 1))
    with pytest.raises(ValueError, match="expected|needs") as caught:
        parse_asf(path)
    assert str(path) in str(caught.value)
    assert message in str(caught.value)


def test_a_frame_is_read_into_radians_and_metres(
    skeleton: Skeleton, tmp_path: Path
) -> None:
    motion = read_amc(amc_file(tmp_path, amc_text()), skeleton)
    assert (motion.name, len(motion), motion.fps) == ("clip", 2, 120.0)
    np.testing.assert_allclose(
        motion.translations[1], np.array([1, 2, 3]) * 0.0254 / 0.45
    )
    # RY alone is yaw
    np.testing.assert_allclose(np.degrees(motion.poses[1, :3]), [90, 0, 0], atol=1e-9)
    np.testing.assert_allclose(angles_of(motion, "lfemur")[1], [10, 20, 30])
    np.testing.assert_allclose(angles_of(motion, "rwrist")[1], [0, 50, 0])
    np.testing.assert_allclose(angles_of(motion, "rfoot")[1], [-10, 0, -20])
    # no toes, no thumb
    assert np.count_nonzero(np.abs(motion.poses[1]) > 1e-12) == 1 + 3 + 1 + 1 + 2
    text = (
        amc_text()
        .replace(":DEGREES", ":radians")
        .replace("0 90 0", "0 1 0")
        .replace("ltibia 40", "ltibia 0.5")
    )
    motion = read_amc(amc_file(tmp_path, text.replace("10 20 30", "0 0 0")), skeleton)
    np.testing.assert_allclose(motion.poses[:, 0], 1.0)
    np.testing.assert_allclose(angles_of(motion, "ltibia")[:, 0], np.degrees(0.5))


def test_line_ends_blank_lines_and_comments_make_no_difference(
    skeleton: Skeleton, tmp_path: Path
) -> None:
    plain = read_amc(amc_file(tmp_path, amc_text()), skeleton)
    for text in (
        amc_text().replace("\n", "\r\n"),
        amc_text().replace("\n", " \n\n# caf\u00e9\n"),
        amc_text().rstrip(),
    ):
        np.testing.assert_array_equal(
            read_amc(amc_file(tmp_path, text), skeleton).poses, plain.poses
        )
    (tmp_path / "crlf.asf").write_bytes(asf_text().replace("\n", "\r\n").encode())
    np.testing.assert_array_equal(
        parse_asf(tmp_path / "crlf.asf").skeleton.offsets, skeleton.offsets
    )


def test_angles_are_unwrapped_along_time(skeleton: Skeleton, tmp_path: Path) -> None:
    turning = FRAME.replace("ltibia 40", "ltibia {}").replace("0 90 0", "0 {} 0")
    frames = [turning.format(-60 * k, (50 * k + 180) % 360 - 180) for k in range(20)]
    motion = read_amc(amc_file(tmp_path, amc_text(*frames)), skeleton)
    np.testing.assert_allclose(
        angles_of(motion, "ltibia")[:, 0], 50 * np.arange(20), atol=1e-9
    )
    np.testing.assert_allclose(
        np.degrees(motion.poses[:, 0]), -60 * np.arange(20), atol=1e-9
    )


@each(
    ("before", "after", "message"),
    [
        ("ltibia 40\n", "", ":11: expected bone 'ltibia' in frame 1, got frame 2"),
        (
            "ltibia 40\n",
            "ltibia 40\nltibia 40\n",
            ":8: expected each bone once in frame 1, got 'ltibia' again",
        ),
        ("ltibia 40", "ltibia 40 41", ":7: expected 1 values for 'ltibia', got 2"),
        (
            "ltibia 40",
            "ltibia nan",
            ":7: expected finite numbers below 1e+06 for 'ltibia', got 'nan'",
        ),
        (
            "ltibia 40",
            "lfin 40",
            ":7: expected a bone of skeleton 'small' or a frame's number, got 'lfin 40'",
        ),
        ("\n2\n", "\n3\n", ":12: expected frame 2, got frame 3"),
        (
            ":DEGREES\n",
            "",
            ":3: expected :DEGREES or :RADIANS before the first frame, got frame 1",
        ),
        (
            "\n1\n",
            "\n" + "1" * 10_001 + "\n",
            ":4: expected a line of at most 10000 bytes, got a longer one",
        ),
    ],
)
def test_mistakes_in_a_motion_are_named(
    skeleton: Skeleton, tmp_path: Path, before, after, message
) -> None:
    assert before in amc_text()
    path = amc_file(tmp_path, amc_text().replace(before, after, 1))
    with pytest.raises(ValueError, match="expected") as caught:
        read_amc(path, skeleton)
    assert f"{path}{message}" in str(caught.value)


def test_values_that_a_file_cannot_hold_are_not_written(
    skeleton: Skeleton, tmp_path: Path
) -> None:
    poses = np.zeros((1, ANGLES))
    # the knee bends about x only
    poses[0, angle_index(JOINTS.index("ltibia")) + 1] = 0.25
    motion = Motion("m", skeleton, poses, np.zeros((1, 3)), 120.0)
    with pytest.raises(
        ValueError, match=r"turn joints about their free axes only, got 0\.25 rad"
    ):
        write_amc(tmp_path / "m.amc", motion)


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("acclaim")
    (folder / "small.asf").write_text(asf_text())
    return folder


@given(st.integers(0, 2**32 - 1), st.integers(1, 5))
def test_any_motion_survives_writing(workshop: Path, seed: int, frames: int) -> None:
    rng = np.random.default_rng(seed)
    skeleton = parse_asf(workshop / "small.asf").skeleton
    poses = rng.uniform(-1.5, 1.5, (frames, ANGLES)) * skeleton.free
    motion = Motion("any", skeleton, poses, rng.normal(size=(frames, 3)), 120.0)
    write_amc(workshop / "any.amc", motion)
    again = read_amc(workshop / "any.amc", skeleton)
    roots = (rotation_from_root_angles(one.poses[:, :3]) for one in (again, motion))
    assert geodesic(*roots).max() < 1e-7
    np.testing.assert_allclose(again.poses, motion.poses, atol=1e-9)
    np.testing.assert_allclose(again.translations, motion.translations, atol=1e-9)


def written(folder: Path, motion: Motion) -> tuple[Path, Path]:
    """Write a motion, and return its two files."""
    asf = folder / "a.asf"
    amc = folder / "a.amc"
    write_asf(asf, motion.skeleton)
    write_amc(amc, motion)
    return asf, amc


def test_the_rate_is_the_files_or_given_or_assumed_and_reported(tmp_path: Path) -> None:
    walk = replace(recorded.clip("16_15").motion().frames(0, 30), fps=60000 / 1001)
    asf, amc = written(tmp_path, walk)
    again = read_clip(asf, amc)
    assert (again.fps, again.notes, len(again.resampled(30.0))) == (walk.fps, (), 15)
    assert read_clip(asf, amc, fps=50.0).fps == 50.0
    text = amc.read_text()
    amc.write_text(text.partition("\n")[2])
    assumed = read_clip(asf, amc)
    assert assumed.fps == 120.0
    why = "the file does not state its rate: 120 frames a second are assumed; --rate sets it"
    assert assumed.notes == (f"{amc}: {why}",)
    amc.write_text("# 1e9 frames a second\n" + text)
    with pytest.raises(ValueError, match=r"a.amc:1: expected .*got"):
        read_clip(asf, amc)


def test_a_first_frame_with_a_later_number_is_said(tmp_path: Path) -> None:
    walk = recorded.clip("16_15").motion()
    asf, amc = written(tmp_path, walk.frames(4, 8))  # the file has frames 5 to 8
    said = f"{amc}: the file's first frame is number 5: here its frames are numbered from 0"
    assert read_clip(asf, amc).notes == (said,)
    asf, amc = written(tmp_path, walk.frames(0, 4))
    assert read_clip(asf, amc).notes == ()


def test_angles_of_another_unit_than_the_file_states_are_said(tmp_path: Path) -> None:
    walk = recorded.clip("16_15").motion().frames(0, 4)
    asf, amc = written(tmp_path, walk)
    assert read_clip(asf, amc).notes == ()
    text = amc.read_text()
    amc.write_text(text.replace(":DEGREES", ":RADIANS"))
    assert "radians seem to be degrees" in " ".join(read_clip(asf, amc).notes)
    lines = []
    for line in text.splitlines():
        bone, *values = line.split()
        if values and line[0].isalpha():
            kept = 3 if bone == "root" else 0
            angles = np.radians(np.array(values[kept:], dtype=float)).tolist()
            line = " ".join([bone, *values[:kept], *map(repr, angles)])
        lines.append(line)
    amc.write_text("\n".join(lines) + "\n")
    assert "degrees may be radians" in " ".join(read_clip(asf, amc).notes)


@each("suffix", ["asf", "ASF", "Asf"])
def test_the_only_skeleton_beside_a_motion_is_taken(
    tmp_path: Path, suffix: str
) -> None:
    asf, amc = written(tmp_path, recorded.clip("16_15").motion().frames(0, 4))
    asf.rename(tmp_path / f"b.{suffix}")
    assert skeleton_file(amc, None) == tmp_path / f"b.{suffix}"


@each("stated", ["  length 1.0\n", "  length 0.001\n", None])
def test_a_unit_that_gives_no_plausible_person_is_recognised_and_reported(
    tmp_path: Path, stated: str | None
) -> None:
    walk = recorded.clip("16_15").motion().frames(0, 4)
    asf, amc = written(tmp_path, walk)
    assert read_clip(asf, amc).notes == ()
    text = asf.read_text()
    if stated is None:
        text = re.sub(":units\n.*?(?=:root)", "", text, flags=re.DOTALL)
    else:
        text = re.sub(r"^ *length.*\n", stated, text, count=1, flags=re.MULTILINE)
    asf.write_text(text)
    motion = read_clip(asf, amc)
    np.testing.assert_allclose(motion.joints, walk.joints, atol=1e-9)
    (note,) = motion.notes
    assert "the CMU database's unit (5.64 cm): 1.7" in note
    in_inches = Body.of(parse_asf(asf, "inch").skeleton).stature
    assert in_inches == pytest.approx(0.45 * Body.of(walk.skeleton).stature)


def test_an_amc_may_have_another_axis_up(tmp_path: Path) -> None:
    walk = recorded.clip("16_15").motion().frames(0, 4)
    motion = read_clip(*written(tmp_path, walk.turned(about(0, np.pi / 2))), up="z")
    np.testing.assert_allclose(motion.joints, walk.joints, atol=1e-9)
