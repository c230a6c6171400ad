"""Acclaim motions (.amc): read into a `Motion`, and written from one."""

import re
from array import array
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.calibration import TURNS, Up
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    root_angles_from_rotation,
    rotation_from_joint_angles,
    rotation_from_root_angles,
    steady_angles,
    unwrapped,
)
from posefit.geometry.skeleton import ANGLES, Skeleton, channel_angles
from posefit.geometry.units import CMU_UNIT, Unit
from posefit.limits import RATES
from posefit.motion.asf import FULL_TURN, parse_asf
from posefit.motion.lines import Line, lines_of
from posefit.motion.motion import LONGEST, Motion
from posefit.reading import check_size, quoted

FPS = 120.0  # CMU's rate; its files do not state it
RATE = re.compile(r"#\s*(\S{1,40}) frames a second")  # posefit writes it
SIZE_LIMIT = 500_000_000  # bytes
LONGEST_LINE = 10_000  # bytes; the root's line has about 60
MIN_DEGREES = 0.5  # if all angles of a file are smaller, it shows a rest pose
VALUES = 20_000_000  # numbers in a file: 200,000 frames of 100 channels

Spans = dict[str, tuple[int, int]]  # bone: start and stop of its values in a frame


def read_clip(
    asf: str | Path,
    amc: str | Path,
    *,
    fps: float | None = None,
    unit: Unit | None = None,
    up: Up | None = None,
) -> Motion:
    """Return the motion of an .amc file on the skeleton of its .asf file.

    Args:
        asf: Path of the skeleton.
        amc: Path of the motion.
        fps: Frames per second, by default the file's own rate, or else CMU's.
        unit: Length unit of both files, by default as stated in the .asf.
        up: Axis of the world that points up, y by default.

    Raises:
        InputError: A file is invalid; the message has its name and the line.
    """
    acclaim = parse_asf(asf, unit)
    motion = read_amc(amc, acclaim.skeleton, fps=fps, metres_per_unit=acclaim.metres)
    if up is not None:
        motion = motion.turned(np.array(TURNS[up]))
    return replace(motion, notes=(*acclaim.notes, *motion.notes))


def read_amc(
    path: str | Path,
    skeleton: Skeleton,
    *,
    fps: float | None = None,
    metres_per_unit: float = CMU_UNIT,
) -> Motion:
    """Return the motion of an .amc file, named after it: every frame.

    Every frame must give all channels of `skeleton`, in any order. Angles of end bones
    and of bones outside the 27 joints are read and left out. All angles are unwrapped
    along time.

    Args:
        path: The file.
        skeleton: The skeleton that the file's channels belong to.
        fps: Frames per second. By default the rate that posefit states in its own
            files, or else CMU's, which is noted.
        metres_per_unit: Scale of the root's translation; `read_clip` takes it from the
            .asf file.

    Raises:
        InputError: The file is invalid; the message has its name and the line.
    """
    path = Path(path)
    check_size(path, SIZE_LIMIT)
    spans, columns, targets = _layout(skeleton)
    lines = lines_of(path, LONGEST_LINE)
    radians, stated, first = _head(lines)
    values = _frames(lines, spans, first, skeleton.name)
    rate = fps or stated or FPS
    notes: tuple[str, ...] = ()
    if not (fps or stated):
        assumed = f"{FPS:g} frames a second are assumed; --rate sets it"
        notes = (f"{path}: the file does not state its rate: {assumed}",)
    # the first frame has number 1, or 0 in some programs
    if first > 1:
        from_0 = "here its frames are numbered from 0"
        notes = (*notes, f"{path}: the file's first frame is number {first}: {from_0}")
    # only joints are doubted, because a root may make many turns
    if said := doubtful_angles(values[:, 6:], radians=radians):
        notes = (*notes, f"{path}: {said}")
    angles = values if radians else np.deg2rad(values)
    poses = np.zeros((len(values), ANGLES))
    # the file turns the root about x, y, z; a pose has yaw, pitch and roll
    poses[:, :3] = root_angles_from_rotation(rotation_from_joint_angles(angles[:, 3:6]))
    poses[:, targets] = angles[:, columns]
    return Motion(
        path.stem,
        skeleton,
        unwrapped(poses),
        values[:, :3] * metres_per_unit,
        rate,
        notes=notes,
    )


def doubtful_angles(angles: Array, *, radians: bool) -> str:
    """Return a doubt about the unit of joints' angles, or "".

    Args:
        angles: The angles (T, n) as a file has them.
        radians: Whether the file says that they are radians.
    """
    largest = float(np.abs(angles).max(initial=0.0))
    if radians and largest > FULL_TURN:
        return f"angles of up to {largest:.4g} radians seem to be degrees"
    if not radians and MIN_DEGREES < largest <= FULL_TURN:
        return f"angles of at most {largest:.3g} degrees may be radians"
    return ""


def _layout(skeleton: Skeleton) -> tuple[Spans, NDArray[np.int64], NDArray[np.int64]]:
    """Return the spans of a frame's values, and which columns are which angles."""
    spans: Spans = {"root": (0, 6)}
    columns: list[int] = []
    targets: list[int] = []
    start = 6
    for bone, angles in skeleton.channels:
        spans[bone] = start, start + len(angles)
        if indices := channel_angles(bone, angles):
            columns += range(start, start + len(angles))
            targets += indices
        start += len(angles)
    return spans, np.array(columns, dtype=np.int64), np.array(targets, dtype=np.int64)


def _head(lines: Iterator[Line]) -> tuple[bool, float | None, int]:
    """Return whether angles are radians, the stated rate, and the first frame."""
    radians = rate = None
    while True:
        line = next(lines)
        if line.key.startswith("#"):
            if match := RATE.match(" ".join(line.words)):
                rate = _rate(line, match[1])
        elif line.key in (":degrees", ":radians"):
            radians = line.key == ":radians"
        elif line.key.startswith(":"):
            if line.key != ":fully-specified":
                raise line.mistake(":FULLY-SPECIFIED, :DEGREES or :RADIANS")
        elif (number := _frame_number(line)) is None:
            raise line.mistake("a header such as :DEGREES or the number of a frame")
        elif radians is None:
            raise line.mistake(
                ":DEGREES or :RADIANS before the first frame", f"frame {number}"
            )
        else:
            return radians, rate, number


def _frames(lines: Iterator[Line], spans: Spans, frame: int, name: str) -> Array:
    """Return all frames (T, values of a frame) in file units, numbered from `frame`."""
    width = max(stop for _, stop in spans.values())
    data = array("d")
    row = [0.0] * width
    bones_read = set[str]()
    for line in lines:
        bone = line.words[0] if line.words else ""
        number = _frame_number(line)
        if bone in spans:
            if bone in bones_read:
                raise line.mistake(
                    f"each bone once in frame {frame}", f"{bone!r} again"
                )
            bones_read.add(bone)
            start, stop = spans[bone]
            row[start:stop] = line.numbers(stop - start)
        elif number is not None or not line.words:  # the frame is over
            if len(bones_read) < len(spans):
                missing = [bone for bone in spans if bone not in bones_read]
                raise line.mistake(
                    f"bone {quoted(missing[0])} in frame {frame}",
                    None if number is None else f"frame {number}",
                )
            data.extend(row)
            if number is not None and number != frame + 1:
                raise line.mistake(f"frame {frame + 1}", f"frame {number}")
            # checked while reading, before a huge file fills the memory
            most = min(LONGEST * width, VALUES)
            if number is not None and len(data) >= most:
                raise line.mistake(
                    f"at most {most // width} frames of {width} numbers", "more"
                )
            frame += 1
            bones_read.clear()
        elif not bone.startswith("#"):
            raise line.mistake(f"a bone of skeleton {name!r} or a frame's number")
    return np.array(data).reshape(-1, width)


def _frame_number(line: Line) -> int | None:
    """Return the number on a line that contains only a number, or else None."""
    word = line.key
    if len(line.words) != 1 or len(word) >= 10:
        return None
    # isdigit alone also accepts digits that int() does not
    if word.isascii() and word.isdigit():
        return int(word)
    return None


def _rate(line: Line, word: str) -> float:
    """Return the rate in a comment."""
    (rate,) = line._replace(words=["rate", word]).numbers(1)
    if not RATES[0] <= rate <= RATES[1]:
        raise line.mistake(
            f"a rate of {RATES[0]:g} to {RATES[1]:g} frames a second", quoted(word)
        )
    return rate


def write_amc(path: str | Path, motion: Motion) -> None:
    """Write a motion as an .amc file in the CMU database's unit.

    The file reads back as the same motion, up to whole turns. A comment states its
    rate. Channels that a pose does not contain, such as fingers, are written as 0.

    Raises:
        InputError: The motion turns a joint about an axis for which the skeleton has no
            channel.
    """
    lost = np.abs(motion.poses[:, ~motion.skeleton.free]).max(initial=0.0)
    if lost > 1e-9:
        raise InputError(
            "motion must turn joints about their free axes only, "
            f"got {lost:.3g} rad about another one"
        )
    spans, columns, targets = _layout(motion.skeleton)
    values = np.zeros((len(motion), max(stop for _, stop in spans.values())))
    values[:, :3] = motion.translations / CMU_UNIT
    root = joint_angles_from_rotation(rotation_from_root_angles(motion.poses[:, :3]))
    values[:, 3:6] = np.rad2deg(steady_angles(root))
    values[:, columns] = np.rad2deg(unwrapped(motion.poses[:, targets]))
    with Path(path).open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {motion.fps!r} frames a second\n:FULLY-SPECIFIED\n:DEGREES\n")
        for frame, row in enumerate(values.tolist(), motion.first + 1):
            file.write(f"{frame}\n")
            for bone, (start, stop) in spans.items():
                file.write(f"{bone} {' '.join(map(repr, row[start:stop]))}\n")
