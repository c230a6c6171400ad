"""Skeletons as many programs write them, drawn by hand: the names of their joints, their trees and poses of rest.

Each moves as one of posefit's motions does: its joints turn as the bones do that start there. `places_of` says where
the joints of a file are, slowly, from the definition of BVH.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.geometry.rotation import shortest_turn
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.segments import bone_rotations
from posefit.motion.motion import Motion
from tests.geometry.turns import about

BONES = {  # of each joint of a rig: after which of posefit's joints its bone starts, and which bone it turns as
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
TRUNK = ("spine", "spine1", "chest", "neck", "neck1", "head")


@dataclass(frozen=True)
class Style:
    """How a program writes a person: a name for each joint, with {} for the side; what has none is not there."""

    names: Mapping[str, str]
    sides: tuple[str, str] = ("Left", "Right")
    above: tuple[str, ...] = ()  # joints between the file's root and the hips
    order: str = "ZXY"
    positions: bool = False  # whether each joint has six channels
    ends: Mapping[str, str] = field(default_factory=dict)  # joints where others have End Sites
    shoulders_on: str = "chest"
    no_ends: bool = False


def named(prefix: str = "", **names: str) -> dict[str, str]:
    return {joint: prefix + name for joint, name in names.items()}


MIXAMO = {
    "hips": "Hips", "spine": "Spine", "spine1": "Spine1", "chest": "Spine2", "neck": "Neck", "head": "Head",
    "clavicle": "{}Shoulder", "arm": "{}Arm", "forearm": "{}ForeArm", "hand": "{}Hand",
    "thigh": "{}UpLeg", "shin": "{}Leg", "foot": "{}Foot", "toe": "{}ToeBase",
}  # fmt: skip
LAFAN1 = {**MIXAMO, "toe": "{}Toe"}
BIOVISION = {
    "hips": "Hips", "spine": "Chest", "chest": "Chest2", "neck": "Neck", "head": "Head",
    "clavicle": "{}Collar", "arm": "{}Shoulder", "forearm": "{}Elbow", "hand": "{}Wrist",
    "thigh": "{}Hip", "shin": "{}Knee", "foot": "{}Ankle", "toe": "{}Toe",
}  # fmt: skip
STYLES: dict[str, Style] = {
    "mixamo": Style(named("mixamorig:", **MIXAMO), ends={"head": "mixamorig:HeadTop_End", "toe": "mixamorig:{}Toe_End"}),
    "mixamo without colons": Style(named("mixamorig1_", **MIXAMO)),
    "humanik": Style(named("Character1_", **MIXAMO), above=("Character1_Reference",), order="ZYX", positions=True),
    "motionbuilder": Style({**MIXAMO, "neck1": "Neck1"}, order="XYZ", positions=True),
    "lafan1": Style(LAFAN1, order="ZYX", positions=True),
    "bandai-namco": Style(
        {
            "hips": "Hips", "spine": "Spine", "chest": "Chest", "neck": "Neck", "head": "Head",
            "clavicle": "Shoulder_{}", "arm": "UpperArm_{}", "forearm": "LowerArm_{}", "hand": "Hand_{}",
            "thigh": "UpperLeg_{}", "shin": "LowerLeg_{}", "foot": "Foot_{}", "toe": "Toes_{}",
        }, ("L", "R"), above=("joint_Root",), positions=True, order="XYZ",
    ),
    "biped": Style(
        named(
            "Bip01 ", hips="Pelvis", spine="Spine", chest="Spine1", neck="Neck", head="Head",
            clavicle="{} Clavicle", arm="{} UpperArm", forearm="{} Forearm", hand="{} Hand",
            thigh="{} Thigh", shin="{} Calf", foot="{} Foot", toe="{} Toe0",
        ), ("L", "R"), above=("Bip01",), shoulders_on="neck",
    ),
    "biovision": Style(BIOVISION),
    "biovision without toes": Style({joint: name for joint, name in BIOVISION.items() if joint != "toe"}),
    "biovision to wrists and ankles": Style(
        {joint: name for joint, name in BIOVISION.items() if joint not in ("hand", "foot", "toe")}
    ),
    "poser": Style(
        {
            "hips": "hip", "spine": "abdomen", "chest": "chest", "neck": "neck", "head": "head",
            "clavicle": "{}Collar", "arm": "{}Shldr", "forearm": "{}ForeArm", "hand": "{}Hand",
            "thigh": "{}Thigh", "shin": "{}Shin", "foot": "{}Foot",
        }, ("l", "r"), order="XZY",
    ),
    "smpl": Style(
        {
            "hips": "Pelvis", "spine": "Spine1", "spine1": "Spine2", "chest": "Spine3", "neck": "Neck", "head": "Head",
            "clavicle": "{}_Collar", "arm": "{}_Shoulder", "forearm": "{}_Elbow", "hand": "{}_Wrist",
            "thigh": "{}_Hip", "shin": "{}_Knee", "foot": "{}_Ankle", "toe": "{}_Foot",
        }, ("L", "R"),
    ),
    "unreal": Style(
        {
            "hips": "pelvis", "spine": "spine_01", "spine1": "spine_02", "chest": "spine_03", "neck": "neck_01", "head": "head",
            "clavicle": "clavicle_{}", "arm": "upperarm_{}", "forearm": "lowerarm_{}", "hand": "hand_{}",
            "thigh": "thigh_{}", "shin": "calf_{}", "foot": "foot_{}", "toe": "ball_{}",
        }, ("l", "r"), above=("root",),
    ),
    "vrm": Style(
        named(
            "J_Bip_", hips="C_Hips", spine="C_Spine", spine1="C_Chest", chest="C_UpperChest", neck="C_Neck", head="C_Head",
            clavicle="{}_Shoulder", arm="{}_UpperArm", forearm="{}_LowerArm", hand="{}_Hand",
            thigh="{}_UpperLeg", shin="{}_LowerLeg", foot="{}_Foot", toe="{}_ToeBase",
        ), ("L", "R"), no_ends=True,
    ),
    "freemocap": Style(
        {
            "hips": "pelvis", "spine": "spine", "chest": "spine.001", "neck": "neck", "head": "face",
            "clavicle": "shoulder.{}", "arm": "upper_arm.{}", "forearm": "forearm.{}", "hand": "hand.{}",
            "thigh": "thigh.{}", "shin": "shin.{}", "foot": "foot.{}",
        }, ("L", "R"),
    ),
    "motive": Style(
        named(
            "Skeleton 001:", hips="Hip", spine="Ab", chest="Chest", neck="Neck", head="Head",
            clavicle="{}Shoulder", arm="{}UArm", forearm="{}FArm", hand="{}Hand",
            thigh="{}Thigh", shin="{}Shin", foot="{}Foot", toe="{}Toe",
        ), ("L", "R"),
    ),
    "rokoko": Style({**MIXAMO, "thigh": "{}Thigh", "shin": "{}Shin", "toe": "{}Toe"}),
    "without a spine": Style(
        {
            "hips": "Hips", "head": "Head", "arm": "{}Arm", "forearm": "{}ForeArm", "hand": "{}Hand",
            "thigh": "{}UpLeg", "shin": "{}Leg", "foot": "{}Foot",
        }, shoulders_on="hips",
    ),
}  # fmt: skip


def joint_after(role: str, style: Style) -> str:
    """Return after which of posefit's joints a role's joint is where a rig has fewer of neck and spine than posefit."""
    if role == "head" and "neck1" not in style.names:
        return "lowerneck"
    return "lowerback" if role == "chest" and "spine1" not in style.names else BONES[role][0]


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
    path: Path, motion: Motion, style: Style, scale: float = 1.0, world: Array | None = None, rest: str = "cmu"
) -> Path:
    """Write a motion as a program would: lengths times `scale`, the world turned, another pose of rest.

    At rest, `cmu` is posefit's own pose, `t` has legs straight down, and `along x` lays all bones along x.
    """
    skeleton, turns = motion.skeleton, bone_rotations(motion.skeleton, motion.poses)
    at_rest = skeleton.joints(np.zeros(66))
    joints: list[_Joint] = []
    numbers: dict[str, int] = {}

    def add(role: str, side: str, parent: int) -> int:
        letter = side[:1].lower()
        starts, turning = (JOINTS.index(name.format(letter)) for name in (joint_after(role, style), BONES[role][1]))
        axes = _axes(rest, role, skeleton.offsets[turning - 1])
        joints.append(
            _Joint(side + role, style.names[role].format(side), parent, turns[:, turning], at_rest[starts], axes)
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
        for chain, start, end in ((LEG, hips, "toes"), (ARM, numbers[style.shoulders_on], "hand")):
            parent = start
            for role in chain:
                parent = add(role, side, parent) if role in style.names else parent
            lacks = chain[2 if chain is LEG else 3] not in style.names  # it ends at the ankle or the wrist
            last = end if not lacks else "tibia" if chain is LEG else "radius"
            joints[parent].tip = at_rest[JOINTS.index(letter + last)]
    if style.no_ends:
        for joint in joints:
            joint.tip = None
    turned = [joint.turn @ joint.axes for joint in joints]
    if world is not None:
        turned = [
            turn if joint.parent < 0 and style.above else world @ turn
            for joint, turn in zip(joints, turned, strict=True)
        ]
    lines, columns = ["HIERARCHY"], list[Array]()

    def visit(number: int, depth: int) -> None:
        joint, tab = joints[number], "\t" * depth
        above = joints[joint.parent] if joint.parent >= 0 else None
        offset = np.zeros(3) if above is None else scale * above.axes.T @ (joint.place - above.place)
        moves = joint.role == "hips" or style.positions
        channels = "Xposition Yposition Zposition " if moves else ""
        channels += " ".join(f"{axis}rotation" for axis in style.order)
        lines.append(f"{tab}{'ROOT' if above is None else 'JOINT'} {joint.name}")
        lines.extend(
            [f"{tab}{{", f"{tab}\tOFFSET {_spaced(offset)}", f"{tab}\tCHANNELS {6 if moves else 3} {channels}"]
        )
        if joint.role == "hips":
            roots = scale * motion.translations
            columns.append(roots if world is None else roots @ world.T)
        elif moves:
            columns.append(np.tile(offset, (len(motion), 1)))
        local = turned[number] if above is None else np.swapaxes(turned[joint.parent], 1, 2) @ turned[number]
        columns.append(Rotation.from_matrix(local).as_euler(style.order, degrees=True))
        for child, each in enumerate(joints):
            if each.parent == number:
                visit(child, depth + 1)
        if joint.tip is not None:
            end = _spaced(scale * joint.axes.T @ (joint.tip - joint.place))
            name = next((text for role, text in style.ends.items() if joint.role.endswith(role)), "")
            if name:
                name = name.format(joint.role.removesuffix("toe"))
                lines.extend([f"{tab}\tJOINT {name}", f"{tab}\t{{", f"{tab}\t\tOFFSET {end}"])
                lines.extend([f"{tab}\t\tCHANNELS 3 Zrotation Xrotation Yrotation", f"{tab}\t}}"])
                columns.append(np.zeros((len(motion), 3)))
            else:
                lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {end}", f"{tab}\t}}"])
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
    stack: list[tuple[Array, Array]] = [(np.zeros((len(rows), 3)), np.tile(np.eye(3), (len(rows), 1, 1)))]
    name, offset, column = "", np.zeros(3), 0
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
                axis, values = "XYZ".index(channel[0]), rows[:, column]
                column += 1
                if channel.endswith("position"):
                    moved[:, axis] = values
                else:
                    turn = turn @ np.array([about(axis, angle) for angle in np.radians(values)])
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
        return shortest_turn(offset, np.array([0.0, -1.0, 0.0])).T if down else np.eye(3)
    if role == "hips":
        return np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])  # its x is up, y ahead, z left
    return np.asarray(shortest_turn(offset, np.array([1.0, 0.0, 0.0])).T)


def _spaced(values: Array) -> str:
    return " ".join(f"{value:.7f}" for value in values)
