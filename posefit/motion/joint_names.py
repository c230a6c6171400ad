"""Recognises the joints of another program's skeleton by name and position in the tree.

The names of many programs are known: Acclaim, the CMU conversions by cgspeed,
MotionBuilder and HumanIK, Mixamo, LAFAN1, Bandai Namco, 3ds Max's Biped, Biovision,
Xsens, Poser, SMPL, Unreal, VRM, Blender and freemocap. Namespaces, prefixes, numbers
and the spelling of sides do not matter: `mixamorig:LeftUpLeg`, `Bip01 L Thigh` and
`thigh.L` are the same joint. Limbs are found by the names of their joints; all joints
between legs and arms are the spine.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise, product
from typing import NamedTuple

# each joint of a side, outwards: its names, and names that other joints have, too
_LIMBS: Mapping[str, tuple[set[str], set[str]]] = {
    "thigh": ({"upleg", "upperleg", "thigh", "femur", "uleg", "legupper"}, {"hip"}),
    "shin": (
        {
            "leg",
            "lowleg",
            "lowerleg",
            "shin",
            "shank",
            "calf",
            "knee",
            "tibia",
            "leglower",
        },
        set(),
    ),
    "foot": ({"foot", "ankle"}, set()),
    "toe": ({"toe", "toes", "toebase", "ball", "footindex", "forefoot"}, set()),
    "clavicle": ({"clavicle", "collar", "collarbone"}, {"shoulder"}),
    "arm": (
        {"arm", "uparm", "upperarm", "uarm", "shldr", "humerus", "armupper"},
        {"shoulder"},
    ),
    "forearm": (
        {"forearm", "lowarm", "lowerarm", "farm", "elbow", "radius", "armlower"},
        set(),
    ),
    "hand": ({"hand", "wrist"}, set()),
    "palm": (
        {"fingerbase", "handmiddle", "middle", "fmiddle", "handmid", "mid"},
        set(),
    ),
}
_MIDDLE = {
    "head": {"head", "face", "skull"},
    "neck": {"neck", "lowerneck", "upperneck"},
}
_SIDES = {"left": "left", "right": "right", "l": "left", "r": "right"}
# two letters that join side and limb, as in LUArm and RFArm
_JOINED = {
    "lu": ("left", "u"),
    "ru": ("right", "u"),
    "lf": ("left", "f"),
    "rf": ("right", "f"),
}
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
_KNOWN = set[str]().union(*_MIDDLE.values())
for _sure, _possible in _LIMBS.values():
    _KNOWN |= _sure | _possible
_ENDINGS = {"joint", "jnt", "bone"}
LEGS = ("thigh", "shin", "foot")
ARMS = ("arm", "forearm", "hand")
NEEDED = tuple(product(("left", "right"), (*LEGS, *ARMS)))
LONGEST_NAME = 200  # characters; of a longer name only the end is read


class Part(NamedTuple):
    """Content of a name: side, part in one word, number of other words before it."""

    side: str
    part: str
    others: int


def part_of(name: str) -> Part:
    """Return the content of a joint's name. If no part is known, the part is ""."""
    # some programs put a namespace before a name, as in `mixamorig:Hips`
    last = name[-LONGEST_NAME:].rpartition(":")[2]
    words = [word.lower() for word in _WORD.findall(last)]
    sides: list[str] = []
    rest: list[str] = []
    for word in words:
        if word in _SIDES:
            sides.append(_SIDES[word])
        elif word in _JOINED:
            side, letter = _JOINED[word]
            sides.append(side)
            rest.append(letter)
        # a side's letter before the part, such as lThigh in lower case, or lfemur
        elif word not in _KNOWN and word[0] in "lr" and word[1:] in _KNOWN:
            sides.append(_SIDES[word[0]])
            rest.append(word[1:])
        else:
            for side in ("left", "right"):  # leftarm
                if word.startswith(side) and word[len(side) :] in _KNOWN:
                    sides.append(side)
                    word = word[len(side) :]
            rest.append(word)
    side = sides[-1] if sides else ""
    # such as the `joint` of `left_hip_joint`, which says nothing
    while rest and rest[-1] in _ENDINGS:
        rest.pop()
    for others in range(len(rest)):
        if (part := "".join(rest[others:])) in _KNOWN:
            return Part(side, part, others)
    return Part(side, "", 0)


class Joints(NamedTuple):
    """Which nodes of a tree are a person's joints.

    Attributes:
        limbs: Nodes by side and joint, such as ("left", "thigh"); at least `NEEDED`.
        hips: The node from which the legs start.
        chest: The node from which arms and head start.
        spine: Nodes between the hips and the joint that carries the neck, which is
            the last one.
        neck: Nodes from the base of the neck up to the head, which is not included.
        head: The head's node, or None.
    """

    limbs: Mapping[tuple[str, str], int]
    hips: int
    chest: int
    spine: Sequence[int]
    neck: Sequence[int]
    head: int | None


def joints_of(names: Sequence[str], parents: Sequence[int]) -> Joints | list[str]:
    """Return a person's joints in a tree, or the names of missing joints.

    Args:
        names: Names of the nodes, "" for the end of a bone without a further joint.
        parents: Their parents, which come before them; -1 for a root.

    Returns:
        The joints, or a list of missing ones.
    """
    parts = [part_of(name) for name in names]
    paths: list[list[int]] = []  # for each node, the nodes from a root to it
    for node, parent in enumerate(parents):
        path = paths[parent] if parent >= 0 else []
        paths.append([*path, node])
    limbs: dict[tuple[str, str], int] = {}
    for side in ("left", "right"):
        for joint, node in _limbs(side, parts, paths).items():
            limbs[side, joint] = node
        # a limb may end at an ankle or a wrist without a name
        for above, end in (("shin", "foot"), ("forearm", "hand")):
            last = limbs.get((side, above))
            for child, parent in enumerate(parents):
                if parent == last and not names[child]:
                    limbs.setdefault((side, end), child)
    if missing := _missing(limbs, names, paths):
        return missing
    legs = [limbs[side, "thigh"] for side in ("left", "right")]
    arms = [limbs[side, "arm"] for side in ("left", "right")]
    hips = _common(paths, legs)
    heads = []
    necks = []
    for node, part in enumerate(parts):
        if part.part in _MIDDLE["head"] and not part.side:
            heads.append(node)
        if part.part == "neck" and not part.side:
            necks.append(node)

    def unlikeness_to_head(node: int) -> tuple[bool, int, int]:
        part = parts[node]
        return part.part != "head", part.others, len(paths[node])

    head = min(heads, key=unlikeness_to_head, default=None)
    # the chest is the last joint before arms and head part
    above_chest = arms if head is None else [*arms, head]
    chest = _common(paths, above_chest)
    if hips is None or chest is None:
        return ["a root from which legs, arms and head go"]
    # the legs would otherwise hang from the chest or from another person
    if hips not in paths[chest]:
        return [f"arms and head above the hips ({names[hips]!r})"]
    spine = paths[chest][paths[chest].index(hips) + 1 :]
    neck: list[int] = []
    if head is not None:
        neck = paths[head][paths[head].index(chest) + 1 : -1]
    elif necks:
        lowest = min(necks, key=lambda node: len(paths[node]))
        if chest in paths[lowest]:
            neck = paths[lowest][paths[lowest].index(chest) + 1 :]
    # the shoulders of Biped hang from the neck
    if parts[chest].part == "neck" and spine:
        neck = [spine[-1], *neck]
        spine = spine[:-1]
    return Joints(limbs, hips, chest, spine, neck, head)


# pairs of nodes that may have names of the same joint: `leg` and below it `knee`,
# `ankle` and `foot`, `wrist` and `hand`
_TWO_IN_A_ROW = {
    "shin": ("thigh", "shin"),
    "foot": ("foot", "toe"),
    "hand": ("hand", "palm"),
}


def _limbs(
    side: str, parts: Sequence[Part], paths: Sequence[Sequence[int]]
) -> dict[str, int]:
    """Return the joints of a side's arm and leg.

    If several nodes have names of the same joint, the nearest to the root is taken.
    """

    def nodes_named(names: set[str]) -> list[int]:
        """Return the nodes with the fewest other words in their names, root first."""
        nodes = []
        for node, part in enumerate(parts):
            if part.side == side and part.part in names:
                nodes.append(node)
        fewest = min((parts[node].others for node in nodes), default=0)
        plainest = [node for node in nodes if parts[node].others == fewest]
        return sorted(plainest, key=lambda node: len(paths[node]))

    nodes = {}
    for joint, (names, _) in _LIMBS.items():
        nodes[joint] = nodes_named(names)
    # `shoulder` is the arm, unless there is an `upperarm` below: then the clavicle
    for joint in ("thigh", "arm", "clavicle"):
        if not nodes[joint] and not (
            joint == "clavicle" and nodes["arm"] == nodes_named({"shoulder"})
        ):
            nodes[joint] = nodes_named(_LIMBS[joint][1])
    for joint, (above, below) in _TWO_IN_A_ROW.items():
        absent = below if joint == above else above
        two = nodes[joint]
        if not nodes[absent] and len(two) > 1 and two[0] in paths[two[1]]:
            nodes[above] = two[:1]
            nodes[below] = two[1:]
    nearest = {}
    for joint, named in nodes.items():
        if named:
            nearest[joint] = named[0]
    return nearest


def _missing(
    limbs: Mapping[tuple[str, str], int],
    names: Sequence[str],
    paths: Sequence[Sequence[int]],
) -> list[str]:
    """Return what limbs lack: a joint, or its place below the joint before it."""
    missing = []
    for side, joint in NEEDED:
        if (side, joint) not in limbs:
            missing.append(f"{side} {joint}")
    for side in ("left", "right"):
        for above, below in (*pairwise(LEGS), *pairwise(ARMS)):
            first = limbs.get((side, above))
            second = limbs.get((side, below))
            if (
                first is not None
                and second is not None
                and first not in paths[second][:-1]
            ):
                missing.append(
                    f"{side} {below} ({names[second]!r}) "
                    f"under {side} {above} ({names[first]!r})"
                )
    return missing


def _common(paths: Sequence[Sequence[int]], nodes: Sequence[int]) -> int | None:
    """Return the last node on the paths to all the nodes, or None."""
    last = None
    for steps in zip(*(paths[node] for node in nodes), strict=False):
        if len(set(steps)) == 1:
            last = steps[0]
    return last
