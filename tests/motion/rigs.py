"""Skeletons as many programs write them, drawn by hand: the names of their joints, their trees and poses of rest.

Each moves as one of posefit's motions does: its joints turn as the bones do that start there. `places_of` says where
the joints of a file are, slowly, from the definition of BVH.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from posefit import JOINTS, Motion
from posefit.arrays import Array
from posefit.geometry.rotation import shortest_turn
from posefit.measuring.segments import bone_rotations
from tests.geometry.turns import about

# of each joint of a rig: after which of posefit's joints its bone starts, and which
# bone it turns as
BONES = {
    "hips": ("root", "root"),
    "thigh": ("{}hipjoint", "{}femur"),
    "shin": ("{}femur", "{}tibia"),
    "foot": ("{}tibia", "{}foot"),
    "toe": ("{}foot", "{}toes"),
    "spine": ("root", "lowerback"),
    "spine1": ("lowerback", "upperback"),
    "chest": ("upperback", "thorax"),
    "neck": ("thorax", "lowerneck"),
    "neck1": ("lowerneck", "upperneck"),
    "head": ("upperneck", "upperneck"),
    "clavicle": ("thorax", "{}clavicle"),
    "arm": ("{}clavicle", "{}humerus"),
    "forearm": ("{}humerus", "{}radius"),
    "hand": ("{}radius", "{}wrist"),
}
LEG = ("thigh", "shin", "foot", "toe")
ARM = ("clavicle", "arm", "forearm", "hand")
SHORT = ("L", "R")
TRUNK = ("spine", "spine1", "chest", "neck", "neck1", "head")


@dataclass(frozen=True)
class Style:
    """How a program writes a person: a name for each joint, with {} for the side; what has none is not there."""

    names: Mapping[str, str]
    sides: tuple[str, str] = ("Left", "Right")
    above: tuple[str, ...] = ()  # joints between the file's root and the hips
    order: str = "ZXY"
    positions: bool = False  # whether each joint has six channels
    # joints where others have End Sites
    ends: Mapping[str, str] = field(default_factory=dict)
    shoulders_on: str = "chest"
    no_ends: bool = False


NAMES = """\
mixamo | Hips, {}UpLeg, {}Leg, {}Foot, {}ToeBase, Spine, Spine1, Spine2, Neck, -, Head, {}Shoulder, {}Arm, {}ForeArm, {}Hand
motionbuilder | Hips, {}UpLeg, {}Leg, {}Foot, {}ToeBase, Spine, Spine1, Spine2, Neck, Neck1, Head, {}Shoulder, {}Arm, {}ForeArm, {}Hand
lafan1 | Hips, {}UpLeg, {}Leg, {}Foot, {}Toe, Spine, Spine1, Spine2, Neck, -, Head, {}Shoulder, {}Arm, {}ForeArm, {}Hand
rokoko | Hips, {}Thigh, {}Shin, {}Foot, {}Toe, Spine, Spine1, Spine2, Neck, -, Head, {}Shoulder, {}Arm, {}ForeArm, {}Hand
without a spine | Hips, {}UpLeg, {}Leg, {}Foot, -, -, -, -, -, -, Head, -, {}Arm, {}ForeArm, {}Hand
bandai-namco | Hips, UpperLeg_{}, LowerLeg_{}, Foot_{}, Toes_{}, Spine, -, Chest, Neck, -, Head, Shoulder_{}, UpperArm_{}, LowerArm_{}, Hand_{}
biped | Pelvis, {} Thigh, {} Calf, {} Foot, {} Toe0, Spine, -, Spine1, Neck, -, Head, {} Clavicle, {} UpperArm, {} Forearm, {} Hand
biovision | Hips, {}Hip, {}Knee, {}Ankle, {}Toe, Chest, -, Chest2, Neck, -, Head, {}Collar, {}Shoulder, {}Elbow, {}Wrist
biovision without toes | Hips, {}Hip, {}Knee, {}Ankle, -, Chest, -, Chest2, Neck, -, Head, {}Collar, {}Shoulder, {}Elbow, {}Wrist
biovision to wrists and ankles | Hips, {}Hip, {}Knee, -, -, Chest, -, Chest2, Neck, -, Head, {}Collar, {}Shoulder, {}Elbow, -
poser | hip, {}Thigh, {}Shin, {}Foot, -, abdomen, -, chest, neck, -, head, {}Collar, {}Shldr, {}ForeArm, {}Hand
smpl | Pelvis, {}_Hip, {}_Knee, {}_Ankle, {}_Foot, Spine1, Spine2, Spine3, Neck, -, Head, {}_Collar, {}_Shoulder, {}_Elbow, {}_Wrist
unreal | pelvis, thigh_{}, calf_{}, foot_{}, ball_{}, spine_01, spine_02, spine_03, neck_01, -, head, clavicle_{}, upperarm_{}, lowerarm_{}, hand_{}
vrm | C_Hips, {}_UpperLeg, {}_LowerLeg, {}_Foot, {}_ToeBase, C_Spine, C_Chest, C_UpperChest, C_Neck, -, C_Head, {}_Shoulder, {}_UpperArm, {}_LowerArm, {}_Hand
freemocap | pelvis, thigh.{}, shin.{}, foot.{}, -, spine, -, spine.001, neck, -, face, shoulder.{}, upper_arm.{}, forearm.{}, hand.{}
motive | Hip, {}Thigh, {}Shin, {}Foot, {}Toe, Ab, -, Chest, Neck, -, Head, {}Shoulder, {}UArm, {}FArm, {}Hand
"""  # of each program, in the order of `BONES`; - is none
PROGRAMS = dict(line.split(" | ") for line in NAMES.splitlines())


def named(program: str, prefix: str = "") -> dict[str, str]:
    """Return a program's names of the joints."""
    names = zip(BONES, PROGRAMS[program].split(", "), strict=True)
    return {joint: prefix + name for joint, name in names if name != "-"}


STYLES: dict[str, Style] = {
    "mixamo": Style(
        named("mixamo", "mixamorig:"),
        ends={"head": "mixamorig:HeadTop_End", "toe": "mixamorig:{}Toe_End"},
    ),
    "mixamo without colons": Style(named("mixamo", "mixamorig1_")),
    "humanik": Style(
        named("mixamo", "Character1_"),
        above=("Character1_Reference",),
        order="ZYX",
        positions=True,
    ),
    "motionbuilder": Style(named("motionbuilder"), order="XYZ", positions=True),
    "lafan1": Style(named("lafan1"), order="ZYX", positions=True),
    "rokoko": Style(named("rokoko")),
    "without a spine": Style(named("without a spine"), shoulders_on="hips"),
    "bandai-namco": Style(
        named("bandai-namco"), SHORT, above=("joint_Root",), positions=True, order="XYZ"
    ),
    "biped": Style(
        named("biped", "Bip01 "), SHORT, above=("Bip01",), shoulders_on="neck"
    ),
    "biovision": Style(named("biovision")),
    "biovision without toes": Style(named("biovision without toes")),
    "biovision to wrists and ankles": Style(named("biovision to wrists and ankles")),
    "poser": Style(named("poser"), ("l", "r"), order="XZY"),
    "smpl": Style(named("smpl"), SHORT),
    "unreal": Style(named("unreal"), ("l", "r"), above=("root",)),
    "vrm": Style(named("vrm", "J_Bip_"), SHORT, no_ends=True),
    "freemocap": Style(named("freemocap"), SHORT),
    "motive": Style(named("motive", "Skeleton 001:"), SHORT),
}


def joint_after(role: str, style: Style) -> str:
    """Return after which of posefit's joints a role's joint is where a rig has fewer of neck and spine than posefit."""
    if role == "head" and "neck1" not in style.names:
        return "lowerneck"
    return (
        "lowerback"
        if role == "chest" and "spine1" not in style.names
        else BONES[role][0]
    )


@dataclass
class _Joint:
    role: str
    name: str
    parent: int
    turn: Array  # (T, 3, 3) in the world, from posefit's rest
    place: Array  # (3,) at posefit's rest
    axes: Array  # (3, 3) of the rig's joint there
    tip: Array | None = None  # (3,) at posefit's rest


def write_rig(
    path: Path,
    motion: Motion,
    style: Style,
    scale: float = 1.0,
    world: Array | None = None,
    rest: str = "cmu",
) -> Path:
    """Write a motion as a program would: lengths times `scale`, the world turned, another pose of rest.

    At rest, `cmu` is posefit's own pose, `t` has legs straight down, and `along x` lays all bones along x.
    """
    skeleton = motion.skeleton
    turns = bone_rotations(motion.skeleton, motion.poses)
    at_rest = skeleton.joints(np.zeros(66))
    joints: list[_Joint] = []
    numbers: dict[str, int] = {}

    def add(role: str, side: str, parent: int) -> int:
        letter = side[:1].lower()
        starts, turning = (
            JOINTS.index(name.format(letter))
            for name in (joint_after(role, style), BONES[role][1])
        )
        axes = _axes(rest, role, skeleton.offsets[turning - 1])
        name = style.names[role].format(side)
        joints.append(
            _Joint(side + role, name, parent, turns[:, turning], at_rest[starts], axes)
        )
        numbers[side + role] = len(joints) - 1
        return len(joints) - 1

    parent = -1
    for name in style.above:
        still = np.tile(np.eye(3), (len(motion), 1, 1))
        joints.append(_Joint("", name, parent, still, np.zeros(3), np.eye(3)))
        parent = len(joints) - 1
    hips = parent = add("hips", "", parent)
    for role in TRUNK:
        parent = add(role, "", parent) if role in style.names else parent
    joints[parent].tip = at_rest[JOINTS.index("head")]
    for side in style.sides:
        letter = side[0].lower()
        for chain, start, end in (
            (LEG, hips, "toes"),
            (ARM, numbers[style.shoulders_on], "hand"),
        ):
            parent = start
            for role in chain:
                parent = add(role, side, parent) if role in style.names else parent
            # it ends at the ankle or the wrist
            lacks = chain[2 if chain is LEG else 3] not in style.names
            last = end if not lacks else "tibia" if chain is LEG else "radius"
            joints[parent].tip = at_rest[JOINTS.index(letter + last)]
    if style.no_ends:
        for joint in joints:
            joint.tip = None
    around = np.eye(3) if world is None else world
    turned = [joint.turn @ joint.axes for joint in joints]
    turned = [
        turned[0] if style.above else around @ turned[0],
        *(around @ turn for turn in turned[1:]),
    ]
    lines = ["HIERARCHY"]
    columns = list[Array]()

    def visit(number: int, depth: int) -> None:
        joint = joints[number]
        tab = "\t" * depth
        above = joints[joint.parent] if joint.parent >= 0 else None
        offset = (
            np.zeros(3)
            if above is None
            else scale * above.axes.T @ (joint.place - above.place)
        )
        moves = joint.role == "hips" or style.positions
        channels = "Xposition Yposition Zposition " if moves else ""
        channels += " ".join(f"{axis}rotation" for axis in style.order)
        lines.extend(
            [f"{tab}{'ROOT' if above is None else 'JOINT'} {joint.name}", f"{tab}{{"]
        )
        lines.extend(
            [
                f"{tab}\tOFFSET {_spaced(offset)}",
                f"{tab}\tCHANNELS {6 if moves else 3} {channels}",
            ]
        )
        if joint.role == "hips":
            columns.append(scale * motion.translations @ around.T)
        elif moves:
            columns.append(np.tile(offset, (len(motion), 1)))
        local = (
            turned[number]
            if above is None
            else np.swapaxes(turned[joint.parent], 1, 2) @ turned[number]
        )
        columns.append(Rotation.from_matrix(local).as_euler(style.order, degrees=True))
        for child, each in enumerate(joints):
            if each.parent == number:
                visit(child, depth + 1)
        if joint.tip is not None:
            end = _spaced(scale * joint.axes.T @ (joint.tip - joint.place))
            name = next(
                (
                    text
                    for role, text in style.ends.items()
                    if joint.role.endswith(role)
                ),
                "",
            )
            if name:
                name = name.format(joint.role.removesuffix("toe"))
                lines.extend(
                    [f"{tab}\tJOINT {name}", f"{tab}\t{{", f"{tab}\t\tOFFSET {end}"]
                )
                lines.extend(
                    [f"{tab}\t\tCHANNELS 3 Zrotation Xrotation Yrotation", f"{tab}\t}}"]
                )
                columns.append(np.zeros((len(motion), 3)))
            else:
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
    lines += ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {1.0 / motion.fps!r}"]
    lines += [_spaced(row) for row in np.hstack(columns)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def places_of(path: Path) -> dict[str, Array]:
    """Return where the joints of a file are (T, 3) in its own unit and world, by name; an End Site is its `NAME end`."""
    head, table = path.read_text().split("MOTION\n")
    rows = np.array([line.split() for line in table.splitlines()[2:]], dtype=np.float64)
    places: dict[str, Array] = {}
    stack: list[tuple[Array, Array]] = [
        (np.zeros((len(rows), 3)), np.tile(np.eye(3), (len(rows), 1, 1)))
    ]
    name = ""
    offset = np.zeros(3)
    column = 0
    for words in map(str.split, head.splitlines()):
        if words[0] in ("ROOT", "JOINT", "End"):
            name = f"{name} end" if words[0] == "End" else " ".join(words[1:])
        elif words[0] == "OFFSET":
            offset = np.array(words[1:], dtype=np.float64)
            if name.endswith(" end"):
                places[name] = stack[-1][0] + stack[-1][1] @ offset
                stack.append(stack[-1])
        elif words[0] == "CHANNELS":
            start, turn = stack[-1]
            moved = np.tile(offset, (len(rows), 1))
            for channel in words[2:]:
                axis = "XYZ".index(channel[0])
                values = rows[:, column]
                column += 1
                if channel.endswith("position"):
                    moved[:, axis] = values
                else:
                    turn = turn @ np.array(
                        [about(axis, angle) for angle in np.radians(values)]
                    )
            places[name] = start + np.einsum("tij,tj->ti", stack[-1][1], moved)
            stack.append((places[name], turn))
        elif words[0] == "}":
            stack.pop()
    return places


def _axes(rest: str, role: str, offset: Array) -> Array:
    """Return how a rig's joint is turned in posefit's rest, which is none in its own."""
    if rest == "cmu":
        return np.eye(3)
    if rest == "t":
        down = role in LEG[:2]
        return (
            shortest_turn(offset, np.array([0.0, -1.0, 0.0])).T if down else np.eye(3)
        )
    if role == "hips":
        # its x is up, y ahead, z left
        return np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    return np.asarray(shortest_turn(offset, np.array([1.0, 0.0, 0.0])).T)


def _spaced(values: Array) -> str:
    return " ".join(f"{value:.7f}" for value in values)
