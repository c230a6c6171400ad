"""The moving body as one .glb file: glTF 2.0 of the Khronos Group.

Blender, browsers and game engines open it, with an armature: each bone has a joint at
the bone's start, with the bone's name in BVH files, and an animation turns the joints.
One skinned mesh has a tapered cone for each bone, which moves with this bone alone.
Lengths are metres and y is up. Left limbs are orange and right ones blue, as in the
viewer.
"""

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.rotation import along_y, quaternions
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    ENDS,
    INNER,
    JOINTS,
    PARENTS,
    Skeleton,
    side,
)
from posefit.motion.bvh import NAMES
from posefit.motion.motion import Motion

COLOURS = {
    "left": (0.87, 0.38, 0.08),
    "right": (0.1, 0.36, 0.75),
    "middle": (0.6, 0.6, 0.6),
}
MATT = {"metallicFactor": 0.0, "roughnessFactor": 0.7}
RING_CORNERS = 16  # corners of a ring
CAP = 4  # rings of a cap
# glTF's numbers for data types and for uses of a buffer
FLOAT = 5126
SHORT = 5123
ARRAY = 34962
ELEMENTS = 34963
MAGIC = 0x46546C67
VERSION = 2
JSON = 0x4E4F534A
BINARY = 0x004E4942


def write_glb(path: str | Path, motion: Motion, radii: Array) -> None:
    """Write a motion of a body as a .glb file.

    Args:
        path: The file.
        motion: The motion.
        radii: Radii (26, 2) of the bones' cones at their two ends, in metres.
    """
    skeleton = motion.skeleton
    data = _Buffer()
    nodes = _armature(skeleton)
    body = len(nodes)
    nodes.append({"name": "body", "mesh": 0, "skin": 0})
    at_rest = skeleton.joints(np.zeros(ANGLES))
    starts = at_rest[[0, *PARENTS[1:]]]
    # no joint is turned at rest, so the transform from the world is a translation
    binds = np.tile(np.eye(4), (body, 1, 1))
    binds[:, 3, :3] = -np.concatenate([starts, at_rest[[*ENDS]]])
    skin = {
        "joints": [*range(body)],
        "skeleton": 0,
        "inverseBindMatrices": data.add(binds.reshape(-1, 16), None),
    }
    mesh = {"name": "body", "primitives": _parts(data, skeleton.offsets, starts, radii)}
    times = data.add(
        (motion.first + np.arange(len(motion)))[:, None] / motion.fps, None, True
    )
    turns = skeleton.turns(motion.poses)
    moved = [(0, "translation", motion.translations)]
    for joint in (0, *INNER):
        moved.append((joint, "rotation", quaternions(turns[joint])))
    samplers: list[dict[str, Any]] = []
    channels: list[dict[str, Any]] = []
    for node, moving, values in moved:
        target = {"node": node, "path": moving}
        channels.append({"sampler": len(samplers), "target": target})
        samplers.append({"input": times, "output": data.add(values, None)})
    document = {
        "asset": {"version": "2.0", "generator": "posefit"},
        "scene": 0,
        # a skinned mesh is placed by its joints: it is next to them, not below
        "scenes": [{"nodes": [0, body]}],
        "nodes": nodes,
        "skins": [skin],
        "meshes": [mesh],
        "materials": _materials(),
        "animations": [{"name": "track", "samplers": samplers, "channels": channels}],
        "accessors": data.accessors,
        "bufferViews": data.views,
        "buffers": [{"byteLength": len(data.bytes)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary = data.bytes
    chunks = (
        struct.pack("<II", len(text), JSON)
        + text
        + struct.pack("<II", len(binary), BINARY)
        + binary
    )
    Path(path).write_bytes(
        struct.pack("<III", MAGIC, VERSION, 12 + len(chunks)) + chunks
    )


def _armature(skeleton: Skeleton) -> list[dict[str, Any]]:
    """Return the root, a joint where each bone starts, and where the last bones end."""
    nodes: list[dict[str, Any]] = [{"name": NAMES["root"]}]
    for bone, name in enumerate(BONES):
        start = PARENTS[bone + 1]
        at = skeleton.offsets[start - 1] if start else np.zeros(3)
        nodes.append({"name": NAMES[name], "translation": at.tolist()})
        nodes[start].setdefault("children", []).append(bone + 1)
    for joint in ENDS:
        # programs draw a bone from a joint to the next
        nodes[joint]["children"] = [len(nodes)]
        name = f"{NAMES[JOINTS[joint]]}_End"
        at = skeleton.offsets[joint - 1]
        nodes.append({"name": name, "translation": at.tolist()})
    return nodes


def _parts(
    data: "_Buffer", offsets: Array, starts: Array, radii: Array
) -> list[dict[str, Any]]:
    """Return the mesh at rest, which has a part for the bones of each colour.

    Args:
        data: The buffer that its arrays are added to.
        offsets: The vectors (26, 3) from the bones' starts to their ends.
        starts: Where the joints' bones (27, 3) start; the first is the root.
        radii: The radii (26, 2) of the bones' cones.
    """
    parts = []
    for material, colour in enumerate(COLOURS):
        points = []
        normals = []
        corners = []
        joints = []
        count = 0
        for bone, name in enumerate(BONES):
            if side(name) != colour:
                continue
            cone = _capped_cone(offsets[bone], radii[bone])
            points.append(cone[0] + starts[bone + 1])
            normals.append(cone[1])
            corners.append(cone[2] + count)
            joints.append(np.full((len(cone[0]), 4), [bone + 1, 0, 0, 0]))
            count += len(cone[0])
        moved = np.concatenate(joints)
        attributes = {
            "POSITION": data.add(np.concatenate(points), ARRAY, True),
            "NORMAL": data.add(np.concatenate(normals), ARRAY),
            "JOINTS_0": data.add(moved, ARRAY),
            # a cone moves with one bone alone
            "WEIGHTS_0": data.add(np.tile(np.eye(4)[0], (len(moved), 1)), ARRAY),
        }
        indices = data.add(np.concatenate(corners), ELEMENTS)
        part = {"attributes": attributes, "indices": indices, "material": material}
        parts.append(part)
    return parts


def _materials() -> list[dict[str, Any]]:
    """Return a matt material for each of the colours."""
    materials = []
    for name, colour in COLOURS.items():
        looks = {**MATT, "baseColorFactor": [*colour, 1.0]}
        materials.append({"name": name, "pbrMetallicRoughness": looks})
    return materials


class _Buffer:
    """The binary part of a file, and its description in glTF."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

    def add(
        self, values: NDArray[Any], target: int | None, bounds: bool = False
    ) -> int:
        """Add an array, and return its number.

        Args:
            values: Vectors (n, k), or single values (n,). Whole numbers are stored with
                16 bits, others with 32.
            target: GlTF's number for the use, or None.
            bounds: Whether to state the smallest and the largest values.
        """
        whole = np.issubdtype(values.dtype, np.integer)
        raw = values.astype("<u2" if whole else "<f4")
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": raw.nbytes}
        if target is not None:
            view["target"] = target
        self.views.append(view)
        width = raw[:1].size
        kind = {1: "SCALAR", 16: "MAT4"}.get(width, f"VEC{width}")
        accessor: dict[str, Any] = {
            "bufferView": len(self.views) - 1,
            "componentType": SHORT if whole else FLOAT,
        }
        accessor |= {"count": len(raw), "type": kind}
        if bounds:
            accessor |= {
                "min": raw.min(axis=0).tolist(),
                "max": raw.max(axis=0).tolist(),
            }
        self.accessors.append(accessor)
        self.bytes += raw.tobytes() + b"\0" * (-raw.nbytes % 4)
        return len(self.accessors) - 1


def _capped_cone(
    offset: Array, radii: Sequence[float] | Array
) -> tuple[Array, Array, NDArray[np.int64]]:
    """Return a cone with hemispheres at its ends: points, normals, triangles' corners.

    Points and normals have shape (n, 3), the corners (3 m,).
    """
    length = float(np.linalg.norm(offset))
    down = np.linspace(-0.5 * np.pi, 0.0, CAP)
    up = np.linspace(0.0, 0.5 * np.pi, CAP)
    # the rings of both hemispheres: their latitudes, and the balls' radii and centres
    latitudes = np.concatenate([down, up])
    ring_radii = np.repeat([radii[0], radii[1]], CAP)
    ring_middles = np.repeat([0.0, length], CAP)
    around = np.linspace(0.0, 2.0 * np.pi, RING_CORNERS, endpoint=False)
    outward = []  # unit vectors, ring by ring
    for a in latitudes:
        for b in around:
            outward.append((np.cos(a) * np.cos(b), np.sin(a), np.cos(a) * np.sin(b)))
    normals = np.array(outward)
    points = np.repeat(ring_radii, RING_CORNERS)[:, None] * normals
    points[:, 1] += np.repeat(ring_middles, RING_CORNERS)
    ring, k = np.divmod(np.arange((len(latitudes) - 1) * RING_CORNERS), RING_CORNERS)
    low = ring * RING_CORNERS
    high = (ring + 1) * RING_CORNERS
    after = (k + 1) % RING_CORNERS
    corners = np.stack(
        [low + k, high + k, low + after, low + after, high + k, high + after], axis=1
    ).ravel()
    turn = along_y(offset).T
    return points @ turn, normals @ turn, corners
