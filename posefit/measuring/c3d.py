"""Joint positions and the events of gait as a .c3d file, which programs of motion analysis open; and its points read.

The format is that of the C3D file format user guide (2008): a header, parameters and 3D points in blocks of 512 bytes,
here as little-endian real numbers, in millimetres. An unobserved point has the residual -1.
"""

import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait
from posefit.motion.motion import Motion
from posefit.version import __version__

BLOCK = 512  # bytes
MAGIC, INTEL, DEC = 0x50, 84, 85
LARGEST_FILE = 500_000_000  # bytes
MAX_FRAMES = 0xFFFF  # frames that the header can count; more are in TRIAL
MAX_EVENTS = 255  # that a parameter can hold
MILLIMETRES = 1e3  # in a metre
_ICONS = {"Foot Strike": 1, "Foot Off": 2}


def write_c3d(path: str | Path, motion: Motion, blank: Collection[int] = (), gait: Gait | None = None) -> None:
    """Write the 27 joints of every frame as points named by `PLACES`, y up; of `blank` frames none.

    Strikes and toe-offs of `gait` are the file's events, the first 255 of them.
    """
    joints = motion.joints * MILLIMETRES
    points = np.concatenate([joints, np.zeros((*joints.shape[:2], 1))], axis=2).astype("<f4")
    points[sorted(blank)] = (0.0, 0.0, 0.0, -1.0)
    parameters, start = b"", 0
    while start != 2 + len(parameters) // BLOCK:  # where the points start is a parameter itself
        start = 2 + len(parameters) // BLOCK
        parameters = _section(_parameters(motion, start, gait))
    last = min(len(motion), MAX_FRAMES)
    header = struct.pack("<BBHHHHHfHHf", 2, MAGIC, len(PLACES), 0, 1, last, 0, -1.0, start, 1, motion.fps)
    data = points.tobytes()
    Path(path).write_bytes(header.ljust(BLOCK, b"\0") + parameters + data + bytes(-len(data) % BLOCK))


def _parameters(motion: Motion, start: int, gait: Gait | None) -> dict[str, dict[str, Any]]:
    """Return the parameters by group and name."""
    frames = len(motion)
    groups: dict[str, dict[str, Any]] = {
        "POINT": {
            "USED": len(PLACES),
            "FRAMES": min(frames, MAX_FRAMES),
            "DATA_START": start,
            "SCALE": -1.0,
            "RATE": motion.fps,
            "UNITS": "mm",
            "X_SCREEN": "+X",
            "Y_SCREEN": "+Y",
            "LABELS": PLACES,
            "DESCRIPTIONS": PLACES,
        },
        "ANALOG": {"USED": 0, "GEN_SCALE": 1.0, "RATE": motion.fps},
        "FORCE_PLATFORM": {"USED": 0},
        "TRIAL": {
            "ACTUAL_START_FIELD": [1, 0],
            "ACTUAL_END_FIELD": [frames & MAX_FRAMES, frames >> 16],
            "CAMERA_RATE": motion.fps,
        },
        "MANUFACTURER": {"SOFTWARE": "posefit", "VERSION": __version__},
    }
    if events := sorted(_events(gait))[:MAX_EVENTS] if gait and not gait.why else []:
        groups["EVENT"] = {
            "USED": len(events),
            "CONTEXTS": [foot.title() for _, foot, _ in events],
            "LABELS": [label for _, _, label in events],
            "TIMES": np.array([divmod(seconds, 60.0) for seconds, _, _ in events]),
            "ICON_IDS": [_ICONS[label] for _, _, label in events],
        }
    return groups


def _events(gait: Gait) -> Iterator[tuple[float, str, str]]:
    """Yield time, foot and name of each event."""
    for step in gait.steps:
        yield step.strike_seconds, step.foot, "Foot Strike"
        if step.toe_off_seconds is not None:
            yield step.toe_off_seconds, step.foot, "Foot Off"


def _section(groups: dict[str, dict[str, Any]]) -> bytes:
    """Return the parameters as whole blocks."""
    records = b""
    for number, (group, parameters) in enumerate(groups.items(), 1):
        records += struct.pack("<bb", len(group), -number) + group.encode() + struct.pack("<hB", 3, 0)
        for name, value in parameters.items():
            body = _encoded(value) + b"\0"  # no description
            records += struct.pack("<bb", len(name), number) + name.encode() + struct.pack("<h", 2 + len(body)) + body
    size = -(-(4 + len(records)) // BLOCK)
    return (struct.pack("<BBBB", 1, MAGIC, size, INTEL) + records).ljust(size * BLOCK, b"\0")


def _encoded(value: Any) -> bytes:
    """Return a parameter's type, its sizes, the one that runs fastest first, and its content."""
    array = np.asarray(value)
    if array.dtype.kind == "U":
        words = array.astype("S").reshape(-1)
        sizes = bytes((words.itemsize, *array.shape))
        return struct.pack("<bB", -1, len(sizes)) + sizes + b"".join(word.ljust(words.itemsize) for word in words)
    kind, stored = (2, "<u2") if array.dtype.kind == "i" else (4, "<f4")
    return struct.pack("<bB", kind, array.ndim) + bytes(array.shape[::-1]) + array.astype(stored).tobytes()


def read_c3d(path: str | Path) -> dict[str, Array]:
    """Return the points of a .c3d file by their labels, each (T, 3) in the file's unit; NaN where unobserved.

    A subject's name before a colon is not part of a label. Reads files of Intel's and DEC's byte order. Raises
    InputError where it is none of them.
    """
    path = Path(path)
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise ValueError(f"{path.stat().st_size:,} bytes")
        return _points(path.read_bytes())
    except (OSError, ValueError, IndexError, struct.error) as error:
        most = f"a .c3d file of at most {LARGEST_FILE // 10**6} MB"
        raise InputError(f"{path}: expected {most}, got {error or type(error).__name__}") from None


def _points(content: bytes) -> dict[str, Array]:
    first_parameters, magic, points, analog, first, last, _ = struct.unpack_from("<BBHHHHH", content)
    start = BLOCK * (first_parameters - 1)
    processor = content[start + 3]
    if magic != MAGIC or processor not in (INTEL, DEC):
        raise ValueError("one without its mark, or of another byte order")
    scale = float(_reals(content[12:16], processor)[0])
    rows, width = last - first + 1, 4 * points + analog
    offset = BLOCK * (struct.unpack_from("<H", content, 16)[0] - 1)
    size = rows * width * (4 if scale < 0.0 else 2)
    if rows < 1 or not points or len(content) < offset + size:
        raise ValueError(f"one that ends before its {rows} frames of {points} points")
    data = content[offset : offset + size]
    values = _reals(data, processor) if scale < 0.0 else np.frombuffer(data, "<i2").astype(np.float64)
    values = values.reshape(rows, width)[:, : 4 * points].reshape(rows, points, 4)
    places = np.where(values[..., 3:] < 0.0, np.nan, values[..., :3] * (scale if scale > 0.0 else 1.0))
    return {label.split(":")[-1]: places[:, k] for k, label in enumerate(_labels(content, start)[:points])}


def _reals(data: bytes, processor: int) -> Array:
    """Return 32-bit reals; DEC's have their two words in the other order, and an exponent two larger."""
    if processor == INTEL:
        return np.frombuffer(data, "<f4").astype(np.float64)
    return np.frombuffer(data, "<u2").reshape(-1, 2)[:, ::-1].copy().view("<f4")[:, 0].astype(np.float64) / 4.0


def _labels(content: bytes, start: int) -> list[str]:
    """Return the words of POINT:LABELS."""
    at, end = start + 4, start + BLOCK * content[start + 2]
    groups: dict[int, str] = {}
    words: dict[int, list[str]] = {}
    while at < end and content[at]:
        length, number = struct.unpack_from("<bb", content, at)
        name = content[at + 2 : at + 2 + abs(length)].decode("ascii", "replace")
        at += 2 + abs(length)
        ahead = struct.unpack_from("<H", content, at)[0]
        if number < 0:
            groups[-number] = name.upper()
        elif name.upper() == "LABELS" and content[at + 3] == 2:
            wide, count = content[at + 4], content[at + 5]
            text = content[at + 6 : at + 6 + wide * count].decode("ascii", "replace")
            words[number] = [text[k * wide : (k + 1) * wide].strip() for k in range(count)]
        if not ahead:
            break
        at += ahead
    for number, group in groups.items():
        if group == "POINT" and number in words:
            return words[number]
    raise ValueError("one whose points have no labels")
