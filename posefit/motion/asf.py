"""Acclaim skeletons (.asf): read into a `Skeleton`, and written from one."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.body import Body
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    rotation_from_joint_angles,
)
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    INNER,
    JOINTS,
    PARENTS,
    Skeleton,
    channel_angles,
)
from posefit.geometry.units import (
    CMU_UNIT,
    INCH,
    STATURES,
    UNIT_NAMES,
    Unit,
    metres_of,
    unit_of,
)
from posefit.motion.lines import LARGEST, Line, lines_of
from posefit.reading import check_size, quoted

SIZE_LIMIT = 1_000_000  # bytes; CMU's files have 7,000
FULL_TURN = 2.0 * np.pi  # radians
ROOT_CHANNELS = ("TX", "TY", "TZ", "RX", "RY", "RZ")
# bones that a Skeleton knows only by their channels, and their parents
_FINGERS = {
    "lfingers": "lhand",
    "lthumb": "lwrist",
    "rfingers": "rhand",
    "rthumb": "rwrist",
}


class _Bone(NamedTuple):
    vector: Array  # (3,) file units
    axis: Array  # (3,) radians
    free: tuple[str, ...]
    limits: Array | None  # (free, 2) radians


class Acclaim(NamedTuple):
    """Content of an .asf file: skeleton, metres per unit, and guesses."""

    skeleton: Skeleton
    metres: float
    notes: tuple[str, ...] = ()


def parse_asf(path: str | Path, unit: Unit | None = None) -> Acclaim:
    """Return the content of an .asf file.

    If the stated unit makes the person impossibly tall or small, and a known unit gives
    a plausible height, that unit is taken, and a note says so. Bones other than the 26
    of `posefit.geometry.skeleton.BONES` are kept in `channels` only.

    Args:
        path: The file.
        unit: Length unit of the file, by default as stated in it.

    Raises:
        InputError: The file is not an Acclaim skeleton with the 26 bones; the message
            has its name and the line.
    """
    path = Path(path)
    check_size(path, SIZE_LIMIT)
    sections = _sections(path)
    metres, degrees = _units(sections.get("units", []))
    _check_root(sections["root"])
    bones = _bones(sections["bonedata"], np.pi / 180.0 if degrees else 1.0)
    _check_tree(path, sections["hierarchy"], bones)
    vectors = []
    axes = []
    for name in BONES:
        vectors.append(bones[name].vector)
        axes.append(bones[name].axis)
    channels = []
    # of fingers, too: a motion's file has angles for them, and a pose has none
    for name, bone in bones.items():
        if bone.free:
            channels.append((name, bone.free))
    stated = Skeleton(
        name=path.stem,
        offsets=np.array(vectors) * metres,
        axes=rotation_from_joint_angles(np.array(axes)),
        channels=tuple(channels),
        limits=_limits(bones),
    )
    wanted = metres if unit is None else metres_of(unit)
    notes = list[str]()
    # a file may state a unit that it does not use
    stature = Body.of(stated).stature
    if unit is None and not STATURES[0] <= stature <= STATURES[1]:
        guess = unit_of(stature / metres)
        came = f"{path}: in the unit that it states, the person is {stature:.2f} m tall"
        if guess is not None:
            wanted = metres_of(guess)
            came += (
                f"; lengths are taken as {UNIT_NAMES[guess]}: "
                f"{stature / metres * wanted:.2f} m; --unit sets it"
            )
        notes.append(came)
    ratio = wanted / metres
    skeleton = stated
    if ratio != 1.0:
        skeleton = replace(stated, offsets=stated.offsets * ratio)
    return Acclaim(skeleton, wanted, tuple(notes))


def _limits(bones: dict[str, _Bone]) -> Array | None:
    """Return the limits (63, 2) of the joint angles, or None if some are unknown."""
    limits = np.zeros((ANGLES, 2))
    for joint in INNER:
        name = JOINTS[joint]
        bone = bones[name]
        if not bone.free:
            continue
        if bone.limits is None:
            return None
        limits[channel_angles(name, bone.free)] = bone.limits
    return limits[3:]


def _sections(path: Path) -> dict[str, list[Line]]:
    """Return the lines of each section. The first line contains the section's name."""
    sections: dict[str, list[Line]] = {}
    current: list[Line] | None = None
    for line in lines_of(path, SIZE_LIMIT):
        if line.key.startswith(":"):
            if line.key[1:] in sections:
                raise line.mistake(f"one section {line.key}", "a second one")
            current = sections[line.key[1:]] = []
        if line.words and not line.key.startswith("#"):
            if current is None:
                raise line.mistake("a section such as :units")
            current.append(line)
    for name in ("root", "bonedata", "hierarchy"):
        if name not in sections:
            raise line.mistake(f"a section :{name}")
    return sections


def _units(lines: list[Line]) -> tuple[float, bool]:
    """Return metres per file unit, and whether angles are degrees.

    Acclaim's defaults are inches and degrees.
    """
    metres = INCH
    degrees = True
    for line in lines[1:]:
        if line.key == "length":
            (unit,) = line.numbers(1)
            if unit < 1.0 / LARGEST:
                raise line.mistake("a positive length unit")
            metres = INCH / unit
        elif line.key == "angle":
            if len(line.words) != 2 or line.words[1].lower() not in ("deg", "rad"):
                raise line.mistake("'angle deg' or 'angle rad'")
            degrees = line.words[1].lower() == "deg"
    return metres, degrees


def _check_root(lines: list[Line]) -> None:
    wanted = {"order": " ".join(ROOT_CHANNELS), "axis": "XYZ"}
    for line in lines[1:]:
        if line.key in wanted and " ".join(line.words[1:]).upper() != wanted[line.key]:
            raise line.mistake(f"root {line.key} {wanted[line.key]}")
        # a moved or turned root would change the meaning of every root channel
        if line.key in ("position", "orientation") and any(line.numbers(3)):
            raise line.mistake(f"root {line.key} 0 0 0")
    if all(line.key != "order" for line in lines):
        raise lines[-1].mistake(f"root order {wanted['order']}", "none")


def _bones(lines: list[Line], radians: float) -> dict[str, _Bone]:
    bones: dict[str, _Bone] = {}
    block: dict[str, Line] | None = None
    for line in lines[1:]:
        if line.key == "begin" and block is None:
            block = {}
        elif block is None or line.key == "begin":
            expected = "'end' before the next bone"
            if block is None:
                expected = "'begin'"
            raise line.mistake(expected)
        elif line.key == "end":
            for key in ("name", "direction", "length", "axis"):
                if key not in block:
                    raise line.mistake(f"a bone with a {key}", "none")
            name = " ".join(block["name"].words[1:])
            if len(block["name"].words) != 2 or name == "root" or name in bones:
                raise block["name"].mistake("one new name")
            bones[name] = _bone(block, radians)
            block = None
        elif line.words[0].startswith("(") and "limits" in block:
            block["limits"] = block["limits"]._replace(
                words=[*block["limits"].words, *line.words]
            )
        else:
            block[line.key] = line
    if block is not None:
        raise lines[-1].mistake("'end' of the bone", "the end of the section")
    return bones


def _bone(block: dict[str, Line], radians: float) -> _Bone:
    direction = np.array(block["direction"].numbers(3))
    (length,) = block["length"].numbers(1)
    norm = float(np.linalg.norm(direction))
    if length < 0.0:
        raise block["length"].mistake("a length of 0 or more")
    if length > 0.0 and norm < 1.0 / LARGEST:
        raise block["direction"].mistake("a direction that is not zero")
    axis = block["axis"]
    if len(axis.words) != 5 or axis.words[4].upper() != "XYZ":
        raise axis.mistake("axis order XYZ")
    angles = np.array(axis._replace(words=axis.words[:4]).numbers(3))
    if np.abs(angles * radians).max() > FULL_TURN:
        raise axis.mistake("an axis of up to 360 degrees, or 6.28 radians")
    free: tuple[str, ...] = ()
    if "dof" in block:
        free = tuple(word.lower() for word in block["dof"].words[1:])
    if not set(free) <= {"rx", "ry", "rz"} or sorted(set(free)) != list(free):
        raise block["dof"].mistake("dof out of rx ry rz, in this order")
    limits = None
    # (lowest highest) for each free angle, such as `(-160.0 20.0)`, on one line or more
    if "limits" in block:
        text = " ".join(block["limits"].words)
        words = text.replace("(", " ").replace(")", " ").split()
        numbers = block["limits"]._replace(words=words).numbers(2 * len(free))
        limits = np.array(numbers).reshape(-1, 2) * radians  # (free angles, 2)
        if (limits[:, 0] > limits[:, 1]).any():
            raise block["limits"].mistake("limits (lowest highest) in order")
    return _Bone(
        direction / norm * length if length > 0.0 else np.zeros(3),
        angles * radians,
        free,
        limits,
    )


def _check_tree(path: Path, lines: list[Line], bones: Iterable[str]) -> None:
    known = {"root", *bones}
    for name in BONES:
        if name not in known:
            raise InputError(
                f"{path}: the skeleton needs bone {name!r}, "
                "which this file does not define"
            )
    parents: dict[str, tuple[str, Line]] = {}
    for line in lines[1:]:
        if line.key in ("begin", "end") and len(line.words) == 1:
            continue
        for name in line.words:
            if name not in known:
                raise line.mistake("bones that :bonedata defines", repr(name))
        for name in line.words[1:]:
            if name in parents or name == "root":
                raise line.mistake(
                    "one parent for each bone", f"a second one for {quoted(name)}"
                )
            parents[name] = line.words[0], line
    for name, above in zip(BONES, PARENTS[1:], strict=True):
        if name not in parents:
            raise lines[-1].mistake(f"bone {name!r} in the hierarchy", "none")
        parent, line = parents[name]
        if parent != JOINTS[above]:
            raise line.mistake(
                f"bone {name!r} under {JOINTS[above]!r}", f"it under {quoted(parent)}"
            )


def write_asf(path: str | Path, skeleton: Skeleton) -> None:
    """Write a skeleton as an .asf file in the CMU database's unit.

    The file reads back as the same skeleton. Bones of which only the channels are
    known, such as fingers, get the length 0.
    """
    axes = np.rad2deg(joint_angles_from_rotation(skeleton.axes))
    name = "_".join(skeleton.name.split()) or "skeleton"
    header = (
        f":version 1.10\n:name {name}\n:units\n  mass 1.0\n"
        f"  length {INCH / CMU_UNIT!r}\n  angle deg\n"
        f":root\n  order {' '.join(ROOT_CHANNELS)}\n  axis XYZ\n"
        "  position 0 0 0\n  orientation 0 0 0\n:bonedata\n"
    )
    text = [header]
    turning = dict(skeleton.channels)
    fixed = [(name, ()) for name in BONES if name not in turning]
    channels = [*fixed, *skeleton.channels]
    for number, (name, free) in enumerate(channels, 1):
        direction = [1.0, 0.0, 0.0]
        length = 0.0
        axis = [0.0, 0.0, 0.0]
        if name in BONES:
            bone = BONES.index(name)
            length = float(skeleton.lengths[bone])
            axis = axes[bone].tolist()
            if length > 0.0:
                direction = (skeleton.offsets[bone] / length).tolist()
        dof = f"    dof {' '.join(free)}\n" if free else ""
        if skeleton.limits is not None and (angles := channel_angles(name, free)):
            # a pose begins with the root's three angles, which have no limits
            rows = np.degrees(skeleton.limits[np.array(angles) - 3]).tolist()
            pairs = [f"({low!r} {high!r})" for low, high in rows]
            dof += "    limits " + "\n           ".join(pairs) + "\n"
        text.append(
            f"  begin\n    id {number}\n    name {name}\n"
            f"    direction {_spaced(direction)}\n    length {length / CMU_UNIT!r}\n"
            f"    axis {_spaced(axis)} XYZ\n{dof}  end\n"
        )
    text.append(":hierarchy\n  begin\n")
    parents = {}
    for name, above in zip(BONES, PARENTS[1:], strict=True):
        parents[name] = JOINTS[above]
    for name, _ in skeleton.channels:
        if name not in JOINTS:
            parents[name] = _FINGERS.get(name, "root")
    for parent in JOINTS:
        children = [name for name, above in parents.items() if above == parent]
        if children:
            text.append(f"    {parent} {' '.join(children)}\n")
    text.append("  end\n")
    Path(path).write_text("".join(text), encoding="utf-8", newline="\n")


def _spaced(values: list[float]) -> str:
    return " ".join(map(repr, values))
