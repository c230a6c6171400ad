"""Images that may be hostile: Pillow reads the size, which is checked, before OpenCV decodes one."""

import io
import logging
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from posefit.errors import InputError
from posefit.reading import check_size

PIXELS = 50_000_000  # of a picture or a frame of video; 8K has 33 million
LARGEST_FILE = 400_000_000  # bytes of a picture; 8 for each pixel
FORMATS = "PNG, JPEG, BMP, TIFF or PGM"
INDEXED = 3  # PNG's type of colour for a palette
COLOUR_RANGE, COLOUR_SHARE = 32, 0.02  # of 255, and the share of an image's pixels: with more it is no mask
logging.getLogger("PIL").addHandler(logging.NullHandler())  # what is wrong with a file is reported by posefit


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
    expected = f"{path}: expected at most {PIXELS // 10**6} million pixels"
    try:
        size = size_of(content)
    except Image.DecompressionBombError:
        raise InputError(f"{expected}, got far more") from None
    if size is not None and size[0] * size[1] > PIXELS:
        raise InputError(f"{expected}, got {size[0]}x{size[1]}")
    return None if size is None else content


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
    """Return the width and height that a picture states; None where it is no picture we read.

    A PNG is checked to hold each chunk that it states: OpenCV allocates what one states.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(content), formats=("PNG", "JPEG", "BMP", "TIFF", "PPM")) as image:
                size = image.size
                if image.format == "PNG":
                    image.verify()
        return size
    except Image.DecompressionBombError:
        raise
    except Exception:  # whatever the library trips over, the file is to blame
        return None
