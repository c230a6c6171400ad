"""What other programs read: .glb and OpenSim's files, by readers that know these formats and nothing of posefit."""

import json
import struct
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS
from posefit.measuring.centres import PLACES
from posefit.motion import built_in
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


def test_a_glb_file_holds_the_joints_and_closed_shapes(tmp_path: Path) -> None:
    write_glb(tmp_path / "track.glb", MOTION, BODY.radii)
    raw = (tmp_path / "track.glb").read_bytes()
    magic, version, total, size, kind = struct.unpack("<4sII I4s", raw[:20])
    assert (magic, version, total, kind) == (b"glTF", 2, len(raw), b"JSON")
    document = json.loads(raw[20 : 20 + size])
    binary = raw[28 + size :]
    assert document["buffers"] == [{"byteLength": len(binary)}]

    def values(number: int) -> Array:
        accessor = document["accessors"][number]
        view = document["bufferViews"][accessor["bufferView"]]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
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

    nodes, (animation,) = document["nodes"], document["animations"]
    tracks = {
        (one["target"]["node"], one["target"]["path"]): values(
            animation["samplers"][one["sampler"]]["output"]
        )
        for one in animation["channels"]
    }
    for frame in (0, 6):
        world: dict[int, Array] = {}

        def place(
            node: int, above: Array, frame: int = frame, world: dict[int, Array] = world
        ) -> None:
            turn = tracks.get((node, "rotation"), np.array([[0.0, 0.0, 0.0, 1.0]] * 7))[
                frame
            ]
            at = (
                tracks[0, "translation"][frame]
                if node == 0
                else nodes[node]["translation"]
            )
            world[node] = above @ affine(Rotation.from_quat(turn).as_matrix(), at)
            for child in nodes[node].get("children", []):
                place(child, world[node])

        place(document["scenes"][0]["nodes"][0], np.eye(4))
        starts = np.array([world[joint][:3, 3] for joint in range(1, len(JOINTS))])
        np.testing.assert_allclose(
            starts, MOTION.joints[frame][list(PARENTS[1:])], atol=1e-5
        )
    for mesh, offset, (first, last) in zip(
        document["meshes"], MOTION.skeleton.offsets, BODY.radii, strict=True
    ):
        (part,) = mesh["primitives"]
        points = values(part["attributes"]["POSITION"])
        corners = points[values(part["indices"]).astype(int).reshape(-1, 3)]
        inside = (
            np.einsum(
                "ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])
            ).sum()
            / 6.0
        )
        # a cone and two half balls, whose corners lie on them: a little less
        length = np.linalg.norm(offset)
        volume = (
            np.pi
            * (
                length * (first**2 + first * last + last**2)
                + 2.0 * (first**3 + last**3)
            )
            / 3.0
        )
        assert 0.88 * volume < inside < volume
