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
from posefit.motion.asf import parse_asf
from posefit.motion.lines import Line, lines_of
from posefit.motion.motion import LONGEST, Motion
from posefit.reading import check_size, quoted

FPS = 120.0  # CMU's rate; its files do not state it
RATE = re.compile(r"#\s*(\S{1,40}) frames a second")  # in posefit's own files
SIZE_LIMIT = 500_000_000  # bytes
LONGEST_LINE = 10_000  # bytes; a root line has about 60
VALUES = 20_000_000  # numbers of a file: 200,000 frames of 100 channels

Spans = dict[str, tuple[int, int]]  # bone: where its values start and stop in a frame


def read_clip(
    asf: str | Path,
    amc: str | Path,
    *,
    fps: float | None = None,
    unit: Unit | None = None,
    up: Up | None = None,
) -> Motion:
    """Return the motion of an .amc file over the skeleton of its .asf file, in that file's length unit or in `unit`.

    `up` is the axis of the world that points up, by default y. Raises InputError with file and line where one of them
    is not what it should be.
    """
    acclaim = parse_asf(asf, unit)
    motion = read_amc(amc, acclaim.skeleton, fps=fps, metres_per_unit=acclaim.metres)
    return replace(
        motion if up is None else motion.turned(np.array(TURNS[up])),
        notes=(*acclaim.notes, *motion.notes),
    )


def read_amc(
    path: str | Path,
    skeleton: Skeleton,
    *,
    fps: float | None = None,
    metres_per_unit: float = CMU_UNIT,
) -> Motion:
    """Return the motion of an .amc file, named after it: every frame, in radians and metres.

    The rate is `fps`, or else the one that posefit's own files state, or else CMU's, which is noted.
    `metres_per_unit` scales the root's translation; `read_clip` takes it from the .asf file. Angles of end bones and
    of bones outside the 27 joints are read and left out. All angles are unwrapped along time. Every frame must give
    all channels of `skeleton`, in any order. Raises InputError with file and line.
    """
    path = Path(path)
    check_size(path, SIZE_LIMIT)
    spans, columns, targets = _layout(skeleton)
    lines = lines_of(path, LONGEST_LINE)
    radians, stated, first = _head(lines)
    values = _frames(lines, spans, first, skeleton.name)
    rate = fps or stated or FPS
    assumed = f"{path}: the file does not state its rate: {FPS:g} frames a second are assumed; --rate sets it"
    notes = () if fps or stated else (assumed,)
    angles = values if radians else np.deg2rad(values)
    poses = np.zeros((len(values), ANGLES))
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


def _layout(skeleton: Skeleton) -> tuple[Spans, NDArray[np.int64], NDArray[np.int64]]:
    """Return the spans of a frame's values, and which of its columns go to which of the 66 angles."""
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
    """Return whether angles are radians, the rate if it is stated, and the number of the first frame."""
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
    """Return all frames (T, values of a frame) in file units, from that of a number on."""
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
                missing = quoted(next(bone for bone in spans if bone not in bones_read))
                raise line.mistake(
                    f"bone {missing} in frame {frame}",
                    None if number is None else f"frame {number}",
                )
            data.extend(row)
            if number is not None and number != frame + 1:
                raise line.mistake(f"frame {frame + 1}", f"frame {number}")
            if number is not None and len(data) >= min(LONGEST * width, VALUES):
                raise line.mistake(
                    f"at most {min(LONGEST, VALUES // width)} frames of {width} numbers",
                    "more",
                )
            frame += 1
            bones_read.clear()
        elif not bone.startswith("#"):
            raise line.mistake(f"a bone of skeleton {name!r} or a frame's number")
    return np.array(data).reshape(-1, width)


def _frame_number(line: Line) -> int | None:
    """Return the number of a line that is one alone."""
    alone = (
        len(line.words) == 1
        and line.key.isascii()
        and line.key.isdigit()
        and len(line.key) < 10
    )
    return int(line.key) if alone else None


def _rate(line: Line, word: str) -> float:
    """Return the rate that a comment states."""
    (rate,) = line._replace(words=["rate", word]).numbers(1)
    if not RATES[0] <= rate <= RATES[1]:
        raise line.mistake(
            f"a rate of {RATES[0]:g} to {RATES[1]:g} frames a second", quoted(word)
        )
    return rate


def write_amc(path: str | Path, motion: Motion) -> None:
    """Write an .amc file in the CMU database's unit that reads back as the same motion, up to whole turns.

    A comment states its rate. Channels that a pose does not hold, such as fingers, are written as 0. Raises InputError
    where the motion turns a joint about an axis that its skeleton has no channel for, as the file could not hold that.
    """
    lost = np.abs(motion.poses[:, ~motion.skeleton.free]).max(initial=0.0)
    if lost > 1e-9:
        raise InputError(
            f"motion must turn joints about their free axes only, got {lost:.3g} rad about another one"
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
