"""The points of a .c3d file, of motion capture: reals or integers, Intel's byte order or DEC's."""

import struct
from pathlib import Path

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.measuring.c3d import BLOCK, INTEL, MAGIC

DEC = 85
LARGEST_FILE = 500_000_000  # bytes


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
