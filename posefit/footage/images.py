"""Images that may be hostile: the size is read from the first bytes, and checked, before OpenCV decodes one."""

import struct
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.reading import check_size, cut

PIXELS = 50_000_000  # of a picture or a frame of video; 8K has 33 million
LARGEST_FILE = 400_000_000  # bytes of a picture; 8 for each pixel
FORMATS = "PNG, JPEG, BMP, TIFF or PGM"
INDEXED = 3  # PNG's type of colour for a palette
COLOUR_RANGE, COLOUR_SHARE = 32, 0.02  # of 255, and the share of an image's pixels: with more it is no mask
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # of JPEG: markers before a frame's height and width
_WIDTH, _HEIGHT, _SAMPLES = 256, 257, 277  # tags of TIFF


def read_image(path: str | Path, grey: bool) -> NDArray[np.uint8] | None:
    """Return a picture (height, width) in grey, or (height, width, 3) in colours; None where the file is no picture.

    Raises InputError where it has more than `PIXELS` or `LARGEST_FILE`.
    """
    content = _content(Path(path))
    return None if content is None else _decoded(content, cv2.IMREAD_GRAYSCALE if grey else cv2.IMREAD_COLOR)


def read_values(path: Path, labelled: bool = False) -> tuple[NDArray[Any], bool] | None:
    """Return the values (height, width) by which an image marks a person, and whether they are degrees; None for none.

    They are its alpha channel, where it has one that is not all opaque and no label is wanted; else the indices of a
    palette of colours, or colours as 0xRRGGBB, or grey levels, of 8 or 16 bits. Raises InputError as `read_image` does.
    """
    content = _content(path)
    if content is None:
        return None
    if content.startswith(b"\xff\xd8"):
        image = _decoded(content, cv2.IMREAD_GRAYSCALE)
        return None if image is None else (image, True)
    image = _decoded(content, cv2.IMREAD_UNCHANGED)
    if image is None or image.ndim == 2:
        return None if image is None else (image, False)
    if image.shape[2] == 4 and not labelled and (image[..., 3] != np.iinfo(image.dtype).max).any():
        return image[..., 3], True
    if (image[..., 0] == image[..., 1]).all() and (image[..., 0] == image[..., 2]).all():
        return image[..., 0], False
    if image.dtype != np.uint8:
        image = (image // 256).astype(np.uint8)
    colours = _numbers(image, (2, 1, 0))
    indexed = content.startswith(b"\x89PNG") and content[25] == INDEXED
    return _indices(colours, content) if indexed else colours, False


def is_colourful(path: Path) -> bool:
    """Return whether a JPEG has colours, which no mask has; the values of other images show what they are."""
    if path.suffix.lower() not in (".jpg", ".jpeg") or (image := read_image(path, grey=False)) is None:
        return False
    return bool((np.ptp(image, axis=2) > COLOUR_RANGE).mean() > COLOUR_SHARE)


def _content(path: Path) -> bytes | None:
    """Return what is in the file of a picture; None where it is none. Raises InputError where that is too much."""
    if not path.is_file():
        return None
    check_size(path, LARGEST_FILE)
    content = path.read_bytes()
    size = size_of(content)
    if size is None:
        return None
    if size[0] * size[1] > PIXELS:
        came = cut(f"{size[0]}x{size[1]}")
        raise InputError(f"{path}: expected at most {PIXELS // 10**6} million pixels, got {came}")
    return content


def _decoded(content: bytes, how: int) -> NDArray[Any] | None:
    try:
        return cv2.imdecode(np.frombuffer(content, np.uint8), how)
    except cv2.error:
        return None


def _indices(colours: NDArray[np.int32], content: bytes) -> NDArray[np.uint8]:
    """Return which entry of a PNG's palette each colour is: the first, where it stands there twice."""
    place = content.find(b"PLTE")
    length = int.from_bytes(content[place - 4 : place], "big")
    palette = np.frombuffer(content, np.uint8, 3 * (length // 3), place + 4).reshape(-1, 3)
    known, first = np.unique(_numbers(palette, (0, 1, 2)), return_index=True)
    places = np.clip(np.searchsorted(known, colours), 0, len(known) - 1)
    return np.asarray(first[places], dtype=np.uint8)


def _numbers(colours: NDArray[Any], channels: tuple[int, int, int]) -> NDArray[np.int32]:
    """Return colours (..., 3) as 0xRRGGBB; `channels` are the places of red, green and blue."""
    red, green, blue = (colours[..., k].astype(np.int32) for k in channels)
    return np.asarray((red << 16) | (green << 8) | blue)


def size_of(content: bytes) -> tuple[int, int] | None:
    """Return the width and height that a picture states in its first bytes; None where it is no picture we read."""
    try:
        if content.startswith(b"\x89PNG\r\n\x1a\n") and content[12:16] == b"IHDR":
            return struct.unpack(">II", content[16:24]) if _whole_chunks(content) else None
        if content.startswith(b"\xff\xd8"):
            return _jpeg(content)
        if content.startswith(b"BM"):
            return _bmp(content)
        if content[:4] in (b"II*\0", b"MM\0*"):
            return _tiff(content)
        if content[:1] == b"P" and content[1:2] in b"123456":
            return _pnm(content)
    except (struct.error, IndexError, ValueError):
        pass
    return None


def _whole_chunks(content: bytes) -> bool:
    """Return whether a PNG file holds each chunk that it states: OpenCV allocates what one states."""
    place = 8
    while place + 8 <= len(content):
        length = int.from_bytes(content[place : place + 4], "big")
        if place + 12 + length > len(content):
            return False
        if content[place + 4 : place + 8] == b"IEND":
            return True
        place += 12 + length
    return False


def _jpeg(content: bytes) -> tuple[int, int] | None:
    """Return the largest size of the frames that a JPEG file states."""
    place, stated = 2, None
    while place + 4 <= len(content):
        if content[place] != 0xFF:
            place += 1  # as OpenCV does, search the next marker
            continue
        marker = content[place + 1]
        if marker in (0x00, 0x01, 0xFF) or 0xD0 <= marker <= 0xD8:
            place += 1 if marker == 0xFF else 2
            continue
        if marker in _FRAMES:
            tall, wide = struct.unpack(">HH", content[place + 5 : place + 9])
            if stated is None or wide * tall > stated[0] * stated[1]:
                stated = wide, tall
        if marker == 0xDA:  # what follows are pixels
            return stated
        place += 2 + int.from_bytes(content[place + 2 : place + 4], "big")
    return stated


def _bmp(content: bytes) -> tuple[int, int]:
    (header,) = struct.unpack("<I", content[14:18])
    wide, tall = struct.unpack("<HH" if header == 12 else "<ii", content[18 : 22 if header == 12 else 26])
    return abs(wide), abs(tall)


def _tiff(content: bytes) -> tuple[int, int] | None:
    """Return the size of the first picture of a TIFF file, as wide as its samples are many."""
    order = "<" if content[:2] == b"II" else ">"
    (place,) = struct.unpack(f"{order}I", content[4:8])
    (count,) = struct.unpack(f"{order}H", content[place : place + 2])
    stated: dict[int, int] = {}
    for k in range(count):
        entry = content[place + 2 + 12 * k : place + 14 + 12 * k]
        tag, kind = struct.unpack(f"{order}HH", entry[:4])
        if tag in (_WIDTH, _HEIGHT, _SAMPLES):
            short = kind == 3
            (stated[tag],) = struct.unpack(f"{order}{'H' if short else 'I'}", entry[8 : 10 if short else 12])
    if not {_WIDTH, _HEIGHT} <= stated.keys():
        return None
    return stated[_WIDTH] * max(1, -(-stated.get(_SAMPLES, 1) // 4)), stated[_HEIGHT]


def _pnm(content: bytes) -> tuple[int, int]:
    lines = (line.partition(b"#")[0] for line in content[2:4096].split(b"\n"))
    words = b" ".join(lines).split()
    return int(words[0]), int(words[1])
