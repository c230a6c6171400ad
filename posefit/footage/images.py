"""Images that may be hostile: Pillow reads the size, which is checked, and decodes that many pixels and no others."""

import logging
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageOps

from posefit.errors import InputError
from posefit.footage.views import MOST
from posefit.reading import check_size

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm", ".gif", ".webp")
PAGED = (".tif", ".tiff", ".gif", ".webp")  # may hold several pictures
PIXELS = 50_000_000  # of a picture or a frame of video; 8K has 33 million
LARGEST_FILE = 8 * PIXELS  # bytes of a picture
FORMATS = "PNG, JPEG, BMP, TIFF, PGM, GIF or WebP"
_JPEG = ("JPEG", "MPO")  # the latter of phones, with a preview
_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "PPM", "GIF", "WEBP")  # as Pillow calls them
# of 255, and the share of an image's pixels: with more it is no grey one
COLOUR_RANGE = 32
COLOUR_SHARE = 0.02
# a picture of a place, or a person cut out, has more; so many labels are rare
MANY_COLOURS = 64
# as Pillow calls what has no colours
_GREY = ("1", "L", "LA", "I", "I;16", "I;16B", "F")
# what is wrong with a file is reported by posefit
logging.getLogger("PIL").addHandler(logging.NullHandler())


T = TypeVar("T")


class Marks(NamedTuple):
    """The values by which a picture marks a person, and of which kind they are."""

    # (height, width): grey levels, an alpha channel, indices of a palette, or colours
    # 0xRRGGBB
    values: NDArray[Any]
    soft: bool = False  # whether they are degrees
    alpha: bool = False  # of an alpha channel
    photo: bool = False  # a picture in many colours


def read_image(path: str | Path, grey: bool, page: int = 0) -> NDArray[np.uint8] | None:
    """Return a picture (height, width) in grey, or (height, width, 3) in blue, green and red; None where it is none.

    Raises InputError where it has more than `PIXELS` or `LARGEST_FILE`.
    """
    return next(_decoded(Path(path), [page], _grey if grey else _colours), None)


def read_marks(
    path: Path, pages: Sequence[int] = (0,), labelled: bool = False
) -> Iterator[Marks]:
    """Yield the values by which the pages of a file mark a person; nothing, or too few, where it is no picture.

    They are its alpha channel, where it has one that is not all opaque and no label is wanted; else the indices of a
    palette of colours, or colours as 0xRRGGBB, or grey levels, of 8 or 16 bits. Raises InputError as `read_image` does.
    """
    return _decoded(path, pages, partial(_marks, labelled=labelled))


def page_count(path: Path) -> int:
    """Return how many pictures a file holds; 1 where it is none."""
    if path.suffix.lower() not in PAGED:
        return 1
    return next(
        _decoded(path, [0], lambda image: int(getattr(image, "n_frames", 1))), 1
    )


@lru_cache(maxsize=64)
def is_photo(path: Path) -> bool:
    """Return whether a file is a picture in many colours, without alpha channel: of a place, not of a person's mask."""
    try:
        return any(
            _decoded(
                path,
                [0],
                lambda image: image.mode not in _GREY and _marks(image, False).photo,
            )
        )
    except InputError:  # raised again where it is read
        return False


def _decoded(
    path: Path, pages: Sequence[int], decode: Callable[[Image.Image], T]
) -> Iterator[T]:
    """Yield what `decode` makes of pages of a file; no more where there is none. Raises InputError for large ones."""
    if not path.is_file():
        return
    check_size(path, LARGEST_FILE)
    expected = f"{path}: expected at most {PIXELS // 10**6} million pixels"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path, formats=_FORMATS) as image:
                if image.format == "PNG" and getattr(image, "n_frames", 1) > 1:
                    raise InputError(f"{path}: expected one picture, got an animation")
                for page in pages:
                    if page:
                        image.seek(page)
                    if image.width * image.height > PIXELS:
                        raise InputError(
                            f"{expected}, got {image.width}x{image.height}"
                        )
                    yield decode(image)
    except Image.DecompressionBombError:
        raise InputError(f"{expected}, got far more") from None
    except InputError:
        raise
    except Exception:  # whatever the library trips over, the file is to blame
        return


def _grey(image: Image.Image) -> NDArray[np.uint8]:
    if image.format not in _JPEG:
        return np.asarray(
            cv2.cvtColor(_colours(image), cv2.COLOR_BGR2GRAY), dtype=np.uint8
        )
    image.draft("L", None)  # which a JPEG has by itself
    return np.asarray(ImageOps.exif_transpose(image).convert("L"))


def _colours(image: Image.Image) -> NDArray[np.uint8]:
    image = ImageOps.exif_transpose(image)
    if image.mode.startswith("I"):  # 16 bits
        image = Image.fromarray((np.asarray(image) // 256).astype(np.uint8))
    return np.asarray(image.convert("RGB"))[..., ::-1]


def _marks(image: Image.Image, labelled: bool) -> Marks:
    if image.format in _JPEG:
        # as which a JPEG has brightness and two distances from grey
        if image.mode == "RGB":
            image.draft("YCbCr", None)
        image = ImageOps.exif_transpose(image)
        if image.mode != "YCbCr":
            return Marks(np.asarray(image.convert("L")), soft=True)
        bright, *chroma = (np.asarray(channel) for channel in image.split())
        off = np.maximum(
            *(cv2.absdiff(channel, np.full_like(channel, 128)) for channel in chroma)
        )
        return Marks(
            bright,
            soft=True,
            # a colour is about half its range off grey
            photo=bool((off >= COLOUR_RANGE // 2).mean() > COLOUR_SHARE),
        )
    if not labelled and image.has_transparency_data:
        transparent = _transparent_marks(image)
        if transparent is not None:
            return transparent
    if image.mode in ("1", "LA"):
        image = image.convert("L")
    if image.mode in ("L", "F") or image.mode.startswith("I"):
        grey = np.asarray(image)
        return Marks(grey.astype(grey.dtype.newbyteorder("=")))
    colours = np.asarray(image.convert("RGB"))
    if (colours[..., 0] == colours[..., 1]).all() and (
        colours[..., 0] == colours[..., 2]
    ).all():
        return Marks(colours[..., 0])
    if image.format == "WEBP" and not _is_colourful(colours):
        return Marks(np.asarray(image.convert("L")), soft=True)
    if image.mode == "P" and image.format != "GIF":
        return Marks(np.asarray(image))
    numbers = _colour_numbers(colours)
    return Marks(
        numbers,
        photo=_is_colourful(colours)
        and len(np.unique(numbers[::3, ::3])) > MANY_COLOURS
        and flat_share(numbers) < MOST,
    )


def _transparent_marks(image: Image.Image) -> Marks | None:
    """Return how a picture with transparent pixels marks a person; None where it has none.

    Its alpha channel does. Where that has two values only and few colours are opaque, these are labels, and what is
    transparent is 0: of a single label the person is the same either way, and of several one is to be chosen.
    """
    coloured = np.asarray(image.convert("RGBA"))
    alpha = coloured[..., 3]
    levels = np.unique(alpha)
    if levels[0] == np.iinfo(alpha.dtype).max:
        return None
    soft = Marks(alpha, soft=True, alpha=True)
    if len(levels) > 2:
        return soft
    shown = alpha == levels[-1]
    if len(levels) == 1 or levels[0] > 0:
        return soft
    if image.mode == "P" and image.format != "GIF":
        numbers = np.asarray(image).astype(np.int32)
    else:
        numbers = _colour_numbers(coloured[..., :3])
    labels = np.unique(numbers[shown])
    # black, or the palette's first colour, alone is the person
    if len(labels) > MANY_COLOURS or not labels.any():
        return Marks(np.where(shown, alpha, 0), soft=True, alpha=True)
    return Marks(np.where(shown, numbers, 0))


def _colour_numbers(colours: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return colours (height, width, 3) as numbers 0xRRGGBB."""
    numbers = colours[..., 0].astype(np.int32)
    for channel in (1, 2):
        numbers <<= 8
        numbers |= colours[..., channel]
    return numbers


def flat_share(values: NDArray[Any]) -> float:
    """Return which share of the pixels between the lowest and the highest tenth of values has equal neighbours.

    Most of labels are flat areas, and degrees pass from one value to the next.
    """
    middle = values[1:-1, 1:-1]
    low, high = float(values.min()), float(values.max())
    between = (middle > low + 0.1 * (high - low)) & (middle < high - 0.1 * (high - low))
    if not between.any():
        return 0.0
    flat = np.ones(middle.shape, dtype=bool)
    for neighbour in (
        values[:-2, 1:-1],
        values[2:, 1:-1],
        values[1:-1, :-2],
        values[1:-1, 2:],
    ):
        flat &= middle == neighbour
    return float(np.count_nonzero(flat & between) / np.count_nonzero(between))


def _is_colourful(colours: NDArray[np.uint8]) -> bool:
    return bool((np.ptp(colours, axis=2) > COLOUR_RANGE).mean() > COLOUR_SHARE)
