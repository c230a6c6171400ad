"""Converts a person's motion from another skeleton: other names, rest, axes and joints.

A rig is a tree whose nodes have places and turns in each frame. Each of posefit's bones
is assigned to one node, and ends at a place that the node carries. Joint angles are
counted from the rest pose of the CMU database: upright, legs apart, arms out, palms
down. How a node is turned there is taken from the rig's own rest pose if that is a
standing person, or else from the frame that is most like it. Each bone is then turned
the shortest way.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations
from typing import NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.rotation import (
    along_y,
    geodesic,
    joint_angles_from_rotation,
    root_angles_from_rotation,
    rotation_about,
    shortest_turn,
    unwrapped,
)
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    ENDS,
    INNER,
    JOINTS,
    PARENTS,
    Skeleton,
    angle_index,
)
from posefit.motion.built_in import average_skeleton
from posefit.motion.joint_names import Joints

SAME_PLACE = 1e-4  # share of a leg within which two joints are at the same point
# degrees: a foot, a clavicle or a bone of the spine within this angle of CMU's rest
# pose is not turned
AS_IN_FILE = 20.0
SAME_DIRECTION = 0.5  # degrees: the same for other bones
UPRIGHT = 60.0  # degrees that legs and trunk may be off in a rest pose
SQUARE = 25.0  # degrees within which a root's axes are snapped to left, up and ahead
STANDING = 0.7  # least mean cosine between legs, trunk and the axis that is up
POSES = 2_000  # most frames that are searched for one like the rest pose
# radians: a turn below this about an axis that CMU's joints lack is a rounding error
MIN_TURN = 1e-5
_ENDS_OF = {
    "hipjoint": "thigh",
    "femur": "shin",
    "tibia": "foot",
    "clavicle": "arm",
    "humerus": "forearm",
    "radius": "hand",
}
# for the bone above a hinge: the joints of the bone below, and which way it bends
_HINGES = {
    "femur": ("shin", "foot", (0.0, 0.0, -1.0)),
    # an elbow bends forwards, and 30 degrees up
    "humerus": ("forearm", "hand", (0.0, 0.5, 0.75**0.5)),
}
# sine of 20 degrees: a knee or an elbow that is bent more shows its axis
BENT = 0.35
_STEADY = ("femur", "tibia", "humerus", "radius", "wrist")


@dataclass(frozen=True, eq=False)
class Rig:
    """A tree with a person's joints, at rest and in motion.

    Attributes:
        names: Names of the nodes, "" for the end of a bone without a further joint.
        parents: Parents of the nodes, -1 for a root.
        joints: Which nodes are the person's joints.
        rest: Turns (nodes, 3, 3) and places (nodes, 3) at rest.
        moving: Turns (nodes, T, 3, 3) and places (nodes, T, 3) in the frames.
    """

    names: Sequence[str]
    parents: Sequence[int]
    joints: Joints
    rest: tuple[Array, Array] = field(repr=False)
    moving: tuple[Array, Array] = field(repr=False)

    def of(self, node: int) -> "_Bone":
        """Return the bone that ends in a node. The node's parent carries it."""
        return _Bone(self.parents[node], self.moving[1][node], self.rest[1][node])

    def ending(self, node: int, tip: Array | None, share: float = 1.0) -> "_Bone":
        """Return the bone that ends in a point of a node.

        The point is a share of the way to the node's tip (3,), if that is known.
        """
        if tip is None:
            return _Bone(node)
        turns, places = self.moving
        rest_turns, rest_places = self.rest
        at = share * tip
        return _Bone(
            node,
            places[node] + turns[node] @ at,
            rest_places[node] + rest_turns[node] @ at,
        )

    def tip(self, node: int, least: float) -> Array | None:
        """Return where a node's bone ends, in the node, or None if nothing is far off.

        The end is the node's farthest End Site, or else the farthest child. `least` is
        how far off it must be.
        """
        children = []
        for child, parent in enumerate(self.parents):
            if parent == node:
                children.append(child)
        turns, places = self.rest
        ends = [child for child in children if not self.names[child]] or children
        tips = [turns[node].T @ (places[end] - places[node]) for end in ends]
        best: Array | None = max(
            tips, key=lambda end: float(np.linalg.norm(end)), default=None
        )
        if best is None or not float(np.linalg.norm(best)) > least:
            return None
        return best

    def length(self, side: str) -> float:
        """Return the mean length of a leg."""
        places = self.moving[1]
        limbs = self.joints.limbs
        thigh = places[limbs[side, "thigh"]]
        shin = places[limbs[side, "shin"]]
        foot = places[limbs[side, "foot"]]
        lengths = np.linalg.norm(shin - thigh, axis=1)  # (T,)
        lengths = lengths + np.linalg.norm(foot - shin, axis=1)
        return float(lengths.mean())


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A rig's motion, converted to a `Skeleton`, in the rig's unit.

    Attributes:
        skeleton: A skeleton with the rig's bones.
        poses: Poses (T, 66).
        places: Positions (T, 3) of the root joint.
        filled: Names of the bones that the rig does not have.
        off: The greatest distance of a joint from its place in the rig.
    """

    skeleton: Skeleton
    poses: Array = field(repr=False)
    places: Array = field(repr=False)
    filled: Sequence[str]
    off: float


@dataclass(frozen=True, eq=False)
class _Bone:
    """The node that carries a bone's end, and the end's place.

    `at` is the place in the frames (T, 3), `rest` the place at rest (3,); None if it is
    unknown.
    """

    node: int
    at: Array | None = None
    rest: Array | None = None

    @classmethod
    def between(cls, node: int, start: "_Bone", end: "_Bone", share: float) -> Self:
        """Return the bone that a node carries, with an end between two other ends.

        The end is a share of the way from the first to the second. If these are
        unknown, it is unknown, too.
        """
        if start.at is None or start.rest is None or end.at is None or end.rest is None:
            return cls(node)
        at = (1.0 - share) * start.at + share * end.at
        rest = (1.0 - share) * start.rest + share * end.rest
        return cls(node, at, rest)


class _Rest(NamedTuple):
    """The pose of a rig that corresponds to CMU's rest.

    Attributes:
        own: Whether it is the rig's own rest pose.
        turns: Turns of the nodes (nodes, 3, 3).
        places: Places of the nodes (nodes, 3).
        root: Left, up and ahead as columns (3, 3), in the root's node.
    """

    own: bool
    turns: Array
    places: Array
    root: Array

    def end_of(self, rig: Rig, bone: _Bone) -> Array | None:
        """Return where a bone ends in this pose, or None if that is unknown."""
        if bone.rest is None:
            return None
        carried = rig.rest[0][bone.node].T @ (bone.rest - rig.rest[1][bone.node])
        return np.asarray(self.places[bone.node] + self.turns[bone.node] @ carried)


def retargeted(rig: Rig, up: Array) -> Retargeted:
    """Return a rig's motion on a skeleton with its bones.

    Args:
        rig: The rig.
        up: Turn (3, 3) of the world after which y is up.

    Raises:
        InputError: The rig's legs have no length.
    """
    average = average_skeleton()
    hips = rig.joints.hips
    turns = up @ rig.moving[0]
    places = rig.moving[1] @ up.T
    rig = replace(rig, moving=(turns, places))
    thigh_and_shin = [BONES.index("lfemur"), BONES.index("ltibia")]
    average_leg = float(average.lengths[thigh_and_shin].sum())
    legs = [rig.length(side) for side in ("left", "right")]
    # bones that the rig lacks are an average person's, at the size of this person
    scale = float(np.mean(legs)) / average_leg
    # also true of NaN
    if not scale > 0.0:
        raise InputError("legs with a length, got a length of 0")
    bones = _bones(rig, scale)
    rest = _like_rest(rig, bones)
    turned, directions, lengths = _bones_at_rest(rig, bones, rest, scale)
    count = places.shape[1]
    offsets = np.zeros((len(BONES), 3))
    poses = np.zeros((count, ANGLES))
    world = np.empty((len(JOINTS), count, 3, 3))
    at = np.empty((len(JOINTS), count, 3))
    world[0] = turns[hips] @ rest.root
    at[0] = places[hips]
    poses[:, :3] = root_angles_from_rotation(world[0])
    # parents come before children, so the frame that a bone starts from is known
    for joint, bone in enumerate(bones, 1):
        above = PARENTS[joint]
        direction = directions[joint - 1]
        length = lengths[joint - 1]
        if joint in ENDS:
            world[joint] = world[above]
        else:
            at_rest = rest.turns[bone.node].T @ rest.turns[hips]  # (3, 3)
            carrier = turns[bone.node] @ (at_rest @ rest.root @ turned[joint])
            if bone.at is not None and length > 0.0:
                reach = bone.at - at[above]  # (T, 3)
                length = _aim(carrier, direction, length, reach, 1e-7 * scale)
            world[joint] = carrier
            axes = average.axes[joint - 1]
            start = angle_index(joint)
            local = np.swapaxes(world[above], -1, -2) @ carrier
            angles = joint_angles_from_rotation(axes.T @ local @ axes)
            poses[:, start : start + 3] = angles
        offsets[joint - 1] = direction * length if length else np.zeros(3)
        at[joint] = at[above] + world[joint] @ offsets[joint - 1]
    skeleton = _skeleton(offsets, poses, average)
    # bones of a rig may change their lengths, but ours cannot: report how far off
    missed = 0.0
    for joint, bone in enumerate(bones, 1):
        if bone.at is not None and joint not in ENDS:
            distances = np.linalg.norm(bone.at - at[joint], axis=1)
            missed = max(missed, float(distances.max()))
    filled = [BONES[k] for k, bone in enumerate(bones) if bone.at is None]
    return Retargeted(
        skeleton,
        unwrapped(np.where(skeleton.free, poses, 0.0)),
        places[hips],
        filled,
        missed,
    )


def _bones_at_rest(
    rig: Rig, bones: Sequence[_Bone], rest: _Rest, scale: float
) -> tuple[Array, Array, Array]:
    """Return turns (27, 3, 3), directions (26, 3) and lengths (26,) of bones at rest.

    The turns lead from CMU's rest to the rig's. A bone that the rig lacks is an average
    person's, `scale` times as long.
    """
    # orientation of the root, for which its angles are 0
    frame = rest.turns[rig.joints.hips] @ rest.root
    turned = np.tile(np.eye(3), (len(JOINTS), 1, 1))
    at = np.zeros((len(JOINTS), 3))
    directions = np.zeros((len(BONES), 3))
    lengths = np.ones(len(BONES))
    at[0] = rest.places[rig.joints.hips]
    for joint, (name, bone) in enumerate(zip(BONES, bones, strict=True), 1):
        above = PARENTS[joint]
        expected = scale * average_skeleton().offsets[joint - 1]
        before = turned[above]
        end = rest.end_of(rig, bone)
        if end is None:
            vector = expected
            at[joint] = at[above] + frame @ before @ vector
        else:
            vector = before.T @ frame.T @ (end - at[above])
            at[joint] = end
        if joint in ENDS:
            begin = bones[above - 1].rest
            node = bones[above - 1].node
            # an end's own turn is left out: posefit's ends do not turn
            if bone.rest is not None and begin is not None:
                vector = (
                    before.T
                    @ frame.T
                    @ rest.turns[node]
                    @ rig.rest[0][node].T
                    @ (bone.rest - begin)
                )
            directions[joint - 1] = vector
            continue
        length = float(np.linalg.norm(vector))
        off = 0.0
        if length > 0.0:
            turn = shortest_turn(expected, vector)
            off = float(np.degrees(geodesic(np.eye(3), turn)))
        if name[1:] in _STEADY:
            tolerance = SAME_DIRECTION
        else:
            tolerance = AS_IN_FILE
        # a hip bone does not turn
        aligned = off > tolerance and not name.endswith("hipjoint")
        turned[joint] = before @ shortest_turn(expected, vector) if aligned else before
        if not rest.own and name[1:] in _HINGES:
            turned[joint] = turned[joint] @ _twist(
                rig, name, bone, turned[joint].T @ frame.T @ rest.turns[bone.node]
            )
        direction = expected if aligned or not length else vector
        directions[joint - 1] = direction / np.linalg.norm(direction)
        lengths[joint - 1] = length
    return turned, directions, lengths


def _aim(
    carrier: Array, direction: Array, length: float, reach: Array, near: float
) -> float:
    """Turn a carrier (T, 3, 3) so that a bone reaches its end; return its length.

    Args:
        carrier: Turns of the carrier; changed in place.
        direction: Direction of the bone in the carrier (3,).
        length: Length of the bone.
        reach: Vectors from the bone's start to its wanted end (T, 3).
        near: Distance below which nothing is changed.
    """
    distances = np.linalg.norm(reach, axis=1)
    pointing = carrier @ direction
    missed = np.linalg.norm(reach - pointing * distances[:, None], axis=1)  # (T,)
    aim = np.flatnonzero(missed > near)
    carrier[aim] = shortest_turn(pointing[aim], reach[aim]) @ carrier[aim]
    if np.abs(distances - length).max() < near:
        return length
    return float(distances.mean())


def _twist(rig: Rig, name: str, bone: _Bone, frame: Array) -> Array:
    """Return the turn (3, 3) about a thigh or an upper arm that sets its hinge right.

    With it knee and elbow bend the way that people's do. `frame` (3, 3) leads from the
    bone's node to posefit's rest.
    """
    side = "left" if name[0] == "l" else "right"
    start, end, way = _HINGES[name[1:]]
    turns, places = rig.moving
    below = places[rig.joints.limbs[side, end]] - places[rig.joints.limbs[side, start]]
    along = average_skeleton().offsets[BONES.index(name)]
    along = along / np.linalg.norm(along)
    local = np.einsum("tji,tj->ti", turns[bone.node], below) @ frame.T
    across = local - (local @ along)[:, None] * along
    bent = np.linalg.norm(across, axis=1) > BENT * np.linalg.norm(below, axis=1)
    mean = across[bent].sum(axis=0)
    if not np.linalg.norm(mean) > 0.0:
        return np.eye(3)
    wanted = np.array(way) - (along @ way) * along
    # angle about the bone from the way it bends to the way it should
    angle = np.arctan2(np.cross(mean, wanted) @ along, mean @ wanted)
    axes = along_y(along)
    return np.asarray(axes @ rotation_about(1, -angle) @ axes.T)


def _skeleton(offsets: Array, poses: Array, average: Skeleton) -> Skeleton:
    """Return the skeleton with the rig's bones and the free axes of CMU's.

    A joint that turns about another axis, too, gets all three.
    """
    # (66,) whether there is a turn about an axis that CMU's joints lack
    beyond = (np.abs(poses) > MIN_TURN).any(axis=0) & ~average.free
    used = []
    for joint in INNER:
        angle = angle_index(joint)
        if beyond[angle : angle + 3].any():
            used.append(BONES[joint - 1])
    if not used:
        return Skeleton("", offsets, average.axes, average.channels, average.limits)
    free = dict(average.channels) | dict.fromkeys(used, ("rx", "ry", "rz"))
    channels = [(name, free[name]) for name in BONES if name in free]
    return Skeleton("", offsets, average.axes, tuple(channels))


def _bones(rig: Rig, scale: float) -> list[_Bone]:
    """Return the bones (26), each with the node that carries its end."""
    average = dict(zip(BONES, scale * average_skeleton().lengths, strict=True))
    chest = _chest(rig)
    bones = _spine(rig, chest) | _neck_and_head(rig, chest, average)
    for side in ("left", "right"):
        for bone, carrier in _limbs(rig, side, average).items():
            bones[f"{side[0]}{bone}"] = carrier
    return [bones[name] for name in BONES]


def _chest(rig: Rig) -> _Bone:
    """Return the bone that ends at the base of the neck, or between the shoulders."""
    joints = rig.joints
    limbs = rig.joints.limbs
    if joints.neck:
        return rig.of(joints.neck[0])
    ends = []
    for side in ("left", "right"):
        joint = "clavicle" if (side, "clavicle") in limbs else "arm"
        ends.append(rig.of(limbs[side, joint]))
    left, right = ends
    return _Bone.between(joints.chest, left, right, 0.5)


def _neck_and_head(
    rig: Rig, chest: _Bone, average: Mapping[str, float]
) -> dict[str, _Bone]:
    """Return the two bones of the neck and the head's bone.

    `average` has the lengths of an average person's bones.
    """
    joints = rig.joints
    above_neck = [*joints.neck[1:]]
    if joints.head is not None:
        above_neck.append(joints.head)
    necks = [rig.of(node) for node in above_neck]
    last = (joints.chest, *joints.neck)[-1]
    if joints.head is not None:
        last = joints.head
    tip = None
    if joints.neck or necks:
        tip = rig.tip(last, 0.3 * (average["upperneck"] + average["head"]))
    crown = rig.ending(last, tip)
    if len(necks) > 1:
        lower = necks[0]
        upper = necks[-1]
    elif necks:
        # the skull is two of posefit's bones, which turn with the head
        lower = necks[0]
        upper = _Bone.between(last, necks[0], crown, 0.5)
    else:
        lower = _Bone.between(last, chest, crown, 1 / 3)
        upper = _Bone.between(last, chest, crown, 2 / 3)
    return {"lowerneck": lower, "upperneck": upper, "head": crown}


def _limbs(rig: Rig, side: str, average: Mapping[str, float]) -> dict[str, _Bone]:
    """Return the bones of a side's leg and arm, by kinds such as `femur`."""
    limbs = rig.joints.limbs
    bones = {bone: rig.of(limbs[side, end]) for bone, end in _ENDS_OF.items()}
    foot = limbs[side, "foot"]
    hand = limbs[side, "hand"]
    toe = limbs.get((side, "toe"))
    palm = limbs.get((side, "palm"))
    if toe is not None:
        bones |= {
            "foot": rig.of(toe),
            "toes": rig.ending(toe, rig.tip(toe, 0.2 * average["ltoes"])),
        }
    else:
        share = average["lfoot"] / (average["lfoot"] + average["ltoes"])
        tip = rig.tip(foot, 0.5 * average["lfoot"])
        bones |= {"foot": rig.ending(foot, tip, share), "toes": rig.ending(foot, tip)}
    if palm is not None and hand == rig.parents[palm]:
        bones |= {"wrist": rig.of(palm), "hand": rig.ending(palm, rig.tip(palm, 0.0))}
    else:
        share = average["lwrist"] / (average["lwrist"] + average["lhand"])
        tip = rig.tip(hand, 0.3 * average["lwrist"])
        bones |= {"wrist": rig.ending(hand, tip, share), "hand": rig.ending(hand, tip)}
    return bones


def _spine(rig: Rig, chest: _Bone) -> dict[str, _Bone]:
    """Return the three bones of the spine, which may have any number of joints.

    If there are more than three joints, the two with the steadiest distances count.
    """
    joints = rig.joints
    root = _Bone(joints.hips, rig.moving[1][joints.hips], rig.rest[1][joints.hips])
    near = SAME_PLACE * rig.length("left")
    chain = [rig.of(node) for node in joints.spine]
    if (
        chain
        and root.rest is not None
        and np.linalg.norm(chain[0].rest - root.rest) <= near  # type: ignore[operator]
    ):
        chain = chain[1:]
    if not chain:
        chain = [
            _Bone.between(chest.node, root, chest, 1 / 3),
            _Bone.between(chest.node, root, chest, 2 / 3),
        ]
    elif len(chain) == 1:
        chain.append(_Bone.between(chest.node, chain[0], chest, 0.5))
    elif len(chain) > 2:

        def unsteadiness(pair: Iterable[_Bone]) -> tuple[float, float]:
            ends = np.array([root.at, *(bone.at for bone in pair), chest.at])
            lengths = np.linalg.norm(np.diff(ends, axis=0), axis=2)  # (3, T)
            mean = lengths.mean(axis=1)
            spread = float(lengths.std(axis=1).sum() / max(mean.sum(), 1e-300))
            return round(spread, 6), float(mean.std())

        chain = list(min(combinations(chain, 2), key=unsteadiness))
    return dict(zip(("lowerback", "upperback", "thorax"), [*chain, chest], strict=True))


def _like_rest(rig: Rig, bones: Sequence[_Bone]) -> _Rest:
    """Return the pose of a rig that corresponds to CMU's rest.

    It is the rig's own if its legs hang down, or else the frame that is most like it.
    """
    chest = bones[BONES.index("thorax")]
    hips = rig.joints.hips
    thighs = [rig.joints.limbs[side, "thigh"] for side in ("left", "right")]
    average = average_skeleton()

    def pose(own: bool, turns: Array, places: Array) -> _Rest:
        end = _Rest(own, turns, places, np.eye(3)).end_of(rig, chest)
        to_root = turns[hips].T
        top = places[hips] if end is None else end
        above = top - places[thighs].mean(axis=0)
        left = places[thighs[0]] - places[thighs[1]]
        root = _squared(to_root @ left, to_root @ above)
        return _Rest(own, turns, places, root)

    def degrees_off(pose: _Rest, parts: Sequence[tuple[str, str, str]]) -> Array:
        frame = pose.turns[hips] @ pose.root
        off = []
        for side in ("left", "right"):
            for start, stop, kind in parts:
                limbs = rig.joints.limbs
                first = pose.places[limbs[side, start]]
                last = pose.places[limbs[side, stop]]
                expected = average.offsets[BONES.index(f"{side[0]}{kind}")]
                turn = shortest_turn(expected, frame.T @ (last - first))
                off.append(geodesic(np.eye(3), turn))
        return np.degrees(np.array(off))

    legs = (("thigh", "shin", "femur"), ("shin", "foot", "tibia"))
    arms = (("arm", "forearm", "humerus"), ("forearm", "hand", "radius"))
    # the legs alone decide, because rest poses hold the arms in many ways
    own = pose(True, *rig.rest)
    if degrees_off(own, legs).max() <= UPRIGHT:
        return own
    # frames of a long file are sampled; the rest pose may still be the best
    count = rig.moving[0].shape[1]
    frames = range(0, count, max(1, count // POSES))
    poses = [own]
    for k in frames:
        poses.append(pose(False, rig.moving[0][:, k], rig.moving[1][:, k]))
    off = []
    for each in poses:
        of_legs = (degrees_off(each, legs) ** 2).sum()
        off.append(of_legs + (0.5 * degrees_off(each, arms) ** 2).sum())
    return poses[int(np.argmin(off))]


def _squared(left: Array, above: Array) -> Array:
    """Return left, up and ahead as columns (3, 3), from two directions (3,).

    If they are near the axes of the coordinates, these are returned.
    """
    if not np.linalg.norm(left) > 0.0:
        left = np.array([1.0, 0.0, 0.0])
    x = left / np.linalg.norm(left)
    y = above - (above @ x) * x
    if not np.linalg.norm(y) > 1e-6 * np.linalg.norm(left):
        y = np.cross(np.eye(3)[int(np.abs(x).argmin())], x)
    y = y / np.linalg.norm(y)
    axes = np.column_stack([x, y, np.cross(x, y)])
    near = np.zeros((3, 3))
    largest = np.abs(axes).argmax(axis=0)  # (3,)
    near[largest, range(3)] = np.sign(axes[largest, range(3)])
    square = abs(np.linalg.det(near) - 1.0) < 1e-9
    if square and np.degrees(geodesic(axes, near)) <= SQUARE:
        return near
    return axes


def upward(rig: Rig) -> tuple[int, float]:
    """Return the world's axis that legs and trunk point up along, and their cosine.

    The axis is 0 to 2. The worst limb decides the cosine: -1 is straight down.
    """
    places = rig.moving[1]
    limbs = rig.joints.limbs
    limb_places = {}
    for joint in ("thigh", "shin", "foot", "arm"):
        both = [places[limbs[side, joint]] for side in ("left", "right")]
        limb_places[joint] = np.mean(both, axis=0)  # (T, 3)
    thighs = limb_places["thigh"]
    shins = limb_places["shin"]
    feet = limb_places["foot"]
    arms = limb_places["arm"]
    along = []
    for low, high in ((shins, thighs), (feet, shins), (thighs, arms)):
        vectors = high - low  # (T, 3)
        lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
        along.append((vectors / np.maximum(lengths, 1e-300)).mean(axis=0))
    directions = np.array(along)
    axis = int(np.abs(directions.mean(axis=0)).argmax())
    sign = np.sign(directions.mean(axis=0)[axis])
    return axis, float(sign * (sign * directions[:, axis]).min())
