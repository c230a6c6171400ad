"""BVH motions: read from the files of many programs, and written.

In a BVH file a joint's rotation turns everything that starts at the joint. In a
`Skeleton` the angles named after a bone turn that bone about the joint it starts from.
So a bone corresponds to the BVH joint at the bone's start: `LeftUpLeg` (the hip) has
the angles of `lfemur`, and the offset of its child `LeftLeg` (the knee) is that bone's
vector. joint_names.py recognises joints by name; rig.py converts the motion to
posefit's skeleton.
"""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.calibration import TURNS, Up
from posefit.geometry.rotation import angles_about, rotation_about, steady_angles
from posefit.geometry.skeleton import ENDS, JOINTS, PARENTS
from posefit.geometry.units import METRES, UNIT_NAMES, UNITS, Unit, metres_of, unit_of
from posefit.motion.amc import SIZE_LIMIT, VALUES, doubtful_angles
from posefit.motion.joint_names import joints_of, part_of
from posefit.motion.lines import LARGEST, Line, lines_of
from posefit.motion.motion import LONGEST, Motion
from posefit.motion.rig import STANDING, Rig, retargeted, upward
from posefit.reading import check_size, cut, quoted

# names in the CMU conversions by cgspeed, without their side
_LIMBS = {
    "hipjoint": "HipJoint",
    "femur": "UpLeg",
    "tibia": "Leg",
    "foot": "Foot",
    "toes": "ToeBase",
    "clavicle": "Shoulder",
    "humerus": "Arm",
    "radius": "ForeArm",
    "wrist": "Hand",
    "hand": "FingerBase",
}
NAMES = {
    "root": "Hips",
    "lowerback": "LowerBack",
    "upperback": "Spine",
    "thorax": "Spine1",
    "lowerneck": "Neck",
    "upperneck": "Neck1",
    "head": "Head",
}
for _bone, _name in _LIMBS.items():
    NAMES[f"l{_bone}"] = f"Left{_name}"
    NAMES[f"r{_bone}"] = f"Right{_name}"
# the conversions spell these two with their sides as one letter
NAMES["lhipjoint"] = "LHipJoint"
NAMES["rhipjoint"] = "RHipJoint"
ROTATIONS = "Zrotation Xrotation Yrotation"
LONGEST_LINE = 100_000  # bytes; a frame of CMU's files has about 1,000
NODES = 1_000  # joints and ends of a file
FRAME_TIMES = (1e-4, 10.0)  # seconds
# relative difference between a rate and the nearest whole number within which the whole
# number is taken: files state 0.0083333 for 1 / 120
WHOLE_RATE = 1e-4
# rates that programs write, whose frame times files round to a few digits
USUAL_RATES = (
    # whole rates, then NTSC rates
    (24, 25, 30, 48, 50, 60, 72, 90, 100, 120, 144, 150, 180, 200, 240, 250, 300),
    tuple(whole * 1000.0 / 1001.0 for whole in (24, 30, 60, 120, 240)),
)
# metres that a joint may be off its place in the file without a note
MAX_JOINT_OFF = 1e-3


def read_bvh(
    path: str | Path, *, unit: Unit | None = None, up: Up | None = None
) -> Motion:
    """Return the motion of a .bvh file with its own skeleton, y up, radians and metres.

    Joints may have the names of many programs. Missing joints of toes, hands, neck or
    spine are at rest, with the lengths of an average person. Further joints are left
    out, and so are the rotations of toes and hands, and of a head above a neck of two
    joints. Joint angles are counted from the rest pose and about the axes of the CMU
    database, as in its .amc files. The root is where its position channels say; its
    OFFSET is not added. The motion's `notes` list the guesses.

    Args:
        path: The file.
        unit: Its length unit, by default the unit in which the person has a plausible
            stature.
        up: The world's axis that points up, by default the axis along which the person
            stands.

    Raises:
        InputError: The file is not a motion of a person; the message has its name.
    """
    path = Path(path)
    known = None if unit is None else metres_of(unit)
    check_size(path, SIZE_LIMIT)
    nodes, values, (frame_time, fps) = _parsed(path)
    try:
        rig = _rig(nodes, values)
        others = _others(rig)
        axis, turn = _upright(rig, up)
        result = retargeted(rig, turn)
    except InputError as error:
        raise InputError(f"{path}: expected a BVH file with {error}") from None
    stature = Body.of(result.skeleton).stature
    chosen = unit or unit_of(stature)
    if chosen is None:
        raise InputError(
            f"{path}: expected a person whose height is plausible in some unit, "
            f"or --unit {'|'.join(UNITS)}, got a height of {stature:g}"
        )
    metres = METRES[chosen] if known is None else known
    skeleton = replace(
        result.skeleton, name=path.stem, offsets=result.skeleton.offsets * metres
    )
    # the file says nothing about most of this, so each guess is reported
    notes = []
    if others:
        followed = quoted(rig.names[rig.joints.hips])
        left_out = ", ".join(map(quoted, others))
        notes.append(
            f"{path}: the person with the root {followed} is read, {left_out} left out"
        )
    if abs(frame_time * fps - 1.0) > WHOLE_RATE:
        notes.append(
            f"{path}: frames of {frame_time:g} s are taken as {fps:.5g} a second"
        )
    if said := doubtful_angles(_turning(nodes, values), radians=False):
        notes.append(f"{path}: {said}")
    if unit is None and chosen != "m":
        notes.append(
            f"{path}: lengths are taken as {UNIT_NAMES[chosen]}, because the "
            f"person is {stature:.4g} units tall; --unit sets it"
        )
    elif unit is not None and unit_of(stature * metres) is None:
        notes.append(
            f"{path}: with lengths in {UNIT_NAMES[unit]} the person is "
            f"{stature * metres:.2f} m tall"
        )
    if up is None and axis != "y":
        notes.append(
            f"{path}: {axis} is taken to be up, because the person stands along it; "
            "--up sets it"
        )
    if result.filled:
        notes.append(
            f"{path}: the file lacks {', '.join(result.filled)}; "
            "an average person's are added, at rest"
        )
    if result.off * metres > MAX_JOINT_OFF:
        off = f"{1e3 * result.off * metres:.1f} mm off"
        notes.append(
            f"{path}: bones change their length or fork, so joints are up to {off}"
        )
    return Motion(
        path.stem,
        skeleton,
        result.poses,
        result.places * metres,
        fps,
        notes=tuple(notes),
    )


def _upright(rig: Rig, up: Up | None) -> tuple[str, Array]:
    """Return the axis that is up, such as -z, and the turn (3, 3) from it to y."""
    if up is not None:
        if up not in TURNS:
            raise InputError(f"an upward axis of x, y or z, got {quoted(up)}")
        return up, np.array(TURNS[up], dtype=np.float64)
    number, cosine = upward(rig)
    name: Up = ("x", "y", "z")[number]
    # a person who lies or crawls does not tell which axis is up
    if abs(cosine) < STANDING:
        return "y", np.eye(3)
    turn = np.array(TURNS[name], dtype=np.float64)
    if cosine > 0.0:
        return name, turn
    # the person stands along the negative axis
    return f"-{name}", np.diag([1.0, -1.0, -1.0]) @ turn


@dataclass
class _Node:
    name: str  # "" for an End Site
    parent: int
    offset: Array | None = None
    # for each channel: whether it is a rotation, and its axis
    channels: list[tuple[bool, int]] = field(default_factory=list)
    column: int = 0  # column of the first channel


def _turning(nodes: Sequence[_Node], values: Array) -> Array:
    """Return the values (T, n) of the channels that turn joints below the root."""
    columns = list[int]()
    for node in nodes[1:]:
        for k, (turns, _) in enumerate(node.channels):
            if turns:
                columns.append(node.column + k)
    return values[:, columns]


def _parsed(path: Path) -> tuple[list[_Node], Array, tuple[float, float]]:
    """Return a file's nodes, values (T, channels), and frame time and rate.

    Raises:
        InputError: The file is not a BVH file; the message has the line.
    """
    lines = lines_of(path, LONGEST_LINE)
    nodes, width = _hierarchy(lines)
    count, times = _head(lines)
    # an array takes a quarter of the memory of a list of numbers
    data = array("d")
    rows = 0
    for line in lines:
        if not line.words:
            break
        rows += 1
        if len(line.words) != width:
            raise line.mistake(f"{width} numbers of frame {rows}", f"{len(line.words)}")
        # checked here, before a huge file fills the memory
        if rows > LONGEST or rows * width > VALUES:
            raise line.mistake(f"at most {LONGEST} frames and {VALUES} numbers", "more")
        try:
            data.extend(map(float, line.words))
        except ValueError:
            raise line.mistake(f"{width} numbers of frame {rows}") from None
    # a file that was cut off would otherwise be a shorter motion
    if not rows or rows != count:
        raise line.mistake(f"{max(count, 1)} frames", f"{rows}")
    values = np.array(data).reshape(rows, width)
    if not (np.abs(values) < LARGEST).all():
        raise InputError(
            f"{path}: expected finite numbers below {LARGEST:g}, "
            f"got {np.abs(values).max()}"
        )
    return nodes, values, times


def _hierarchy(lines: Iterator[Line]) -> tuple[list[_Node], int]:
    """Return the joints and ends before MOTION, and the total number of channels."""
    nodes: list[_Node] = []
    opened: list[int] = []  # numbers of the nodes whose braces are open
    waiting = False  # for the opening brace of the last node
    width = 0
    while True:
        line = next(lines)
        brace = line.words[-1:] == ["{"]
        node = nodes[opened[-1]] if opened else None
        if line.key in ("root", "joint", "end"):
            if (
                waiting
                or (line.key == "root") != (node is None)
                or (node is not None and not node.name)
            ):
                raise line.mistake("a ROOT, with JOINT and End Site inside")
            if len(nodes) >= NODES:
                raise line.mistake(f"at most {NODES} joints and ends", "more")
            name = " ".join(line.words[1:-1] if brace else line.words[1:]) or "unnamed"
            nodes.append(
                _Node("" if line.key == "end" else name, opened[-1] if opened else -1)
            )
            waiting = True
        elif line.key == "}" and node is not None:
            if node.offset is None:
                raise line.mistake(f"an OFFSET of {quoted(node.name)}", "none")
            opened.pop()
        elif line.key == "offset" and node is not None:
            node.offset = np.array(line.numbers(3))
        elif (
            line.key == "channels"
            and node is not None
            and node.name
            and not node.channels
        ):
            node.channels = _channels(line)
            node.column = width
            width += len(node.channels)
        elif line.key == "motion" and not opened and nodes:
            return nodes, width
        elif not (line.key == "{" and waiting) and (line.key != "hierarchy" or nodes):
            raise line.mistake(
                "HIERARCHY, ROOT, JOINT, End Site, OFFSET, CHANNELS or MOTION"
            )
        if brace and waiting:
            opened.append(len(nodes) - 1)
            waiting = False


def _head(lines: Iterator[Line]) -> tuple[int, tuple[float, float]]:
    """Return the stated number of frames, the seconds of a frame, and the rate."""
    count = -1
    while True:
        line = next(lines)
        if (
            line.key == "frames:"
            and len(line.words) == 2
            and line.words[1].isdecimal()
            and len(line.words[1]) < 10
        ):
            count = int(line.words[1])
        elif count >= 0 and " ".join(line.words[:2]).lower() == "frame time:":
            (frame_time,) = line._replace(words=line.words[1:]).numbers(1)
            if not FRAME_TIMES[0] <= frame_time <= FRAME_TIMES[1]:
                low, high = FRAME_TIMES
                raise line.mistake(
                    f"a frame time of {low:g} to {high:g} s", f"{frame_time:g}"
                )
            return count, (frame_time, _rate(line.words[2]))
        else:
            raise line.mistake("Frames: and Frame Time:")


def _rate(word: str) -> float:
    """Return the rate of a frame time, which may have been rounded or cut off."""
    frame_time = Decimal(word)
    rate = 1.0 / float(frame_time)
    if abs(rate - round(rate)) < WHOLE_RATE * rate:
        return float(round(rate))
    digits = frame_time.as_tuple().exponent
    last = 10.0**digits if isinstance(digits, int) else 0.0

    def off(usual: float) -> float:
        return abs(1.0 / usual - float(frame_time))

    # rounded, or else cut off
    for most in (0.5 * last, last):
        for usual in USUAL_RATES:
            nearest = min(usual, key=off)
            if off(nearest) <= most:
                return float(nearest)
    return rate


def _channels(line: Line) -> list[tuple[bool, int]]:
    """Return the channels of a joint, in order."""
    channels = []
    for word in line.words[2:]:
        axis = "XYZ".find(word[:1].upper())
        kind = word[1:].lower()
        if axis < 0 or kind not in ("position", "rotation"):
            raise line.mistake("channels such as Xposition or Zrotation")
        channels.append((kind == "rotation", axis))
    # a wrong count would shift the columns of all joints that follow
    counted = line.words[1:2] == [str(len(channels))] and len(channels) <= 6
    if not counted or len(set(channels)) != len(channels):
        raise line.mistake("a number of at most 6 channels, and these channels")
    return channels


def _rig(nodes: Sequence[_Node], values: Array) -> Rig:
    """Return the joints of a file, at rest and in each frame.

    Raises:
        InputError: They are not the joints of a person.
    """
    names = [node.name for node in nodes]
    parents = [node.parent for node in nodes]
    joints = joints_of(names, parents)
    if isinstance(joints, list):
        raise InputError(
            f"a person's joints, got a person without {cut(', '.join(joints), 200)}"
        )
    # fingers and other details are not needed, and files have hundreds of them
    wanted: set[int] = set()  # the joints of the person, and all nodes above them
    for number in (
        joints.hips,
        joints.chest,
        *joints.limbs.values(),
        *joints.spine,
        *joints.neck,
        joints.head or 0,
    ):
        while number >= 0 and number not in wanted:
            wanted.add(number)
            number = parents[number]
    shape = (len(nodes), len(values), 3)
    rest = np.zeros((len(nodes), 3))
    turns = np.zeros((*shape, 3))
    places = np.zeros(shape)
    for number, (node, above) in enumerate(zip(nodes, parents, strict=True)):
        assert node.offset is not None
        rest[number] = node.offset + (rest[above] if above >= 0 else 0.0)
        if number in wanted:
            turn, offset = _movement(node, values)
            if above < 0:
                turns[number] = turn
                places[number] = offset
            else:
                carried = np.einsum("tij,tj->ti", turns[above], offset)
                turns[number] = turns[above] @ turn
                places[number] = places[above] + carried
    at_rest = np.tile(np.eye(3), (len(nodes), 1, 1))
    return Rig(names, parents, joints, (at_rest, rest), (turns, places))


def _others(rig: Rig) -> list[str]:
    """Return the names of other roots, and of other people below the same root."""
    above = [rig.joints.hips]
    while rig.parents[above[-1]] >= 0:
        above.append(rig.parents[above[-1]])
    thigh = part_of(rig.names[rig.joints.limbs["left", "thigh"]])
    others = list[int]()
    for number, name in enumerate(rig.names):
        part = part_of(name)
        is_thigh = (part.side, part.part) == (thigh.side, thigh.part)
        if rig.parents[number] >= 0 and not is_thigh:
            continue
        # the first node on the way down that is no longer above the person
        top = number
        while rig.parents[top] >= 0 and rig.parents[top] not in above:
            top = rig.parents[top]
        of_the_person = top in above or rig.parents[top] == rig.joints.hips
        if not of_the_person and top not in others:
            others.append(top)
    return [rig.names[other] for other in others]


def _movement(node: _Node, values: Array) -> tuple[Array, Array]:
    """Return a node's turn (T or 1, 3, 3) and place (T, 3) relative to its parent."""
    assert node.offset is not None
    turn = np.eye(3)[None]
    offset = np.tile(node.offset, (len(values), 1))
    positions = []
    for column, (turning, axis) in enumerate(node.channels, node.column):
        if turning:
            turn = turn @ rotation_about(axis, np.radians(values[:, column]))
        else:
            offset[:, axis] = values[:, column]
            positions.append(axis)
    if positions and node.parent >= 0:
        at_rest = node.offset[positions]
        stated = offset[:, positions]
        # some programs write the displacement from the offset, others the position
        if np.abs(stated).mean() < np.abs(stated - at_rest).mean():
            offset[:, positions] += at_rest
    return turn, offset


def write_bvh(path: str | Path, motion: Motion) -> None:
    """Write a motion as a .bvh file, in metres and y up.

    The file reads back as the same motion of a skeleton with the same bones. Joints
    have the names of the CMU conversions. BVH counts angles about other axes, so that
    the poses that come back differ, while the joints do not.
    """
    lines = ["HIERARCHY"]
    order = []

    def visit(joint: int, depth: int) -> None:
        tab = "\t" * depth
        above = PARENTS[joint]
        where = np.zeros(3)
        if above > 0:
            where = motion.skeleton.offsets[above - 1]
        order.append(joint)
        lines.append(f"{tab}{'JOINT' if joint else 'ROOT'} {NAMES[JOINTS[joint]]}")
        if joint == 0:
            channels = "6 Xposition Yposition Zposition"
        else:
            channels = "3"
        lines.extend(
            [
                f"{tab}{{",
                f"{tab}\tOFFSET {_plain(where)}",
                f"{tab}\tCHANNELS {channels} {ROTATIONS}",
            ]
        )
        for child, parent in enumerate(PARENTS):
            if parent == joint:
                visit(child, depth + 1)
        if joint in ENDS:
            end = _plain(motion.skeleton.offsets[joint - 1])
            lines.extend(
                [
                    f"{tab}\tEnd Site",
                    f"{tab}\t{{",
                    f"{tab}\t\tOFFSET {end}",
                    f"{tab}\t}}",
                ]
            )
        lines.append(f"{tab}}}")

    visit(0, 0)
    turns = motion.skeleton.turns(motion.poses)[order]
    # in the order of ROTATIONS: Z, X, Y
    radians = np.swapaxes(angles_about((2, 0, 1), turns), 0, 1)  # (T, joints, 3)
    angles = np.degrees(steady_angles(radians)).reshape(len(motion), -1)
    lines += ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {1.0 / motion.fps!r}"]
    for row in np.hstack([motion.translations, angles]):
        lines.append(_plain(row))
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _plain(values: Array) -> str:
    return " ".join(f"{value:.9f}" for value in values)
