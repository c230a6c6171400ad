"""Acclaim motions (.amc): read into a `Motion`, and written from one."""

import re
from array import array
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
from posefit.motion.lines import lines_of, mistake, shown, values_of
from posefit.motion.motion import LONGEST, Motion
from posefit.reading import check_size

FPS = 120.0  # CMU's rate; its files do not state it
RATE = re.compile(rb"#\s*(\S{1,40}) frames a second")  # in posefit's own files
SIZE_LIMIT = 500_000_000  # bytes
LONGEST_LINE = 10_000  # bytes; a root line has about 60
VALUES = 20_000_000  # numbers of a file: 200,000 frames of 100 channels

Spans = dict[bytes, tuple[int, int]]  # bone: where its values start and stop in a frame


def read_clip(
    asf: str | Path, amc: str | Path, *, fps: float | None = None, unit: Unit | None = None, up: Up | None = None
) -> Motion:
    """Return the motion of an .amc file over the skeleton of its .asf file, in that file's length unit or in `unit`.

    `up` is the axis of the world that points up, by default y. Raises ValueError with file and line where one of them
    is not what it should be.
    """
    acclaim = parse_asf(asf, unit)
    motion = read_amc(amc, acclaim.skeleton, fps=fps, metres_per_unit=acclaim.metres)
    return replace(motion if up is None else motion.turned(np.array(TURNS[up])), notes=(*acclaim.notes, *motion.notes))


def read_amc(
    path: str | Path, skeleton: Skeleton, *, fps: float | None = None, metres_per_unit: float = CMU_UNIT
) -> Motion:
    """Return the motion of an .amc file, named after it: every frame, in radians and metres.

    The rate is `fps`, or else the one that posefit's own files state, or else CMU's, which is noted.
    `metres_per_unit` scales the root's translation; `read_clip` takes it from the .asf file. Angles of end bones and
    of bones outside the 27 joints are read and left out. All angles are unwrapped along time. Every frame must give
    all channels of `skeleton`, in any order. Raises ValueError with file and line.
    """
    path = Path(path)
    check_size(path, SIZE_LIMIT)
    spans, columns, targets = _layout(skeleton)
    values, radians, stated = _frames(path, spans, skeleton.name)
    rate = fps or stated or FPS
    assumed = f"{path}: the file does not state its rate: {FPS:g} frames a second are assumed; --rate sets it"
    notes = () if fps or stated else (assumed,)
    angles = values if radians else np.deg2rad(values)
    poses = np.zeros((len(values), ANGLES))
    poses[:, :3] = root_angles_from_rotation(rotation_from_joint_angles(angles[:, 3:6]))
    poses[:, targets] = angles[:, columns]
    return Motion(path.stem, skeleton, unwrapped(poses), values[:, :3] * metres_per_unit, rate, notes=notes)


def _layout(skeleton: Skeleton) -> tuple[Spans, NDArray[np.int64], NDArray[np.int64]]:
    """Return the spans of a frame's values, and which of its columns go to which of the 66 angles."""
    spans: Spans = {b"root": (0, 6)}
    columns: list[int] = []
    targets: list[int] = []
    start = 6
    for bone, angles in skeleton.channels:
        spans[bone.encode()] = start, start + len(angles)
        if indices := channel_angles(bone, angles):
            columns += range(start, start + len(angles))
            targets += indices
        start += len(angles)
    return spans, np.array(columns, dtype=np.int64), np.array(targets, dtype=np.int64)


def _frames(path: Path, spans: Spans, name: str) -> tuple[Array, bool, float | None]:
    """Return all frames (T, values of a frame) in file units, whether angles are radians, and the rate if stated."""
    width = max(stop for _, stop in spans.values())
    data, row = array("d"), [0.0] * width
    bones_read: set[bytes] = set()
    frame, radians, number, rate = -1, None, 0, None
    for number, raw in lines_of(path, LONGEST_LINE):
        words = raw.split()
        if not words or words[0].startswith(b"#"):
            if frame < 0 and (match := RATE.match(raw)):
                rate = _rate(path, number, match[1])
            continue
        word = words[0]
        span = spans.get(word)
        if span is not None and frame >= 0:
            if word in bones_read:
                raise mistake(path, number, f"each bone once in frame {frame}", f"{shown(word)} again")
            bones_read.add(word)
            row[span[0] : span[1]] = values_of(path, number, words, span[1] - span[0])
        elif len(words) == 1 and word.isdigit() and len(word) < 10:
            if radians is None:
                raise mistake(path, number, ":DEGREES or :RADIANS before the first frame", f"frame {int(word)}")
            if frame >= 0:
                _check_whole(path, number, spans, bones_read, frame, f"frame {int(word)}")
                data.extend(row)
                if len(data) >= min(LONGEST * width, VALUES):
                    most = min(LONGEST, VALUES // width)
                    raise mistake(path, number, f"at most {most} frames of {width} numbers", "more")
                if int(word) != frame + 1:
                    raise mistake(path, number, f"frame {frame + 1}", f"frame {int(word)}")
            frame = int(word)
            bones_read.clear()
        elif frame < 0 and word.startswith(b":"):
            keyword = word.upper()
            if keyword not in (b":FULLY-SPECIFIED", b":DEGREES", b":RADIANS"):
                raise mistake(path, number, ":FULLY-SPECIFIED, :DEGREES or :RADIANS", shown(raw))
            if keyword != b":FULLY-SPECIFIED":
                radians = keyword == b":RADIANS"
        elif frame < 0:
            raise mistake(path, number, "a header such as :DEGREES or the number of a frame", shown(raw))
        else:
            raise mistake(path, number, f"a bone of skeleton {name!r} or a frame's number", shown(raw))
    if frame < 0:
        raise mistake(path, max(number, 1), "at least one frame", "the end of the file")
    _check_whole(path, number, spans, bones_read, frame, "the end of the file")
    data.extend(row)
    return np.array(data).reshape(-1, width), bool(radians), rate


def _rate(path: Path, number: int, word: bytes) -> float:
    """Return the rate that a comment states."""
    (rate,) = values_of(path, number, [b"rate", word], 1)
    if not RATES[0] <= rate <= RATES[1]:
        raise mistake(path, number, f"a rate of {RATES[0]:g} to {RATES[1]:g} frames a second", shown(word))
    return rate


def _check_whole(path: Path, number: int, spans: Spans, bones_read: set[bytes], frame: int, came: str) -> None:
    if len(bones_read) < len(spans):
        missing = next(bone for bone in spans if bone not in bones_read)
        raise mistake(path, number, f"bone {shown(missing)} in frame {frame}", came)


def write_amc(path: str | Path, motion: Motion) -> None:
    """Write an .amc file in the CMU database's unit that reads back as the same motion, up to whole turns.

    A comment states its rate. Channels that a pose does not hold, such as fingers, are written as 0. Raises ValueError
    where the motion turns a joint about an axis that its skeleton has no channel for, as the file could not hold that.
    """
    lost = np.abs(motion.poses[:, ~motion.skeleton.free]).max(initial=0.0)
    if lost > 1e-9:
        raise InputError(f"motion must turn joints about their free axes only, got {lost:.3g} rad about another one")
    spans, columns, targets = _layout(motion.skeleton)
    values = np.zeros((len(motion), max(stop for _, stop in spans.values())))
    values[:, :3] = motion.translations / CMU_UNIT
    root = joint_angles_from_rotation(rotation_from_root_angles(motion.poses[:, :3]))
    values[:, 3:6] = np.rad2deg(steady_angles(root))
    values[:, columns] = np.rad2deg(unwrapped(motion.poses[:, targets]))
    bones = [(bone.decode(), start, stop) for bone, (start, stop) in spans.items()]
    with Path(path).open("w", encoding="utf-8", newline="\n") as file:
        file.write(f"# {motion.fps!r} frames a second\n:FULLY-SPECIFIED\n:DEGREES\n")
        for frame, row in enumerate(values.tolist(), motion.first + 1):
            file.write(f"{frame}\n")
            file.writelines(f"{bone} {' '.join(map(repr, row[start:stop]))}\n" for bone, start, stop in bones)
