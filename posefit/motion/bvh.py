"""BVH motions, read through the optional library pybvh.

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
from scipy.spatial.transform import Rotation

from posefit.geometry.rotation import Array, joint_angles_from_rotation, root_angles_from_rotation
from posefit.geometry.skeleton import ANGLES, BONES, ENDS, JOINTS, PARENTS, Channels, Skeleton, angle_index
from posefit.motion.amc import SIZE_LIMIT
from posefit.motion.asf import LARGEST, check_size, positive
from posefit.motion.motion import Motion

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
    path, unit = Path(path), positive("metres_per_unit", metres_per_unit)
    bvh = _parsed(path)
    nodes = {node.name: node for node in bvh.nodes if not node.is_end_site()}
    missing = [f"{bone} ({NAMES[bone]})" for bone in JOINTS if not {bone, NAMES[bone]} & nodes.keys()]
    if missing:
        raise ValueError(f"{path}: expected a BVH file with all 27 joints, got one without {', '.join(missing)}")
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
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            bvh = library.read_bvh_file(path, world_up="+y")
    except (OSError, MemoryError):
        raise
    except Exception as error:  # whatever the library trips over, the file is to blame
        raise ValueError(f"{path}: expected a BVH file, got one that pybvh cannot read: {error}") from error
    for values in (bvh.root_pos, bvh.joint_angles, np.array([node.offset for node in bvh.nodes])):
        if not (np.abs(values) < LARGEST).all():
            raise ValueError(f"{path}: expected finite numbers below {LARGEST:g}, got {np.abs(values).max()}")
    if not (np.isfinite(bvh.fps) and bvh.fps > 0.0):
        raise ValueError(f"{path}: expected a positive frame time, got {bvh.frame_time}")
    return bvh


def _offsets(path: Path, nodes: list[Any]) -> Array:
    """Return the bone vectors (26, 3) in file units: from each bone's own BVH joint to those of its child bones."""
    for joint, above in enumerate(PARENTS):
        parent, expected = nodes[joint].parent, nodes[above] if above >= 0 else None
        if parent is not expected:
            wanted = f"right under {expected.name!r}" if expected else "as the ROOT"
            got = f"it under {parent.name!r}" if parent else "it as the ROOT"
            raise ValueError(f"{path}: expected joint {nodes[joint].name!r} {wanted}, got {got}")
    near = SAME_PLACE * max(float(np.linalg.norm(node.offset)) for node in nodes[1:])
    offsets = np.zeros((len(nodes), 3))  # of the root, too: its children must start where it is
    for joint, node in enumerate(nodes):
        below = [nodes[child] for child, above in enumerate(PARENTS) if above == joint] or node.children[:1]
        if not below:
            raise ValueError(f"{path}: expected an End Site under joint {node.name!r}, got none")
        offsets[joint] = below[0].offset if joint > 0 else 0.0
        for child in below:
            if np.abs(child.offset - offsets[joint]).max() > near:
                where = " ".join(f"{value:g}" for value in offsets[joint])
                got = " ".join(f"{value:g}" for value in child.offset)
                raise ValueError(f"{path}: expected joint {child.name!r} at OFFSET {where}, got {got}")
    return offsets[1:]
