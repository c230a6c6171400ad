"""BVH motions: read through the optional library pybvh, and written.

In a BVH file a joint's rotation turns everything that starts at it. In a `Skeleton` the angles named after a bone
turn that bone about the joint it starts from. So the BVH joint that stands for a bone is the one at the bone's start:
`LeftUpLeg` (the hip) holds the angles of `lfemur`, and the offset of its child `LeftLeg` (the knee) is that bone's
vector. Where bones fork, as the thorax does into neck and shoulders, all BVH children must start at one point.
"""

import importlib
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.rotation import angles_about, joint_angles_from_rotation, root_angles_from_rotation
from posefit.geometry.skeleton import ANGLES, BONES, ENDS, JOINTS, PARENTS, Channels, Skeleton, angle_index
from posefit.motion.amc import SIZE_LIMIT, VALUES
from posefit.motion.asf import LARGEST, checked_unit, lines_of, mistake
from posefit.motion.motion import LONGEST, Motion
from posefit.reading import check_size, cut, quoted

_LIMBS = {  # names in the CMU conversions by cgspeed, without their side
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
    **{f"{side[0].lower()}{bone}": f"{side}{name}" for side in ("Left", "Right") for bone, name in _LIMBS.items()},
    "lhipjoint": "LHipJoint",
    "rhipjoint": "RHipJoint",
}
CHANNELS: Channels = tuple((BONES[j - 1], ("rx", "ry", "rz")) for j in range(1, len(JOINTS)) if j not in ENDS)
ROTATIONS = "Zrotation Xrotation Yrotation"
LONGEST_LINE = 100_000  # bytes; a frame of CMU's files has about 1,000
NODES = 1_000  # joints and ends of a file
FRAME_TIMES = (1e-4, 10.0)  # seconds
SAME_PLACE = 1e-4  # share of the longest bone within which two joints are at one point


def read_bvh(path: str | Path, *, metres_per_unit: float = 1.0) -> Motion:
    """Return the motion of a .bvh file, with a skeleton of its own, in radians and metres; y must be up.

    The joints may have the names of the CMU conversions by cgspeed (`Hips`, `LHipJoint`, `LeftUpLeg`, ...) or
    Acclaim's (`root`, `lhipjoint`, `lfemur`, ...); further joints are left out, and so are the rotations of toes,
    head and hands. `metres_per_unit` is the length of the file's unit: 0.01 where it is centimetres,
    `posefit.motion.asf.METRES_PER_UNIT` where it is that of CMU's own files. The root is where its position channels
    say; its OFFSET is not added. Raises ValueError where the file is not a BVH file of this tree, and ImportError
    without pybvh.
    """
    path, unit = Path(path), checked_unit(metres_per_unit)
    bvh = _parsed(path)
    from scipy.spatial.transform import Rotation  # a quarter of a second to import

    nodes = {node.name: node for node in bvh.nodes if not node.is_end_site()}
    missing = [f"{bone} ({NAMES[bone]})" for bone in JOINTS if not {bone, NAMES[bone]} & nodes.keys()]
    if missing:
        raise InputError(f"{path}: expected a BVH file with all 27 joints, got one without {', '.join(missing)}")
    chosen = [nodes[NAMES[bone] if NAMES[bone] in nodes else bone] for bone in JOINTS]
    offsets = _offsets(path, chosen) * unit
    skeleton = Skeleton(path.stem, offsets, np.tile(np.eye(3), (len(BONES), 1, 1)), CHANNELS)
    columns = [bvh.joint_index[node.name] for node in chosen]
    poses = np.zeros((len(bvh.root_pos), ANGLES))
    for joint, (node, column) in enumerate(zip(chosen, columns, strict=True)):
        # capital letters: each channel turns about the axes that the channels before it have turned
        order = "".join(node.rot_channels).upper()
        rotations = Rotation.from_euler(order, bvh.joint_angles[:, column]).as_matrix()
        if joint == 0:
            poses[:, :3] = root_angles_from_rotation(rotations)
        elif joint not in ENDS:
            start = angle_index(joint)
            poses[:, start : start + 3] = joint_angles_from_rotation(rotations)
    return Motion(path.stem, skeleton, np.unwrap(poses, axis=0), bvh.root_pos * unit, bvh.fps)


def _parsed(path: Path) -> Any:
    try:
        library = importlib.import_module("pybvh")
    except ImportError as error:
        raise ImportError("reading .bvh files needs the library pybvh: pip install posefit[bvh]") from error
    check_size(path, SIZE_LIMIT)
    _check_lengths(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            bvh = library.read_bvh_file(path, world_up="+y")
    except (OSError, MemoryError):
        raise
    except Exception as error:  # whatever the library trips over, the file is to blame
        raise InputError(
            f"{path}: expected a BVH file, got one that pybvh cannot read: {cut(str(error), 200)}"
        ) from error
    for values in (bvh.root_pos, bvh.joint_angles, np.array([node.offset for node in bvh.nodes])):
        if not (np.abs(values) < LARGEST).all():
            raise InputError(f"{path}: expected finite numbers below {LARGEST:g}, got {np.abs(values).max()}")
    if not FRAME_TIMES[0] <= bvh.frame_time <= FRAME_TIMES[1]:
        low, high = FRAME_TIMES
        raise InputError(f"{path}: expected a positive frame time, {low:g} to {high:g} s, got {bvh.frame_time:g}")
    return bvh


def _check_lengths(path: Path) -> None:
    """Return nothing. Raises ValueError where a file has more lines, joints or frames than are read.

    Everything else that may be wrong is left to the library, which makes arrays as large as a file asks for.
    """
    nodes, rows, width, moving = 0, 0, 0, False
    for number, line in lines_of(path, LONGEST_LINE):
        words = line.split()
        if moving and words:
            rows, width = rows + 1, max(width, len(words))
            if rows > LONGEST or rows * width > VALUES:
                raise mistake(path, number, f"at most {LONGEST} frames and {VALUES} numbers", "more")
        elif words:
            nodes += words[0] in (b"ROOT", b"JOINT", b"End")
            if nodes > NODES:
                raise mistake(path, number, f"at most {NODES} joints and ends", "more")
            moving = words[:2] == [b"Frame", b"Time:"]


def _offsets(path: Path, nodes: list[Any]) -> Array:
    """Return the bone vectors (26, 3) in file units: from each bone's own BVH joint to those of its child bones."""
    for joint, above in enumerate(PARENTS):
        parent, expected = nodes[joint].parent, nodes[above] if above >= 0 else None
        if parent is not expected:
            wanted = f"right under {expected.name!r}" if expected else "as the ROOT"
            got = f"it under {quoted(parent.name)}" if parent else "it as the ROOT"
            raise InputError(f"{path}: expected joint {nodes[joint].name!r} {wanted}, got {got}")
    near = SAME_PLACE * max(float(np.linalg.norm(node.offset)) for node in nodes[1:])
    offsets = np.zeros((len(nodes), 3))  # of the root, too: its children must start where it is
    for joint, node in enumerate(nodes):
        below = [nodes[child] for child, above in enumerate(PARENTS) if above == joint] or node.children[:1]
        if not below:
            raise InputError(f"{path}: expected an End Site under joint {node.name!r}, got none")
        offsets[joint] = below[0].offset if joint > 0 else 0.0
        for child in below:
            if np.abs(child.offset - offsets[joint]).max() > near:
                where = " ".join(f"{value:g}" for value in offsets[joint])
                got = " ".join(f"{value:g}" for value in child.offset)
                raise InputError(f"{path}: expected joint {child.name!r} at OFFSET {where}, got {got}")
    return offsets[1:]


def write_bvh(path: str | Path, motion: Motion) -> None:
    """Write a .bvh file, in metres and y up, that reads back as the same motion of a skeleton with the same bones.

    Joint names are those of the CMU conversions, as `read_bvh` takes them. Angles are counted in other axes there, so
    the poses that come back differ, and the joints do not.
    """
    lines, order = ["HIERARCHY"], []

    def visit(joint: int, depth: int) -> None:
        tab = "\t" * depth
        where = np.zeros(3) if PARENTS[joint] <= 0 else motion.skeleton.offsets[PARENTS[joint] - 1]
        order.append(joint)
        lines.append(f"{tab}{'JOINT' if joint else 'ROOT'} {NAMES[JOINTS[joint]]}")
        channels = "6 Xposition Yposition Zposition" if joint == 0 else "3"
        lines.extend([f"{tab}{{", f"{tab}\tOFFSET {_plain(where)}", f"{tab}\tCHANNELS {channels} {ROTATIONS}"])
        for child, parent in enumerate(PARENTS):
            if parent == joint:
                visit(child, depth + 1)
        if joint in ENDS:
            end = _plain(motion.skeleton.offsets[joint - 1])
            lines.extend([f"{tab}\tEnd Site", f"{tab}\t{{", f"{tab}\t\tOFFSET {end}", f"{tab}\t}}"])
        lines.append(f"{tab}}}")

    visit(0, 0)
    turns = motion.skeleton.turns(motion.poses)[order]
    angles = np.degrees(angles_about((2, 0, 1), turns))  # ZXY; at a gimbal lock any of the solutions will do
    angles = np.swapaxes(angles.reshape(len(order), len(motion), 3), 0, 1).reshape(len(motion), -1)
    lines += ["MOTION", f"Frames: {len(motion)}", f"Frame Time: {1.0 / motion.fps!r}"]
    lines += [_plain(row) for row in np.hstack([motion.translations, angles])]
    Path(path).write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _plain(values: Array) -> str:
    return " ".join(f"{value:.9f}" for value in values)
