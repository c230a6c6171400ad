"""Images that may be hostile: Pillow reads the size, which is checked, and decodes that many pixels and no others."""

import logging
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from posefit.errors import InputError
from posefit.reading import check_size

PIXELS = 50_000_000  # of a picture or a frame of video; 8K has 33 million
LARGEST_FILE = 400_000_000  # bytes of a picture; 8 for each pixel
FORMATS = "PNG, JPEG, BMP, TIFF or PGM"
_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "PPM")  # as Pillow calls them
COLOUR_RANGE, COLOUR_SHARE = 32, 0.02  # of 255, and the share of an image's pixels: with more it is no mask
logging.getLogger("PIL").addHandler(logging.NullHandler())  # what is wrong with a file is reported by posefit

T = TypeVar("T")


def read_image(path: str | Path, grey: bool) -> NDArray[np.uint8] | None:
    """Return a picture (height, width) in grey, or (height, width, 3) in blue, green and red; None where it is none.

    Raises InputError where it has more than `PIXELS` or `LARGEST_FILE`.
    """
    return _read(Path(path), _grey if grey else _colours)


def read_values(path: Path, labelled: bool = False) -> tuple[NDArray[Any], bool] | None:
    """Return the values (height, width) by which an image marks a person, and whether they are degrees; None for none.

    They are its alpha channel, where it has one that is not all opaque and no label is wanted; else the indices of a
    palette of colours, or colours as 0xRRGGBB, or grey levels, of 8 or 16 bits. Raises InputError as `read_image` does.
    """
    return _read(path, lambda image: _values(image, labelled))


def is_colourful(path: Path) -> bool:
    """Return whether a JPEG has colours, which no mask has; the values of other images show what they are."""
    if path.suffix.lower() not in (".jpg", ".jpeg") or (image := read_image(path, grey=False)) is None:
        return False
    return bool((np.ptp(image, axis=2) > COLOUR_RANGE).mean() > COLOUR_SHARE)


def _read(path: Path, decode: Callable[[Image.Image], T]) -> T | None:
    """Return what `decode` makes of the image in a file; None where there is none. Raises InputError for too large."""
    if not path.is_file():
        return None
    check_size(path, LARGEST_FILE)
    expected = f"{path}: expected at most {PIXELS // 10**6} million pixels"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path, formats=_FORMATS) as image:
                if image.width * image.height > PIXELS:
                    raise InputError(f"{expected}, got {image.width}x{image.height}")
                return decode(image)
    except Image.DecompressionBombError:
        raise InputError(f"{expected}, got far more") from None
    except InputError:
        raise
    except Exception:  # whatever the library trips over, the file is to blame
        return None


def _grey(image: Image.Image) -> NDArray[np.uint8]:
    if image.format != "JPEG":
        return np.asarray(cv2.cvtColor(_colours(image), cv2.COLOR_BGR2GRAY), dtype=np.uint8)
    image.draft("L", None)  # which a JPEG has by itself
    return np.asarray(ImageOps.exif_transpose(image).convert("L"))


def _colours(image: Image.Image) -> NDArray[np.uint8]:
    image = ImageOps.exif_transpose(image)
    if image.mode.startswith("I"):  # 16 bits
        image = Image.fromarray((np.asarray(image) // 256).astype(np.uint8))
    return np.asarray(image.convert("RGB"))[..., ::-1]


def _values(image: Image.Image, labelled: bool) -> tuple[NDArray[Any], bool]:
    if image.format == "JPEG":
        return _grey(image), True
    if not labelled and image.has_transparency_data:
        alpha = np.asarray(image.convert("RGBA").getchannel("A"))
        if (alpha != np.iinfo(alpha.dtype).max).any():
            return alpha, True
    if image.mode in ("1", "LA"):
        image = image.convert("L")
    if image.mode in ("L", "F") or image.mode.startswith("I"):
        grey = np.asarray(image)
        return grey.astype(grey.dtype.newbyteorder("=")), False
    colours = np.asarray(image.convert("RGB"))
    if (colours[..., 0] == colours[..., 1]).all() and (colours[..., 0] == colours[..., 2]).all():
        return colours[..., 0], False
    if image.mode == "P":
        return np.asarray(image), False
    numbers = colours[..., 0].astype(np.int32)
    for channel in (1, 2):
        numbers <<= 8
        numbers |= colours[..., channel]
    return numbers, False
