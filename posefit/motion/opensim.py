"""OpenSim's files: a model of the person's bones (.osim) and their motion (.mot).

The model has the skeleton's own kinematics: each bone is a rigid body whose frame stands where the bone starts, and
turns by the skeleton's angles, so that the joints are where posefit has them. Its masses are those of cones of water;
it has no muscles. Markers are named as in a track's .trc file, so that OpenSim's own inverse kinematics takes it, too.
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

VERSION = "40000"  # of the file's format: OpenSim 4
DENSITY = 1000.0  # kilograms a cubic metre
ROOT_KILOGRAMS = 1e-3  # a joint has no volume, and a body has to have a mass
_TURNS = ("rx", "ry", "rz")
_ROOT = ("root_rx", "root_ry", "root_rz", "root_tx", "root_ty", "root_tz")


def coordinates(skeleton: Skeleton) -> dict[str, int]:
    """Return OpenSim's coordinates, such as `lfemur_rx`, and for each where it stands in a pose (66,).

    The root's three turns come first; its translations are no angles, and are not among them.
    """
    places = dict(zip(_ROOT[:3], (1, 0, 2), strict=True))
    for bone in BONES:
        for turn, angle in zip(_TURNS, channel_angles(bone, _TURNS), strict=False):
            if skeleton.free[angle]:
                places[f"{bone}_{turn}"] = angle
    return places


def write_mot(path: str | Path, motion: Motion) -> None:
    """Write a motion's coordinates, one row a frame: time in seconds, angles in degrees, the root's place in metres."""
    path = Path(path)
    angles = coordinates(motion.skeleton)
    turns = np.degrees(unwrapped(motion.poses[:, list(angles.values())]))
    table = np.column_stack(
        [
            (motion.first + np.arange(len(motion))) / motion.fps,
            turns,
            motion.translations,
        ]
    )
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
    """Write the model of a body; `markers` are the names (27,) of the markers at its joints."""
    skeleton = body.skeleton
    document = Element("OpenSimDocument", Version=VERSION)
    model = SubElement(document, "Model", name=skeleton.name)
    _text(model, "gravity", (0.0, -9.80665, 0.0))
    SubElement(model, "Ground", name="ground")
    bodies, joints, marked = (
        SubElement(SubElement(model, kind, name=kind.lower()), "objects")
        for kind in ("BodySet", "JointSet", "MarkerSet")
    )
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
        turns = [f"{name}_{_TURNS[axis]}" for axis in JOINT_ORDER]
        kind = "CustomJoint" if any(turn in free for turn in turns) else "WeldJoint"
        joint = _joint(
            joints, kind, name, f"/bodyset/{JOINTS[start]}", at, skeleton.axes[bone]
        )
        if kind == "CustomJoint":
            own = [turn if turn in free else "" for turn in turns]
            _mobile(joint, own, np.eye(3)[list(JOINT_ORDER)], ("", "", ""), skeleton)
        _marker(marked, markers[bone + 1], name, offset)
    indent(document)
    ElementTree(document).write(path, encoding="utf-8", xml_declaration=True)


def _inertia(offset: Array, radii: Array) -> tuple[float, Array, Array]:
    """Return the mass of a bone's cone, its centre (3,), and its inertia (3, 3) there, as a cylinder's as heavy."""
    length, (first, last) = float(np.linalg.norm(offset)), radii
    square = float(first * first + first * last + last * last) / 3.0
    mass = max(DENSITY * np.pi * length * square, ROOT_KILOGRAMS)
    along = offset / max(length, 1e-9)
    across = mass * (3.0 * square + length * length) / 12.0
    about = 0.5 * mass * square
    line = np.outer(along, along)
    return (
        mass,
        0.5 * offset,
        across * (np.eye(3) - line) + about * line + 1e-9 * np.eye(3),
    )


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
    _text(
        body,
        "inertia",
        [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]],
    )


def _joint(
    joints: Element, kind: str, name: str, parent: str, at: Array, axes: Array
) -> Element:
    """Return a joint from a point of a parent's frame to a body's origin, whose angles are about some axes (3, 3)."""
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
    """Give a joint its coordinates: turns about axes (3, 3), the outermost first, and moves; "" is none."""
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
    if skeleton.limits is None or angle < 3:
        return (-10.0, 10.0) if name in _ROOT[3:] else (-2.0 * np.pi, 2.0 * np.pi)
    return map(float, skeleton.limits[angle - 3])


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
