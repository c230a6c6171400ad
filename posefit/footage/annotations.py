"""Read masks from annotations in COCO's format (.json), of CVAT, Roboflow or SAM.

A person may have polygons, or runs of pixels, compressed or not. Polygons are filled as
pycocotools fills them: their corners are rounded to a fifth of a pixel, and a pixel
belongs to the person if the middle of its column enters the polygon above its middle.

| step | where |
|---|---|
| file to annotations by image | `_Annotations` |
| names of images to frames | `numbering.numbered` |
| polygons and runs to pixels | `filled`, `unrun` |
"""

import json
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.images import PIXELS
from posefit.footage.numbering import natural, numbered
from posefit.footage.views import (
    Range,
    View,
    check_some,
    empty_planes,
    full_planes,
    known_planes,
    release,
    span,
    times_of,
)
from posefit.limits import check_decoded
from posefit.reading import check_size, cut, existing, quoted
from posefit.silhouette.mask import Mask

ANNOTATIONS = ".json"
MAX_FILE_BYTES = 500_000_000  # bytes
DEFAULT_CATEGORY = "person"  # the category that is taken by default
SUBPIXELS = 5  # parts of a pixel to which corners of polygons are rounded
MAX_OUTSIDE = 4  # times width and height: how far outside corners may be
Runs = NDArray[np.int64]  # lengths of runs, of background and person in turn


def read_annotations(
    path: Path, frames: Range, category: int | str | None, fps: float | None
) -> View:
    """Return the view of the people of one category.

    Everybody in a frame is in its mask; a later step takes them apart. Frames without
    annotations are empty.

    Args:
        path: The file.
        frames: Which frames to read.
        category: The people's category; by default `DEFAULT_CATEGORY`, or the only one.
        fps: Frames per second.

    Raises:
        InputError: The file is not of this format, or has no such category.
    """
    check_size(existing(path), MAX_FILE_BYTES)
    if isinstance(category, int):
        raise InputError(
            f"label must be left out for annotations, got {category} for {path}: "
            "--category chooses among them"
        )
    content = _Content(path, category)
    images = content.images
    # programs that make sets of training pictures shuffle them
    ordered = sorted(map(Path, images), key=natural)
    order = numbered(ordered, str(path))
    start, stop = span(frames, len(order.files))
    files = order.files[start:stop]
    first = next(iter(images.values()))
    size = (first["width"], first["height"])
    check_decoded(str(path), len(files) * size[0] * size[1])
    bits = empty_planes(len(files), size)
    there = np.array([file is not None for file in files])
    known = known_planes(there, size)
    for k, file in enumerate(files):
        mask = np.zeros((size[1], size[0]), dtype=bool)
        if file is not None:
            mask, crowd = content.masks(images[str(file)]["id"], size)
            if (crowd & ~mask).any():
                known = full_planes(len(files), size) if known is None else known
                known[k] = np.packbits(mask | ~crowd)
        bits[k] = np.packbits(mask)
        release(bits, k)
    check_some(str(path), there, start)
    numbers = np.arange(start, stop)
    return View(
        name=str(path),
        numbers=numbers,
        times=times_of(numbers, fps),
        bits=bits,
        known=known,
        usable=there,
        size=size,
        fps=fps,
        warnings=content.warnings,
        guesses=[*order.guesses, *content.guesses],
    )


class _Content:
    """The content of a file.

    Attributes:
        images: The images by name, all of one size.
        shapes: The shapes of the people in each image, by the image's number in the
            file. Each shape has a flag for crowds.
        guesses: Which category is taken, and what crowds mean.
        warnings: Which annotations belong to no image.
    """

    def __init__(self, path: Path, category: str | None) -> None:
        self._path = path
        try:
            document = json.loads(path.read_bytes())
        except (ValueError, RecursionError):
            raise self._error("a JSON file, got a damaged or another file") from None
        lists = []
        for key in ("images", "annotations", "categories"):
            value = document.get(key) if isinstance(document, dict) else None
            if not isinstance(value, list) or not all(
                isinstance(each, dict) for each in value
            ):
                raise self._error(
                    f"COCO's lists images, annotations and categories, got no {key}"
                )
            lists.append(value)
        images, annotations, categories = lists
        self.guesses = list[str]()
        self.warnings = list[str]()
        chosen = self._category(categories, category)
        self.images = self._images(images)
        self.shapes = defaultdict[Any, list[tuple[Any, bool]]](list)
        for each in annotations:
            if _key(each.get("category_id")) in chosen:
                shape = each.get("segmentation"), each.get("iscrowd") in (1, True)
                self.shapes[_key(each.get("image_id"))].append(shape)
        if not self.shapes:
            raise self._error("people with masks, got no annotation of the category")
        self._check_images()
        self._check_pixels()
        if any(crowd for shapes in self.shapes.values() for _, crowd in shapes):
            self.guesses.append(
                f"{self._path}: regions marked iscrowd are unknown in images with "
                "other people, and are people in all other images"
            )

    def _check_images(self) -> None:
        """Warn of annotations that belong to no image of the file.

        Raises InputError if none of them belongs to an image.
        """
        known = [image["id"] for image in self.images.values()]
        listed = {*known}
        others = [key for key in self.shapes if key not in listed]
        if not others:
            return
        if len(others) == len(self.shapes):
            raise self._error(
                "annotations of its images, whose id is their image_id, got "
                f"{quoted(others[0])} where images have {quoted(known[0])}"
            )
        self.warnings.append(
            f"{self._path}: {len(others)} of {len(self.shapes)} annotated images, "
            f"such as {quoted(others[0])}, are not in its list of images"
        )

    def _check_pixels(self) -> None:
        """Raise InputError if all corners are shares of the picture, not pixels."""
        largest = 0.0
        for shapes in self.shapes.values():
            for shape, _ in shapes:
                for corners in shape if isinstance(shape, list) else [[np.inf]]:
                    largest = max(largest, _largest(corners))
                if largest > 1.0:
                    return
        if largest > 0.0:
            raise self._error(
                f"polygons in pixels, got corners up to {largest:g}, which seem to be "
                "fractions of the picture's size"
            )

    def _error(self, expected: str) -> InputError:
        return InputError(f"{self._path}: expected {expected}")

    def _category(
        self, categories: Sequence[Mapping[str, Any]], wanted: str | None
    ) -> set[Any]:
        """Return the numbers of the people's category, which may be listed twice."""
        named = defaultdict[str, set[Any]](set)
        for each in categories:
            named[str(each.get("name"))].add(_key(each.get("id")))
        if wanted is None and len(named) == 1:
            (wanted,) = named
        elif wanted is None:
            wanted = DEFAULT_CATEGORY
            self.guesses.append(f"{self._path}: the category {DEFAULT_CATEGORY}")
        if wanted not in named:
            there = cut(", ".join(map(quoted, named))) or "none"
            raise InputError(
                f"{self._path}: category must be one of the file's, {there}, "
                f"got {quoted(wanted)}"
            )
        return named[wanted]

    def _images(self, images: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """Return the images by the name of their file."""
        by_name = dict[str, Any]()
        for image in images:
            sides = _key(image.get("width")), _key(image.get("height"))
            name = image.get("file_name")
            if not isinstance(name, str) or not name:
                raise self._error(f"images with a file_name, got {quoted(name)}")
            whole = all(type(side) is int and side > 0 for side in sides)
            if not whole or sides[0] * sides[1] > PIXELS:
                raise self._error(
                    f"images of up to {PIXELS // 10**6} million pixels, "
                    f"got {sides[0]}x{sides[1]}"
                )
            if str(Path(name)) in by_name:
                raise self._error(f"each image once, got {quoted(name)} twice")
            by_name[str(Path(name))] = {
                "id": _key(image.get("id")),
                "width": sides[0],
                "height": sides[1],
            }
        numbers = Counter(each["id"] for each in by_name.values())
        for number, count in numbers.items():
            if count > 1:
                raise self._error(
                    f"images with an id each, got {quoted(number)} for {count} images"
                )
        sizes = {(each["width"], each["height"]) for each in by_name.values()}
        if len(sizes) != 1:
            raise self._error(f"images of one size, got {len(sizes)} sizes")
        return by_name

    def masks(self, image: Any, size: tuple[int, int]) -> tuple[Mask, Mask]:
        """Return the pixels of the people in an image, and of its crowds.

        Some programs mark every run of pixels as a crowd: if an image has nothing else,
        its crowds are people.
        """
        people = np.zeros((size[1], size[0]), dtype=bool)
        crowds = np.zeros((size[1], size[0]), dtype=bool)
        shapes = self.shapes[image]
        only_crowds = all(crowd for _, crowd in shapes)
        for shape, crowd in shapes:
            if crowd and not only_crowds:
                crowds |= self._mask(shape, size)
            else:
                people |= self._mask(shape, size)
        return people, crowds

    def _mask(self, shape: Any, size: tuple[int, int]) -> Mask:
        """Return the pixels of one annotation's `segmentation`."""
        try:
            if isinstance(shape, Mapping):
                return unrun(shape, size)
            mask = np.zeros((size[1], size[0]), dtype=bool)
            for corners in shape:
                mask |= filled(np.array(corners, dtype=np.float64), size)
        except (TypeError, ValueError, KeyError, OverflowError):
            raise self._error(
                f"polygons or runs of pixels as COCO has them, got {cut(quoted(shape))}"
            ) from None
        return mask


def _key(value: Any) -> Any:
    """Return a whole number or a name, or None for any other value of a file."""
    if isinstance(value, float) and value.is_integer():
        return int(value)
    return value if isinstance(value, int | str) else None


def _largest(corners: Any) -> float:
    """Return the largest number of a polygon; infinite for anything else."""
    try:
        return float(np.max(np.array(corners, dtype=np.float64), initial=0.0))
    except (TypeError, ValueError):
        return float("inf")


def filled(corners: Array, size: tuple[int, int]) -> Mask:
    """Return the pixels of a polygon, as pycocotools fills it.

    Args:
        corners: Columns and rows (2 n,) in turn, of n corners.
        size: Width and height of the mask.

    Raises:
        ValueError: There are fewer than three corners, or some are far outside.
    """
    if corners.ndim != 1 or len(corners) < 6 or len(corners) % 2:
        raise ValueError("a polygon needs three corners or more")
    width, height = size
    # not finite, or so far outside that its outline would fill the memory
    if not np.abs(corners).max() <= MAX_OUTSIDE * (width + height):
        raise ValueError("a polygon needs corners near its image")
    # truncated, as a conversion to a whole number in C is
    fine = np.trunc(SUBPIXELS * corners.reshape(-1, 2) + 0.5).astype(np.int64)
    line = np.concatenate(
        [
            _between(start, stop)
            for start, stop in zip(fine, np.roll(fine, -1, axis=0), strict=True)
        ]
    )
    before = line[:-1]
    after = line[1:]
    turns = before[:, 0] != after[:, 0]
    # where the outline crosses from one fine column to the next
    across = np.where(after[:, 0] < before[:, 0], after[:, 0], after[:, 0] - 1)[turns]
    down = np.minimum(before[:, 1], after[:, 1])[turns]
    columns, off = np.divmod(across - SUBPIXELS // 2, SUBPIXELS)
    inside = (off == 0) & (columns >= 0) & (columns < width)
    rows = np.ceil((down[inside] + 0.5) / SUBPIXELS - 0.5)
    rows = np.clip(rows, 0, height).astype(np.int64)
    # from a crossing down to the end of all columns, inside and outside are exchanged
    crossings = np.bincount(
        columns[inside] * height + rows, minlength=width * height + 1
    )
    odd = np.cumsum(crossings)[: width * height] % 2 == 1
    return np.ascontiguousarray(odd.reshape(width, height).T)


def _between(start: Runs, stop: Runs) -> Runs:
    """Return the points (n, 2) of a line, one for each step of its longer side."""
    steps = np.abs(stop - start)
    longer = int(steps.argmax()) if steps[0] != steps[1] else 0
    shorter = 1 - longer
    count = int(steps[longer])
    # start at the lower end of the longer side: a line is the same in both directions
    low, high = (start, stop) if start[longer] <= stop[longer] else (stop, start)
    points = np.empty((count + 1, 2), dtype=np.int64)
    along = np.arange(count + 1)
    points[:, longer] = low[longer] + along
    slope = (high[shorter] - low[shorter]) / count if count else 0.0
    points[:, shorter] = np.trunc(low[shorter] + slope * along + 0.5)
    return points if low is start else points[::-1]


def unrun(shape: Mapping[str, Any], size: tuple[int, int]) -> Mask:
    """Return the pixels of runs, which go down the columns and start with background.

    Args:
        shape: `size`, height and width, and `counts`, numbers or a text.
        size: Width and height of the mask.

    Raises:
        ValueError: The runs are of another size, or do not fill it.
        KeyError: An entry is missing.
    """
    width, height = size
    if [*shape["size"]] != [height, width]:
        raise ValueError("runs of another size than their image")
    counts = shape["counts"]
    if isinstance(counts, str):
        runs = _decompressed(counts)
    else:
        runs = np.array(counts, dtype=np.int64).reshape(-1)
    if (runs < 0).any() or runs.sum() != width * height:
        raise ValueError("runs that do not fill their image")
    person = np.arange(len(runs)) % 2 == 1
    pixels = np.repeat(person, runs)
    return np.ascontiguousarray(pixels.reshape(width, height).T)


def _decompressed(text: str) -> Runs:
    """Return the runs of COCO's compressed text.

    Each letter has five bits of a number, the lowest first, and a sixth that tells
    whether more follow. From the fourth run on, a number is the difference from the run
    two before.
    """
    runs = list[int]()
    value = 0
    shift = 0
    for letter in text.encode():
        bits = letter - 48
        if not 0 <= bits < 64 or shift > 60:
            raise ValueError("not a text of runs")
        value |= (bits & 31) << shift
        shift += 5
        if bits & 32:
            continue
        if bits & 16:
            value -= 1 << shift
        runs.append(value + runs[-2] if len(runs) > 2 else value)
        value = 0
        shift = 0
    if shift:
        raise ValueError("a text of runs that ends too early")
    return np.array(runs, dtype=np.int64)
