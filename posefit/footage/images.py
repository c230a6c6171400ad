"""Read images, which may be hostile: their size is checked before they are decoded."""

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
PAGED = (".tif", ".tiff", ".gif", ".webp")  # may contain several pictures
# most pixels of a picture or a frame of video; 8K has 33 million
PIXELS = 50_000_000
# most bytes of a picture: as many as 16 bits for each of four channels
LARGEST_FILE = 8 * PIXELS
FORMATS = "PNG, JPEG, BMP, TIFF, PGM, GIF or WebP"  # as messages call them
_FORMATS = ("PNG", "JPEG", "BMP", "TIFF", "PPM", "GIF", "WEBP")  # Pillow's names
ORIENTATION = 0x0112  # the tag of EXIF that says how a picture is turned
_JPEG = ("JPEG", "MPO")  # phones write MPO, a JPEG with a preview
# levels of 255 between the channels of a pixel that is not grey
COLOUR_RANGE = 32
# share of an image's pixels: with more of them in colour, the image is in colour. Lossy
# compression tints a few pixels of grey images
COLOUR_SHARE = 0.02
# photographs have more colours than this, and maps of labels hardly ever do
MANY_COLOURS = 64
_GREY = ("1", "L", "LA", "I", "I;16", "I;16B", "F")  # Pillow's modes without colour
# posefit reports itself what is wrong with a file
logging.getLogger("PIL").addHandler(logging.NullHandler())


T = TypeVar("T")


class Marks(NamedTuple):
    """The values by which an image marks a person, and what kind of values they are."""

    # (height, width): grey levels, an alpha channel, palette indices, or colours
    # 0xRRGGBB
    values: NDArray[Any]
    soft: bool = False  # whether they say how much of a pixel is the person
    alpha: bool = False  # whether they are an alpha channel
    photo: bool = False  # whether the image is a photograph, and so not a mask


def read_image(path: str | Path, grey: bool, page: int = 0) -> NDArray[np.uint8] | None:
    """Return a picture, or None if the file is not a picture.

    Args:
        path: The file.
        grey: Whether to return grey levels (height, width); otherwise (height, width,
            3) in blue, green and red.
        page: Which picture of a file with several.

    Raises:
        InputError: The picture has more than `PIXELS`, or the file is larger than
            `LARGEST_FILE`.
    """
    return next(_decoded(Path(path), [page], _grey if grey else _colours), None)


def read_marks(
    path: Path, pages: Sequence[int] = (0,), labelled: bool = False
) -> Iterator[Marks]:
    """Yield the values by which each page of a file marks a person.

    An alpha channel comes first, if some pixels are not opaque. Then come the indices
    of a colour palette, colours as 0xRRGGBB, and grey levels of 8 or 16 bits. If the
    file is damaged or not a picture, fewer pages are yielded.

    Args:
        path: The file.
        pages: Which pages to read.
        labelled: Whether the user named a label; the alpha channel is then ignored.

    Raises:
        InputError: As `read_image`.
    """
    return _decoded(path, pages, partial(_marks, labelled=labelled))


def page_count(path: Path) -> int:
    """Return how many pictures a file contains; 1 if it is not a picture."""
    if path.suffix.lower() not in PAGED:
        return 1
    return next(_decoded(path, [0], _frame_count), 1)


def _frame_count(image: Image.Image) -> int:
    return int(getattr(image, "n_frames", 1))


@lru_cache(maxsize=64)
def is_photo(path: Path) -> bool:
    """Return whether a file is a photograph: in many colours, without transparency."""

    def photo(image: Image.Image) -> bool:
        return image.mode not in _GREY and _marks(image, False).photo

    try:
        return any(_decoded(path, [0], photo))
    except InputError:  # raised again when the file is read
        return False


def _decoded(
    path: Path, pages: Sequence[int], decode: Callable[[Image.Image], T]
) -> Iterator[T]:
    """Yield what `decode` returns for pages of a file.

    Ends early if the file is missing, damaged or not a picture. Raises InputError for a
    file that is too large.
    """
    if not path.is_file():
        return
    check_size(path, LARGEST_FILE)
    expected = f"{path}: expected at most {PIXELS // 10**6} million pixels"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            with Image.open(path, formats=_FORMATS) as image:
                if image.format == "PNG" and getattr(image, "n_frames", 1) > 1:
                    raise InputError(
                        f"{path}: expected one picture, got an animation: save a "
                        "picture a frame, or a GIF or WebP"
                    )
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
    except Exception:  # Pillow raises many types for damaged files
        return


def _grey(image: Image.Image) -> NDArray[np.uint8]:
    if image.format not in _JPEG:
        grey = cv2.cvtColor(_colours(image), cv2.COLOR_BGR2GRAY)
        return np.asarray(grey, dtype=np.uint8)
    # a JPEG stores brightness by itself, so its colours need no decoding
    image.draft("L", None)
    return np.asarray(ImageOps.exif_transpose(image).convert("L"))


def _colours(image: Image.Image) -> NDArray[np.uint8]:
    """Return an image (height, width, 3) in blue, green and red."""
    image = ImageOps.exif_transpose(image)
    if image.mode.startswith("I"):  # 16 bits
        image = Image.fromarray((np.asarray(image) // 256).astype(np.uint8))
    return np.asarray(image.convert("RGB"))[..., ::-1]


def _jpeg_marks(image: Image.Image) -> Marks:
    """Return how a JPEG marks a person: by its brightness."""
    # a JPEG stores brightness and two colour differences, so nothing is converted
    if image.mode == "RGB":
        image.draft("YCbCr", None)
    image = ImageOps.exif_transpose(image)
    if image.mode != "YCbCr":
        return Marks(np.asarray(image.convert("L")), soft=True)
    bright, blue, red = (np.asarray(channel) for channel in image.split())
    grey = np.full_like(blue, 128)
    off = np.maximum(cv2.absdiff(blue, grey), cv2.absdiff(red, grey))
    # a colour whose channels differ by some range is about half of it away from grey
    share = (off >= COLOUR_RANGE // 2).mean()
    return Marks(bright, soft=True, photo=bool(share > COLOUR_SHARE))


def _marks(image: Image.Image, labelled: bool) -> Marks:
    """Return how an image marks a person, see `read_marks`."""
    if image.format in _JPEG:
        return _jpeg_marks(image)
    if image.getexif().get(ORIENTATION, 1) != 1:
        upright = ImageOps.exif_transpose(image)
        upright.format = image.format
        image = upright
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
    red, green, blue = (colours[..., channel] for channel in range(3))
    if (red == green).all() and (red == blue).all():
        # a palette may give several labels one grey
        if _is_palette(image):
            labels = np.asarray(image)
            if len(np.unique(labels)) > len(np.unique(red)):
                return Marks(labels)
        return Marks(red)
    # lossy compression tints grey images a little
    if image.format == "WEBP" and not _is_colourful(colours):
        return Marks(np.asarray(image.convert("L")), soft=True)
    if _is_palette(image):
        return Marks(np.asarray(image))
    numbers = _colour_numbers(colours)
    photo = (
        _is_colourful(colours)
        # every third row and column is enough to find many colours
        and len(np.unique(numbers[::3, ::3])) > MANY_COLOURS
        and flat_share(numbers) < MOST
    )
    return Marks(numbers, photo=photo)


def _transparent_marks(image: Image.Image) -> Marks | None:
    """Return how transparent pixels mark a person; None if all pixels are opaque.

    The alpha channel marks the person, with two exceptions. If it has only two values,
    or the file has a palette, and the opaque pixels have few colours, then the colours
    are labels and transparent pixels are 0. For a single label the mask is the same
    either way. If its values cover flat areas, they are labels themselves.
    """
    coloured = np.asarray(image.convert("RGBA"))
    alpha = coloured[..., 3]
    levels = np.unique(alpha)
    if levels[0] == np.iinfo(alpha.dtype).max:
        return None
    soft = Marks(alpha, soft=True, alpha=True)
    has_palette = _is_palette(image)
    if len(levels) > 2:
        marks = np.asarray(image) if has_palette else alpha
        if flat_share(marks) < MOST or len(levels) > MANY_COLOURS:
            return soft
        if not has_palette:
            return Marks(alpha, alpha=True)
    shown = alpha > 0
    if len(levels) == 1 or levels[0] > 0:
        return soft
    if has_palette:
        numbers = np.asarray(image).astype(np.int32)
    else:
        numbers = _colour_numbers(coloured[..., :3])
    labels = np.unique(numbers[shown])
    # if only black or the palette's first colour is opaque, labels would be all 0
    if len(labels) > MANY_COLOURS or not labels.any():
        return Marks(np.where(shown, alpha, 0), soft=True, alpha=True)
    return Marks(np.where(shown, numbers, 0))


def _is_palette(image: Image.Image) -> bool:
    """Return whether an image's indices may be labels; a GIF's are arbitrary."""
    return image.mode == "P" and image.format != "GIF"


def _colour_numbers(colours: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return colours (height, width, 3) as numbers 0xRRGGBB."""
    numbers = colours[..., 0].astype(np.int32)
    for channel in (1, 2):
        numbers <<= 8
        numbers |= colours[..., channel]
    return numbers


def flat_share(values: NDArray[Any]) -> float:
    """Return the share of pixels that equal their four neighbours, among middle values.

    Middle values are neither in the lowest nor in the highest tenth of the range.
    Labels cover flat areas; soft masks change from pixel to pixel.
    """
    middle = values[1:-1, 1:-1]
    low = float(values.min())
    high = float(values.max())
    tenth = 0.1 * (high - low)
    between = (middle > low + tenth) & (middle < high - tenth)
    if not between.any():
        return 0.0
    above = values[:-2, 1:-1]
    below = values[2:, 1:-1]
    left = values[1:-1, :-2]
    right = values[1:-1, 2:]
    flat = np.ones(middle.shape, dtype=bool)
    for neighbour in (above, below, left, right):
        flat &= middle == neighbour
    return float(np.count_nonzero(flat & between) / np.count_nonzero(between))


def _is_colourful(colours: NDArray[np.uint8]) -> bool:
    return bool((np.ptp(colours, axis=2) > COLOUR_RANGE).mean() > COLOUR_SHARE)
