"""A person's motion out of somebody else's skeleton: other names, rest poses, axes and joints than posefit's.

A rig is a tree whose nodes have places and turns in each frame. Each of posefit's bones goes with one node of it, and
ends at a place that the node carries. Joint angles are counted from the pose of rest of the CMU database, upright, legs
apart, arms out, palms down: how a node is turned there is read off the rig's own rest where that is a person's, or else
off the frame that is most like it, each bone turned the shortest way from the one before.
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

SAME_PLACE = 1e-4  # share of a leg within which two joints are at one point
# degrees: a foot, a clavicle or a bone of the spine that is so near to CMU's rest stays
# as it is
AS_IN_FILE = 20.0
SAME_DIRECTION = 0.5  # degrees: of other bones
UPRIGHT = 60.0  # degrees that legs and trunk may be off in a pose of rest
SQUARE = 25.0  # degrees: a root's axes that are so near to left, up and ahead are these
STANDING = 0.7  # the mean cosine between legs, trunk and the axis that is up
POSES = 2_000  # frames, the most that are searched for one like the pose of rest
# radians: a turn about an axis that CMU's joints do not have, which is rounding
UNUSED = 1e-5
_ENDS_OF = {
    "hipjoint": "thigh",
    "femur": "shin",
    "tibia": "foot",
    "clavicle": "arm",
    "humerus": "forearm",
    "radius": "hand",
}
# the bone below a hinge, where its ends are, and which way it bends from rest
_HINGES = {
    "femur": ("shin", "foot", (0.0, 0.0, -1.0)),
    "humerus": ("forearm", "hand", (0.0, 0.5, 0.75**0.5)),
}  # an elbow bends 30 degrees up from forwards
# the sine of 20 degrees, from which on a knee or an elbow shows about which axis it
# bends
BENT = 0.35
_STEADY = ("femur", "tibia", "humerus", "radius", "wrist")


@dataclass(frozen=True, eq=False)
class Rig:
    """Which nodes are a person's joints, and where nodes are and how they are turned: at rest, and in the frames."""

    names: Sequence[str]  # "" where a bone ends that no joint follows
    parents: Sequence[int]
    joints: Joints
    # turns (nodes, 3, 3) and places (nodes, 3)
    rest: tuple[Array, Array] = field(repr=False)
    # turns (nodes, T, 3, 3) and places (nodes, T, 3)
    moving: tuple[Array, Array] = field(repr=False)

    def of(self, node: int) -> "_Bone":
        """Return the bone that ends in a node: the one before it carries it."""
        return _Bone(self.parents[node], self.moving[1][node], self.rest[1][node])

    def ending(self, node: int, tip: Array | None, share: float = 1.0) -> "_Bone":
        """Return the bone that ends in a point of a node, a share of the way to its tip (3,), if that is known."""
        if tip is None:
            return _Bone(node)
        (turns, places), (rest_turns, rest_places) = self.moving, self.rest
        at = share * tip
        return _Bone(
            node,
            places[node] + turns[node] @ at,
            rest_places[node] + rest_turns[node] @ at,
        )

    def tip(self, node: int, least: float) -> Array | None:
        """Return where a node's bone ends, in the node; None where nothing is so far off.

        That is at its farthest End Site, or else at the farthest node that hangs from it.
        """
        children = [
            child for child, parent in enumerate(self.parents) if parent == node
        ]
        turns, places = self.rest
        ends = [child for child in children if not self.names[child]] or children
        tips = [turns[node].T @ (places[end] - places[node]) for end in ends]
        best = max(tips, key=lambda end: float(np.linalg.norm(end)), default=None)
        return (
            best if best is not None and float(np.linalg.norm(best)) > least else None
        )

    def length(self, side: str) -> float:
        """Return how long a leg is."""
        places = self.moving[1]
        thigh, shin, foot = (
            places[self.joints.limbs[side, joint]]
            for joint in ("thigh", "shin", "foot")
        )
        return float(
            (
                np.linalg.norm(shin - thigh, axis=1)
                + np.linalg.norm(foot - shin, axis=1)
            ).mean()
        )


@dataclass(frozen=True, eq=False)
class Retargeted:
    """A rig's motion of a `Skeleton`, in the rig's unit."""

    skeleton: Skeleton
    poses: Array = field(repr=False)  # (T, 66)
    places: Array = field(repr=False)  # (T, 3)
    filled: Sequence[str]  # bones that the rig does not have
    off: float  # the farthest that a joint is from its place in the rig


@dataclass(frozen=True, eq=False)
class _Bone:
    """Which node carries a bone's end, and where that is: in the frames (T, 3) and at rest; None where unknown."""

    node: int
    at: Array | None = None
    rest: Array | None = None

    @classmethod
    def between(cls, node: int, start: "_Bone", end: "_Bone", share: float) -> Self:
        """Return the bone that a node carries, and that ends at a share of the way between the ends of two others.

        Where these are unknown, so is its own.
        """
        if start.at is None or start.rest is None or end.at is None or end.rest is None:
            return cls(node)
        ends = (start.at, end.at), (start.rest, end.rest)
        return cls(
            node, *((1.0 - share) * first + share * last for first, last in ends)
        )


class _Rest(NamedTuple):
    """The pose of a rig that stands for CMU's rest."""

    own: bool  # whether it is the rig's own
    turns: Array  # (nodes, 3, 3)
    places: Array  # (nodes, 3)
    root: Array  # (3, 3) left, up and ahead, in the root's node

    def end_of(self, rig: Rig, bone: _Bone) -> Array | None:
        """Return where a bone ends in this pose."""
        if bone.rest is None:
            return None
        carried = rig.rest[0][bone.node].T @ (bone.rest - rig.rest[1][bone.node])
        return np.asarray(self.places[bone.node] + self.turns[bone.node] @ carried)


def retargeted(rig: Rig, up: Array) -> Retargeted:
    """Return a rig's motion of a skeleton with its bones; `up` (3, 3) turns the world so that y is up.

    Raises InputError where the rig's legs have no length.
    """
    average = average_skeleton()
    hips = rig.joints.hips
    turns = up @ rig.moving[0]
    places = rig.moving[1] @ up.T
    rig = replace(rig, moving=(turns, places))
    leg = average.lengths[[BONES.index("lfemur"), BONES.index("ltibia")]].sum()
    scale = float(np.mean([rig.length(side) for side in ("left", "right")])) / float(
        leg
    )
    if not scale > 0.0:
        raise InputError("legs with a length, got some without")
    bones = _bones(rig, scale)
    rest = _like_rest(rig, bones)
    turned, directions, lengths = _bones_at_rest(rig, bones, rest, scale)
    count = places.shape[1]
    offsets = np.zeros((len(BONES), 3))
    poses = np.zeros((count, ANGLES))
    world = np.empty((len(JOINTS), count, 3, 3))
    at = np.empty((len(JOINTS), count, 3))
    world[0], at[0] = turns[hips] @ rest.root, places[hips]
    poses[:, :3] = root_angles_from_rotation(world[0])
    for joint, bone in enumerate(bones, 1):
        above = PARENTS[joint]
        direction = directions[joint - 1]
        length = lengths[joint - 1]
        if joint in ENDS:
            world[joint] = world[above]
        else:
            carrier = turns[bone.node] @ (
                rest.turns[bone.node].T @ rest.turns[hips] @ rest.root @ turned[joint]
            )
            if bone.at is not None and length > 0.0:
                length = _aim(
                    carrier, direction, length, bone.at - at[above], 1e-7 * scale
                )
            world[joint] = carrier
            axes = average.axes[joint - 1]
            start = angle_index(joint)
            local = np.swapaxes(world[above], -1, -2) @ carrier
            poses[:, start : start + 3] = joint_angles_from_rotation(
                axes.T @ local @ axes
            )
        offsets[joint - 1] = direction * length if length else np.zeros(3)
        at[joint] = at[above] + world[joint] @ offsets[joint - 1]
    skeleton = _skeleton(offsets, poses, average)
    ends = [
        (bone.at, at[joint])
        for joint, bone in enumerate(bones, 1)
        if bone.at is not None and joint not in ENDS
    ]
    missed = max(
        (float(np.linalg.norm(end - place, axis=1).max()) for end, place in ends),
        default=0.0,
    )
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
    """Return how joints turn (27, 3, 3) from CMU's rest to the rig's, and bones' directions (26, 3) and lengths (26,).

    A bone that the rig lacks is an average person's, `scale` times as long.
    """
    # the root's, where its angles are 0
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
        vector = expected if end is None else before.T @ frame.T @ (end - at[above])
        at[joint] = at[above] + frame @ before @ vector if end is None else end
        if joint in ENDS:
            begin = bones[above - 1].rest
            node = bones[above - 1].node
            # without the end's own turn
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
        off = (
            np.degrees(geodesic(np.eye(3), shortest_turn(expected, vector)))
            if length > 0.0
            else 0.0
        )
        aligned = off > (SAME_DIRECTION if name[1:] in _STEADY else AS_IN_FILE)
        aligned = aligned and not name.endswith("hipjoint")  # which does not turn
        turned[joint] = before @ shortest_turn(expected, vector) if aligned else before
        if not rest.own and name[1:] in _HINGES:
            turned[joint] = turned[joint] @ _twist(
                rig, name, bone, turned[joint].T @ frame.T @ rest.turns[bone.node]
            )
        direction = expected if aligned or not length else vector
        directions[joint - 1], lengths[joint - 1] = (
            direction / np.linalg.norm(direction),
            length,
        )
    return turned, directions, lengths


def _aim(
    carrier: Array, direction: Array, length: float, reach: Array, near: float
) -> float:
    """Turn a carrier (T, 3, 3) so that a direction (3,) in it points along `reach` (T, 3); return the bone's length."""
    distances = np.linalg.norm(reach, axis=1)
    pointing = carrier @ direction
    aim = np.flatnonzero(
        np.linalg.norm(reach - pointing * distances[:, None], axis=1) > near
    )
    carrier[aim] = shortest_turn(pointing[aim], reach[aim]) @ carrier[aim]
    return (
        length if np.abs(distances - length).max() < near else float(distances.mean())
    )


def _twist(rig: Rig, name: str, bone: _Bone, frame: Array) -> Array:
    """Return by which turn (3, 3) about a thigh or an upper arm its knee or elbow bends the way that people's do.

    `frame` (3, 3) takes what is counted in the bone's node to posefit's rest.
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
    # about the bone, from where it bends
    angle = np.arctan2(np.cross(mean, wanted) @ along, mean @ wanted)
    axes = along_y(along)
    return np.asarray(axes @ rotation_about(1, -angle) @ axes.T)


def _skeleton(offsets: Array, poses: Array, average: Skeleton) -> Skeleton:
    """Return the skeleton whose joints have the freedom of CMU's; those that turn further have all."""
    # (66,) about axes about which CMU's do not turn
    beyond = (np.abs(poses) > UNUSED).any(axis=0) & ~average.free
    used = {
        BONES[joint - 1] for joint in INNER if beyond[angle_index(joint) :][:3].any()
    }
    if not used:
        return Skeleton("", offsets, average.axes, average.channels, average.limits)
    free = dict(average.channels) | dict.fromkeys(used, ("rx", "ry", "rz"))
    return Skeleton(
        "",
        offsets,
        average.axes,
        tuple((name, free[name]) for name in BONES if name in free),
    )


def _bones(rig: Rig, scale: float) -> list[_Bone]:
    """Return for each of posefit's bones (26) the node that carries its end."""
    average = dict(zip(BONES, scale * average_skeleton().lengths, strict=True))
    chest = _chest(rig)
    bones = _spine(rig, chest) | _neck_and_head(rig, chest, average)
    for side in ("left", "right"):
        bones |= {
            f"{side[0]}{bone}": carrier
            for bone, carrier in _limbs(rig, side, average).items()
        }
    return [bones[name] for name in BONES]


def _chest(rig: Rig) -> _Bone:
    """Return the bone that ends where the neck begins, or else in the middle between the shoulders."""
    joints = rig.joints
    limbs = rig.joints.limbs
    if joints.neck:
        return rig.of(joints.neck[0])
    starts = [
        (side, "clavicle" if (side, "clavicle") in limbs else "arm")
        for side in ("left", "right")
    ]
    left, right = (rig.of(limbs[start]) for start in starts)
    return _Bone.between(joints.chest, left, right, 0.5)


def _neck_and_head(
    rig: Rig, chest: _Bone, average: Mapping[str, float]
) -> dict[str, _Bone]:
    """Return the two bones of the neck and the head's; `average` has the lengths of an average person's bones."""
    joints = rig.joints
    necks = [
        rig.of(node) for node in (*joints.neck[1:], joints.head) if node is not None
    ]
    last = (joints.chest, *joints.neck)[-1] if joints.head is None else joints.head
    tip = (
        rig.tip(last, 0.3 * (average["upperneck"] + average["head"]))
        if joints.neck or necks
        else None
    )
    crown = rig.ending(last, tip)
    if len(necks) > 1:
        lower = necks[0]
        upper = necks[-1]
    elif necks:  # the skull is two of posefit's bones, and turns as the head does
        lower = necks[0]
        upper = _Bone.between(last, necks[0], crown, 0.5)
    else:
        lower, upper = (
            _Bone.between(last, chest, crown, share) for share in (1 / 3, 2 / 3)
        )
    return {"lowerneck": lower, "upperneck": upper, "head": crown}


def _limbs(rig: Rig, side: str, average: Mapping[str, float]) -> dict[str, _Bone]:
    """Return the bones of a side's leg and arm by their kind, such as `femur`."""
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
    """Return the three bones of the spine, whatever joints it has; of more of them, those of the steadiest lengths."""
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
            _Bone.between(chest.node, root, chest, share) for share in (1 / 3, 2 / 3)
        ]
    elif len(chain) == 1:
        chain.append(_Bone.between(chest.node, chain[0], chest, 0.5))
    elif len(chain) > 2:

        def unsteadiness(pair: Iterable[_Bone]) -> tuple[float, float]:
            ends = np.array([root.at, *(bone.at for bone in pair), chest.at])
            lengths = np.linalg.norm(np.diff(ends, axis=0), axis=2)
            mean = lengths.mean(axis=1)
            return round(
                float(lengths.std(axis=1).sum() / max(mean.sum(), 1e-300)), 6
            ), float(mean.std())

        chain = list(min(combinations(chain, 2), key=unsteadiness))
    return dict(zip(("lowerback", "upperback", "thorax"), [*chain, chest], strict=True))


def _like_rest(rig: Rig, bones: Sequence[_Bone]) -> _Rest:
    """Return the pose that stands for CMU's rest: the rig's own where its legs hang down, or the frame most like it."""
    chest = bones[BONES.index("thorax")]
    hips = rig.joints.hips
    thighs = [rig.joints.limbs[side, "thigh"] for side in ("left", "right")]
    average = average_skeleton()

    def pose(own: bool, turns: Array, places: Array) -> _Rest:
        end = _Rest(own, turns, places, np.eye(3)).end_of(rig, chest)
        local = turns[hips].T
        above = (places[hips] if end is None else end) - places[thighs].mean(axis=0)
        return _Rest(
            own,
            turns,
            places,
            _squared(local @ (places[thighs[0]] - places[thighs[1]]), local @ above),
        )

    def degrees_off(pose: _Rest, parts: Sequence[tuple[str, str, str]]) -> Array:
        frame = pose.turns[hips] @ pose.root
        off = []
        for side in ("left", "right"):
            for start, stop, kind in parts:
                first, last = (
                    pose.places[rig.joints.limbs[side, joint]]
                    for joint in (start, stop)
                )
                expected = average.offsets[BONES.index(f"{side[0]}{kind}")]
                off.append(
                    geodesic(
                        np.eye(3), shortest_turn(expected, frame.T @ (last - first))
                    )
                )
        return np.degrees(np.array(off))

    legs = (("thigh", "shin", "femur"), ("shin", "foot", "tibia"))
    arms = (("arm", "forearm", "humerus"), ("forearm", "hand", "radius"))
    own = pose(True, *rig.rest)
    if degrees_off(own, legs).max() <= UPRIGHT:
        return own
    count = rig.moving[0].shape[1]
    frames = range(0, count, max(1, count // POSES))
    poses = [
        own,
        *(pose(False, rig.moving[0][:, k], rig.moving[1][:, k]) for k in frames),
    ]
    off = [
        (degrees_off(each, legs) ** 2).sum()
        + (0.5 * degrees_off(each, arms) ** 2).sum()
        for each in poses
    ]
    return poses[int(np.argmin(off))]


def _squared(left: Array, above: Array) -> Array:
    """Return axes (3, 3), left, up and ahead, by directions (3,): axes of the coordinates where these are near."""
    if not np.linalg.norm(left) > 0.0:
        left = np.array([1.0, 0.0, 0.0])
    x = left / np.linalg.norm(left)
    y = above - (above @ x) * x
    if not np.linalg.norm(y) > 1e-6 * np.linalg.norm(left):
        y = np.cross(np.eye(3)[int(np.abs(x).argmin())], x)
    y = y / np.linalg.norm(y)
    axes = np.column_stack([x, y, np.cross(x, y)])
    near = np.zeros((3, 3))
    near[np.abs(axes).argmax(axis=0), range(3)] = np.sign(
        axes[np.abs(axes).argmax(axis=0), range(3)]
    )
    square = abs(np.linalg.det(near) - 1.0) < 1e-9
    return near if square and np.degrees(geodesic(axes, near)) <= SQUARE else axes


def upward(rig: Rig) -> tuple[int, float]:
    """Return which axis of the world, 0 to 2, legs and trunk mostly point up along, and how: -1 is straight down."""
    places = rig.moving[1]
    limbs = rig.joints.limbs
    thighs, shins, feet, arms = (
        np.mean([places[limbs[side, joint]] for side in ("left", "right")], axis=0)
        for joint in ("thigh", "shin", "foot", "arm")
    )
    along = []
    for low, high in ((shins, thighs), (feet, shins), (thighs, arms)):
        vectors = high - low
        along.append(
            (
                vectors
                / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
            ).mean(axis=0)
        )
    directions = np.array(along)
    axis = int(np.abs(directions.mean(axis=0)).argmax())
    sign = np.sign(directions.mean(axis=0)[axis])
    return axis, float(sign * (sign * directions[:, axis]).min())
