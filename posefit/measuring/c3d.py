"""Joint positions and the events of gait as a .c3d file, for motion analysis programs.

The format follows the C3D file format user guide (2008): a header, parameters and 3D
points in blocks of 512 bytes, here as little-endian real numbers, in millimetres. An
unobserved point has the residual -1.
"""

import struct
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from posefit.measuring.centres import PLACES
from posefit.measuring.gait import Gait
from posefit.motion.motion import Motion
from posefit.version import __version__

BLOCK = 512  # bytes
MAGIC = 0x50
INTEL = 84
MAX_FRAMES = 0xFFFF  # frames that the header can count; TRIAL has the full number
MAX_EVENTS = 255  # events that a parameter can hold
MILLIMETRES = 1e3  # in a metre
_ICONS = {"Foot Strike": 1, "Foot Off": 2}


def write_c3d(
    path: str | Path,
    motion: Motion,
    unseen: Collection[int] = (),
    gait: Gait | None = None,
) -> None:
    """Write the 27 joints of every frame as points, y up, under the names of `PLACES`.

    Args:
        path: The file.
        motion: The motion.
        unseen: Numbers of frames in which all points are unobserved.
        gait: Its strikes and toe-offs become the file's events, the first 255 of them.
    """
    joints = motion.joints * MILLIMETRES
    residuals = np.zeros((*joints.shape[:2], 1))
    points = np.concatenate([joints, residuals], axis=2).astype("<f4")  # (T, 27, 4)
    points[[number - motion.first for number in unseen]] = (0.0, 0.0, 0.0, -1.0)
    parameters = b""
    start = 0
    # repeated, because the parameters state the block after them, and so their own size
    while start != 2 + len(parameters) // BLOCK:
        start = 2 + len(parameters) // BLOCK
        parameters = _section(_parameters(motion, start, gait))
    first = min(motion.first + 1, MAX_FRAMES)
    last = min(motion.first + len(motion), MAX_FRAMES)
    # the parameters' first block and the key; points and analog values of a frame;
    # first and last frame; the longest gap to fill; the scale, negative for real
    # numbers; the first block of the points; analog samples of a frame; the rate
    header = struct.pack(
        "<BBHHHHHfHHf",
        2,
        MAGIC,
        len(PLACES),
        0,
        first,
        last,
        0,
        -1.0,
        start,
        1,
        motion.fps,
    )
    data = points.tobytes()
    padding = bytes(-len(data) % BLOCK)
    Path(path).write_bytes(header.ljust(BLOCK, b"\0") + parameters + data + padding)


def _parameters(
    motion: Motion, start: int, gait: Gait | None
) -> dict[str, dict[str, Any]]:
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
            "ACTUAL_START_FIELD": _in_words(motion.first + 1),
            "ACTUAL_END_FIELD": _in_words(motion.first + frames),
            "CAMERA_RATE": motion.fps,
        },
        "MANUFACTURER": {"SOFTWARE": "posefit", "VERSION": __version__},
    }
    events = []
    if gait and not gait.why:
        events = sorted(_events(gait))[:MAX_EVENTS]
    if events:
        groups["EVENT"] = {
            "USED": len(events),
            "CONTEXTS": [foot.title() for _, foot, _ in events],
            "LABELS": [label for _, _, label in events],
            "TIMES": np.array([divmod(seconds, 60.0) for seconds, _, _ in events]),
            "ICON_IDS": [_ICONS[label] for _, _, label in events],
        }
    return groups


def _in_words(number: int) -> list[int]:
    """Return a number of 32 bits as two numbers of 16, the lower half first."""
    upper, lower = divmod(number, 1 << 16)
    return [lower, upper]


def _events(gait: Gait) -> Iterator[tuple[float, str, str]]:
    for step in gait.steps:
        yield step.strike_seconds, step.foot, "Foot Strike"
        if step.toe_off_seconds is not None:
            yield step.toe_off_seconds, step.foot, "Foot Off"


def _section(groups: dict[str, dict[str, Any]]) -> bytes:
    """Return the parameter section, in whole blocks, for groups of parameters."""
    records = b""
    for number, (group, parameters) in enumerate(groups.items(), 1):
        records += struct.pack("<bb", len(group), -number)
        records += group.encode()
        records += struct.pack("<hB", 3, 0)
        for name, value in parameters.items():
            body = _encoded(value) + b"\0"  # no description
            records += struct.pack("<bb", len(name), number)
            records += name.encode()
            records += struct.pack("<h", 2 + len(body))
            records += body
    blocks = -(-(4 + len(records)) // BLOCK)
    section = struct.pack("<BBBB", 1, MAGIC, blocks, INTEL) + records
    return section.ljust(blocks * BLOCK, b"\0")


def _encoded(value: Any) -> bytes:
    """Return a parameter's type, its dimensions, the fastest first, and its content."""
    array = np.asarray(value)
    if array.dtype.kind == "U":
        words = array.astype("S").reshape(-1)
        sizes = bytes((words.itemsize, *array.shape))
        content = b"".join(word.ljust(words.itemsize) for word in words)
        return struct.pack("<bB", -1, len(sizes)) + sizes + content
    kind, stored = (2, "<u2") if array.dtype.kind == "i" else (4, "<f4")
    sizes = bytes(array.shape[::-1])
    return struct.pack("<bB", kind, array.ndim) + sizes + array.astype(stored).tobytes()
