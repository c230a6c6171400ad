"""Writes video whose frames come when they like: a Matroska file of JPEG pictures, each with its own time stamp."""

import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2


def _element(identity: int, content: bytes) -> bytes:
    head = identity.to_bytes((identity.bit_length() + 7) // 8, "big")
    return head + (len(content) | 1 << 56).to_bytes(8, "big") + content


def _number(identity: int, value: int) -> bytes:
    return _element(
        identity, value.to_bytes(max(1, (value.bit_length() + 7) // 8), "big")
    )


def write_matroska(
    path: Path,
    images: Sequence[Any],
    milliseconds: Sequence[int],
    wide: int = 0,
    stated: int = 0,
    lasts: float = 0.0,
) -> Path:
    """Return the file, in which image k is shown from `milliseconds[k]` on, and stretched to be so many pixels wide.

    Its head has the duration of a frame at `stated` frames a second, and how many milliseconds the film lasts, where
    these are given.
    """
    height, width = images[0].shape[:2]
    head = _element(0x4282, b"matroska") + _number(0x4287, 4) + _number(0x4285, 2)
    info = (
        _number(0x2AD7B1, 1_000_000)
        + _element(0x4D80, b"tests")
        + _element(0x5741, b"tests")
    )
    info += _element(0x4489, struct.pack(">d", lasts)) if lasts else b""
    picture = _number(0xB0, width) + _number(0xBA, height)
    picture += _number(0x54B0, wide) + _number(0x54BA, height) if wide else b""
    track = _number(0xD7, 1) + _number(0x73C5, 1) + _number(0x83, 1)
    track += _number(0x23E383, round(1e9 / stated)) if stated else b""
    track += _element(0x86, b"V_MJPEG") + _element(0xE0, picture)
    clusters = b""
    for image, time in zip(images, milliseconds, strict=True):
        jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 95])[1].tobytes()
        clusters += _element(
            0x1F43B675, _number(0xE7, time) + _element(0xA3, b"\x81\x00\x00\x80" + jpeg)
        )
    body = (
        _element(0x1549A966, info)
        + _element(0x1654AE6B, _element(0xAE, track))
        + clusters
    )
    path.write_bytes(_element(0x1A45DFA3, head) + _element(0x18538067, body))
    return path
