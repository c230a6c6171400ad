"""Writes OpenSim's files: a model of the person's bones (.osim), their motion (.mot).

The model has the skeleton's own kinematics. Each bone is a rigid body whose frame is at
the bone's start and turns by the skeleton's angles, so that the joints are where
posefit has them. The bodies have the masses of cones of water; there are no muscles.
Markers have the names of a track's .trc file, so that OpenSim's own inverse kinematics
accepts that file, too.
"""

from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, ElementTree, SubElement, indent

import numpy as np

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.rotation import (
    JOINT_ORDER,
    ROOT_ORDER,
    along_y,
    angles_about,
    unwrapped,
)
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS, Skeleton, channel_angles
from posefit.motion.motion import Motion

VERSION = "40000"  # version of the file format: OpenSim 4
DENSITY = 1000.0  # kilograms per cubic metre
ROOT_KILOGRAMS = 1e-3  # the root has no volume, but OpenSim demands a mass
_TURNS = ("rx", "ry", "rz")
_ROOT = ("root_rx", "root_ry", "root_rz", "root_tx", "root_ty", "root_tz")


def coordinates(skeleton: Skeleton) -> dict[str, int]:
    """Return OpenSim's coordinates, such as `lfemur_rx`, as indices into a pose (66,).

    The root's three turns come first. Its translations are not included.
    """
    places = dict(zip(_ROOT[:3], (1, 0, 2), strict=True))
    for bone in BONES:
        for turn, angle in zip(_TURNS, channel_angles(bone, _TURNS), strict=False):
            if skeleton.free[angle]:
                places[f"{bone}_{turn}"] = angle
    return places


def write_mot(path: str | Path, motion: Motion) -> None:
    """Write a motion's coordinates as a .mot file, one row per frame.

    The columns are time in seconds, angles in degrees, and the root's place in metres.
    """
    path = Path(path)
    angles = coordinates(motion.skeleton)
    turns = np.degrees(unwrapped(motion.poses[:, list(angles.values())]))
    times = (motion.first + np.arange(len(motion))) / motion.fps
    table = np.column_stack([times, turns, motion.translations])
    head = [
        path.name,
        "version=1",
        f"nRows={len(table)}",
        f"nColumns={table.shape[1]}",
        "inDegrees=yes",
        "endheader",
    ]
    head.append("\t".join(["time", *angles, *_ROOT[3:]]))
    np.savetxt(
        path, table, "%.8f", "\t", header="\n".join(head), comments="", encoding="utf-8"
    )


def write_osim(path: str | Path, body: Body, markers: Sequence[str]) -> None:
    """Write the model of a body as an .osim file.

    Args:
        path: The file.
        body: Skeleton and radii.
        markers: Names (27,) of the markers at the joints.
    """
    skeleton = body.skeleton
    document = Element("OpenSimDocument", Version=VERSION)
    model = SubElement(document, "Model", name=skeleton.name)
    _text(model, "gravity", (0.0, -9.80665, 0.0))
    SubElement(model, "Ground", name="ground")
    bodies = _objects(model, "BodySet")
    joints = _objects(model, "JointSet")
    marked = _objects(model, "MarkerSet")
    free = coordinates(skeleton)
    _body(bodies, "root", ROOT_KILOGRAMS, np.zeros(3), 1e-6 * np.eye(3))
    root = _joint(joints, "CustomJoint", "root", "/ground", np.zeros(3), np.eye(3))
    _mobile(
        root,
        [_ROOT[axis] for axis in ROOT_ORDER],
        np.eye(3)[list(ROOT_ORDER)],
        _ROOT[3:],
        skeleton,
    )
    _marker(marked, markers[0], "root", np.zeros(3))
    for bone, name in enumerate(BONES):
        start = PARENTS[bone + 1]
        offset = skeleton.offsets[bone]
        _body(
            bodies,
            name,
            *_inertia(offset, body.radii[bone]),
            shape=(offset, body.radii[bone]),
        )
        at = skeleton.offsets[start - 1] if start else np.zeros(3)
        turns = []
        for axis in JOINT_ORDER:
            turn = f"{name}_{_TURNS[axis]}"
            # an axis about which the joint cannot turn has no coordinate
            turns.append(turn if turn in free else "")
        kind = "CustomJoint" if any(turns) else "WeldJoint"
        joint = _joint(
            joints, kind, name, f"/bodyset/{JOINTS[start]}", at, skeleton.axes[bone]
        )
        if kind == "CustomJoint":
            _mobile(joint, turns, np.eye(3)[list(JOINT_ORDER)], ("", "", ""), skeleton)
        _marker(marked, markers[bone + 1], name, offset)
    indent(document)
    ElementTree(document).write(path, encoding="utf-8", xml_declaration=True)


def _objects(model: Element, kind: str) -> Element:
    """Return the empty list of objects of a new set of the model, such as BodySet."""
    return SubElement(SubElement(model, kind, name=kind.lower()), "objects")


def _inertia(offset: Array, radii: Array) -> tuple[float, Array, Array]:
    """Return a bone's mass, its centre (3,), and its inertia (3, 3) there.

    The mass is a cone's, the inertia that of a cylinder of the same mass.
    """
    length = float(np.linalg.norm(offset))
    first, last = radii
    # the mean square of a radius that changes linearly
    square = float(first * first + first * last + last * last) / 3.0
    mass = max(DENSITY * np.pi * length * square, ROOT_KILOGRAMS)
    along = offset / max(length, 1e-9)
    across = mass * (3.0 * square + length * length) / 12.0
    about = 0.5 * mass * square
    line = np.outer(along, along)
    # the last term: a bone without a length would have a singular inertia
    inertia = across * (np.eye(3) - line) + about * line + 1e-9 * np.eye(3)
    return mass, 0.5 * offset, inertia


def _body(
    bodies: Element,
    name: str,
    mass: float,
    centre: Array,
    inertia: Array,
    shape: tuple[Array, Array] | None = None,
) -> None:
    body = SubElement(bodies, "Body", name=name)
    if shape is not None:
        offset, radii = shape
        length = float(np.linalg.norm(offset))
        middle = _frame(
            SubElement(body, "components"),
            f"{name}_middle",
            "..",
            0.5 * offset,
            along_y(offset),
        )
        cylinder = SubElement(
            SubElement(middle, "attached_geometry"), "Cylinder", name=f"{name}_shape"
        )
        _text(cylinder, "radius", [radii.mean()])
        _text(cylinder, "half_height", [0.5 * length])
    _text(body, "mass", [mass])
    _text(body, "mass_center", centre)
    products = [inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    _text(body, "inertia", [*np.diag(inertia), *products])


def _joint(
    joints: Element, kind: str, name: str, parent: str, at: Array, axes: Array
) -> Element:
    """Return a joint between a parent's frame and a body's origin.

    Args:
        joints: The element to which the joint is added.
        kind: OpenSim's kind of joint.
        name: The name of the body.
        parent: Path of the parent's frame.
        at: The joint's position (3,) in the parent's frame.
        axes: Axes (3, 3) of the joint's angles.
    """
    joint = SubElement(joints, kind, name=f"{name}_joint")
    SubElement(joint, "socket_parent_frame").text = f"{name}_parent"
    SubElement(joint, "socket_child_frame").text = f"{name}_child"
    frames = SubElement(joint, "frames")
    _frame(frames, f"{name}_parent", parent, at, axes)
    _frame(frames, f"{name}_child", f"/bodyset/{name}", np.zeros(3), axes)
    return joint


def _mobile(
    joint: Element,
    turns: Sequence[str],
    axes: Array,
    moves: Sequence[str],
    skeleton: Skeleton,
) -> None:
    """Give a joint its coordinates.

    Args:
        joint: The joint.
        turns: Names of its turns, the outermost first; "" for a fixed axis.
        axes: Axes (3, 3) of the turns.
        moves: Names of its translations along x, y, z; "" for a fixed axis.
        skeleton: The skeleton, which has the limits of the angles.
    """
    listed = SubElement(joint, "coordinates")
    for name in (*turns, *moves):
        if name:
            coordinate = SubElement(listed, "Coordinate", name=name)
            _text(coordinate, "range", _limits(name, skeleton))
    transform = SubElement(joint, "SpatialTransform")
    for kind, names, about in (
        ("rotation", turns, axes),
        ("translation", moves, np.eye(3)),
    ):
        for k, (name, axis) in enumerate(zip(names, about, strict=True)):
            along = SubElement(transform, "TransformAxis", name=f"{kind}{k + 1}")
            SubElement(along, "coordinates").text = name
            _text(along, "axis", axis)
            if name:
                _text(
                    SubElement(along, "LinearFunction", name="function"),
                    "coefficients",
                    (1.0, 0.0),
                )
            else:
                _text(SubElement(along, "Constant", name="function"), "value", (0.0,))


def _limits(name: str, skeleton: Skeleton) -> Iterable[float]:
    angle = coordinates(skeleton).get(name, 0)
    if skeleton.limits is not None and angle >= 3:
        return map(float, skeleton.limits[angle - 3])
    if name in _ROOT[3:]:
        return -10.0, 10.0
    return -2.0 * np.pi, 2.0 * np.pi


def _frame(parent: Element, name: str, of: str, at: Array, axes: Array) -> Element:
    frame = SubElement(parent, "PhysicalOffsetFrame", name=name)
    SubElement(frame, "socket_parent").text = of
    _text(frame, "translation", at)
    _text(frame, "orientation", angles_about((0, 1, 2), axes))
    return frame


def _marker(marked: Element, name: str, body: str, at: Array) -> None:
    marker = SubElement(marked, "Marker", name=name)
    SubElement(marker, "socket_parent_frame").text = f"/bodyset/{body}"
    _text(marker, "location", at)


def _text(parent: Element, kind: str, values: Iterable[float]) -> None:
    SubElement(parent, kind).text = " ".join(f"{value:.10g}" for value in values)
