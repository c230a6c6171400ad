"""What other programs read: .glb and OpenSim's files, by readers that know these formats and nothing of posefit."""

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.skeleton import BONES, ENDS, JOINTS, PARENTS
from posefit.measuring.centres import PLACES
from posefit.motion import built_in
from posefit.motion.bvh import NAMES
from posefit.motion.gltf import write_glb
from posefit.motion.opensim import DENSITY, write_mot, write_osim

MOTION = built_in.motion("run", frames=7)
BODY = Body.of(MOTION.skeleton)


def affine(turn: Array, place: Any) -> Array:
    return np.vstack([np.column_stack([turn, place]), [0.0, 0.0, 0.0, 1.0]])


def numbers(text: str | None) -> Array:
    return np.array((text or "").split(), dtype=np.float64)


def read_mot(path: Path) -> dict[str, Array]:
    head, table = path.read_text().split("endheader\n")
    assert "inDegrees=yes" in head
    names, *rows = table.splitlines()
    columns = np.array([numbers(row) for row in rows]).T
    assert f"nRows={len(rows)}" in head
    assert f"nColumns={len(columns)}" in head
    return dict(zip(names.split("\t"), columns, strict=True))


def markers_of(
    model: ElementTree.Element, values: dict[str, float]
) -> dict[str, Array]:
    """Return where the markers of a model are, by the rules of OpenSim's CustomJoint and WeldJoint."""
    world = {"/ground": np.eye(4)}
    # until all parents are there
    for joint in [*model.iter("CustomJoint"), *model.iter("WeldJoint")] * len(BONES):
        ends = []
        for frame in joint.iter("PhysicalOffsetFrame"):
            turn = Rotation.from_euler(
                "XYZ", numbers(frame.findtext("orientation"))
            ).as_matrix()
            ends.append(
                (
                    frame.findtext("socket_parent") or "",
                    affine(turn, numbers(frame.findtext("translation"))),
                )
            )
        (parent, first), (child, last) = ends
        moved = np.eye(4)
        shift = np.zeros(3)
        for one in joint.iter("TransformAxis"):
            name = one.findtext("coordinates")
            axis = numbers(one.findtext("axis"))
            value = values[name] if name else 0.0
            if "translation" in one.attrib["name"]:
                shift += value * axis
            else:
                moved[:3, :3] = (
                    moved[:3, :3]
                    @ Rotation.from_rotvec(np.radians(value) * axis).as_matrix()
                )
        moved[:3, 3] = shift
        if parent in world:
            world[child] = world[parent] @ first @ moved @ np.linalg.inv(last)
    frames = {
        one.attrib["name"]: world[one.findtext("socket_parent_frame") or ""]
        for one in model.iter("Marker")
    }
    places = {
        one.attrib["name"]: numbers(one.findtext("location"))
        for one in model.iter("Marker")
    }
    return {name: (frame @ [*places[name], 1.0])[:3] for name, frame in frames.items()}


def test_opensims_joints_are_posefits(tmp_path: Path) -> None:
    write_osim(tmp_path / "model.osim", BODY, PLACES)
    write_mot(tmp_path / "track.mot", MOTION)
    model = ElementTree.parse(tmp_path / "model.osim").getroot()
    table = read_mot(tmp_path / "track.mot")
    assert {one.attrib["name"] for one in model.iter("Coordinate")} | {
        "time"
    } == table.keys()
    np.testing.assert_allclose(table["time"], np.arange(7) / MOTION.fps, atol=1e-8)
    for frame in (0, 6):
        markers = markers_of(
            model, {name: column[frame] for name, column in table.items()}
        )
        found = np.array([markers[place] for place in PLACES])
        np.testing.assert_allclose(found, MOTION.joints[frame], atol=1e-6)
    first, last = BODY.radii[BONES.index("lfemur")]
    length = MOTION.skeleton.lengths[BONES.index("lfemur")]
    masses = {
        one.attrib["name"]: float(one.findtext("mass") or 0.0)
        for one in model.iter("Body")
    }
    steps = np.linspace(first, last, 20001)  # a cone as a stack of discs
    np.testing.assert_allclose(
        masses["lfemur"], DENSITY * np.pi * length * (steps**2).mean(), rtol=1e-4
    )


def read_glb(path: Path) -> tuple[dict[str, Any], Callable[[int], Array]]:
    """Return the description in a .glb file, and a reader of its arrays by number."""
    raw = path.read_bytes()
    magic, version, total, size, kind = struct.unpack("<4sII I4s", raw[:20])
    assert (magic, version, total, kind) == (b"glTF", 2, len(raw), b"JSON")
    document = json.loads(raw[20 : 20 + size])
    binary = raw[28 + size :]
    assert document["buffers"] == [{"byteLength": len(binary)}]

    def values(number: int) -> Array:
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[accessor["type"]]
        kind = {5126: "<f4", 5123: "<u2"}[accessor["componentType"]]
        found = np.frombuffer(
            binary, kind, accessor["count"] * width, view["byteOffset"]
        ).reshape(-1, width)
        if "min" in accessor:
            np.testing.assert_array_equal(
                [found.min(axis=0), found.max(axis=0)],
                [accessor["min"], accessor["max"]],
            )
        return found.astype(np.float64)

    return document, values


def nodes_of(
    document: dict[str, Any], values: Callable[[int], Array], frame: int | None
) -> list[Array]:
    """Return the frame (4, 4) of each node in a frame of the animation, or at rest."""
    nodes = document["nodes"]
    moved: dict[tuple[int, str], Array] = {}
    if frame is not None:
        (animation,) = document["animations"]
        for one in animation["channels"]:
            samples = values(animation["samplers"][one["sampler"]]["output"])
            moved[one["target"]["node"], one["target"]["path"]] = samples[frame]
    world = [np.eye(4)] * len(nodes)

    def place(number: int, above: Array) -> None:
        node = nodes[number]
        turn = moved.get((number, "rotation"), np.array([0.0, 0.0, 0.0, 1.0]))
        at = moved.get((number, "translation"), node.get("translation", np.zeros(3)))
        world[number] = above @ affine(Rotation.from_quat(turn).as_matrix(), at)
        for child in node.get("children", []):
            place(child, world[number])

    for root in document["scenes"][0]["nodes"]:
        place(root, np.eye(4))
    return world


def test_a_glb_files_armature_moves_as_the_joints_do(tmp_path: Path) -> None:
    write_glb(tmp_path / "track.glb", MOTION, BODY.radii)
    document, values = read_glb(tmp_path / "track.glb")
    (skin,) = document["skins"]
    names = [document["nodes"][number]["name"] for number in skin["joints"]]
    ends = [f"{NAMES[JOINTS[joint]]}_End" for joint in ENDS]
    assert names == [*(NAMES[joint] for joint in JOINTS), *ends]
    shown = [0, *PARENTS[1:], *ENDS]
    binds = values(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
    at_rest = nodes_of(document, values, None)
    for number, bind in zip(skin["joints"], binds, strict=True):
        # at rest the skin is where the mesh is
        np.testing.assert_allclose(at_rest[number] @ bind, np.eye(4), atol=1e-6)
    (mesh,) = document["meshes"]
    for frame in range(len(MOTION)):
        world = nodes_of(document, values, frame)
        places = np.array([world[number][:3, 3] for number in skin["joints"]])
        np.testing.assert_allclose(places, MOTION.joints[frame][shown], atol=1e-6)
        for part in mesh["primitives"]:
            attributes = part["attributes"]
            points = values(attributes["POSITION"])
            weights = values(attributes["WEIGHTS_0"])
            np.testing.assert_array_equal(weights.sum(axis=1), 1.0)
            joints = values(attributes["JOINTS_0"]).astype(int)
            moving = np.array(
                [
                    world[number] @ bind
                    for number, bind in zip(skin["joints"], binds, strict=True)
                ]
            )
            blended = (weights[..., None, None] * moving[joints]).sum(axis=1)
            skinned = (
                blended @ np.column_stack([points, np.ones(len(points))])[..., None]
            )
            # each cone surrounds its bone, in every pose
            joint = joints[:, 0]
            start = MOTION.joints[frame][list(PARENTS)][joint]
            along = MOTION.joints[frame][joint] - start
            length = np.linalg.norm(along, axis=1)
            reach = skinned[:, :3, 0] - start
            share = np.clip((reach * along).sum(axis=1) / length**2, 0.0, 1.0)
            away = np.linalg.norm(reach - share[:, None] * along, axis=1)
            assert (away <= BODY.radii[joint - 1].max(axis=1) + 1e-6).all()


def test_a_glb_files_cones_are_closed(tmp_path: Path) -> None:
    write_glb(tmp_path / "track.glb", MOTION, BODY.radii)
    document, values = read_glb(tmp_path / "track.glb")
    (mesh,) = document["meshes"]
    volumes = np.zeros(len(BONES))
    for part in mesh["primitives"]:
        points = values(part["attributes"]["POSITION"])
        indices = values(part["indices"]).astype(int).reshape(-1, 3)
        corners = points[indices]
        (owners,) = values(part["attributes"]["JOINTS_0"])[indices[:, 0]].T[:1]
        inside = np.einsum(
            "ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])
        )
        np.add.at(volumes, owners.astype(int) - 1, inside / 6.0)
    # a cone and two half balls, whose corners lie on them: a little less
    first, last = BODY.radii.T
    length = MOTION.skeleton.lengths
    cone = length * (first**2 + first * last + last**2)
    whole = np.pi * (cone + 2.0 * (first**3 + last**3)) / 3.0
    assert (volumes > 0.88 * whole).all()
    assert (volumes < whole).all()
