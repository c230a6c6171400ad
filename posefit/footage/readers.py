"""Read masks from images, from an array, or from an .npz or .npy file.

| step | where |
|---|---|
| files to frames | `numbered`: one page per frame; missing numbers are unknown frames |
| frames to values | `images.read_marks`, `archive.archived` |
| values to bits | `ValueCounts.classifier`, `_pack` |

Values may be 0 and 1, 0 and 255, soft values in between, an alpha channel or labels.
One file alone does not show which. So all values are counted before any pixel is
decided: each image is decoded twice, once to count and once to decide.
"""

import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.archive import Stored, archived, mapped
from posefit.errors import InputError
from posefit.footage.images import (
    FORMATS,
    IMAGES,
    MANY_COLOURS,
    PIXELS,
    Marks,
    flat_share,
    page_count,
    read_marks,
)
from posefit.footage.views import (
    MOST,
    Planes,
    Range,
    View,
    empty_planes,
    full_planes,
    span,
    times_of,
)
from posefit.geometry.skeleton import JOINTS
from posefit.limits import RATES, check_decoded
from posefit.reading import cut, existing, quoted
from posefit.silhouette.mask import Mask

ARRAYS = (".npz", ".npy")  # files of masks
PACKED = 2_000_000_000  # largest .npz file that is opened, in bytes
_KINDS = {".jpeg": ".jpg", ".tiff": ".tif"}  # two suffixes of one format
NAMES = ("masks", "valid", "usable", "fps", "first", "landmarks")  # keys of an .npz
LAST = 1_000_000_000  # largest number of a frame; larger ones are mistakes

# missing numbers per image: with more, the numbers do not count frames but something
# else, such as a date
MOST_MISSING = 9.0
# different values that are counted: masks with more of them are soft
COUNTED_VALUES = 4_096
SCALES = (1.0, 255.0, 65_535.0)  # values of a pixel that is entirely the person
PERCENT = 100.0
# times a scale: resampled soft masks overshoot it a little
NEAR_SCALE = 1.25
# share of the highest value, if that is no usual scale: resampled soft masks undershoot
# 0 by at most this much
RINGING = 0.1

# (height, width): grey levels, an alpha channel, palette indices, or colours 0xRRGGBB
Values = NDArray[Any]
# turns values into the mask (height, width) of the person
Classifier = Callable[[Values], Mask]


class Images(NamedTuple):
    """Image files of one camera: one file per frame, or one file of several pages."""

    name: str  # what messages call them
    files: tuple[Path, ...]
    # the files in the order of their numbers; None before `numbered_together`
    numbered: "Numbered | None" = None


def read_array(
    stack: NDArray[Any], frames: Range, label: int | None, fps: float | None
) -> View:
    """Return the view of masks (T, height, width) in memory."""
    return _packed("masks", {"masks": stack}, frames, label, fps)


def read_npy(path: Path, frames: Range, label: int | None, fps: float | None) -> View:
    """Return the view of an .npy file of masks."""
    stack = mapped(existing(path))
    check_decoded(str(path), stack.nbytes)
    return _packed(str(path), {"masks": stack}, frames, label, fps)


def read_npz(path: Path, frames: Range, label: int | None, fps: float | None) -> View:
    """Return the view of an .npz file, which may have the keys `NAMES`."""
    existing(path)
    with archived(path, NAMES, "the key masks", PACKED, single=True) as arrays:
        check_decoded(str(path), sum(array.nbytes for array in arrays.values()))
        return _packed(str(path), arrays, frames, label, fps)


def first_number(path: Path) -> int:
    """Return the number of the first frame that an .npz file states; 0 by default."""
    with archived(path, NAMES, "the key masks", PACKED, single=True) as arrays:
        return int(np.asarray(arrays["first"])) if "first" in arrays else 0


def images_in(folder: Path) -> list[Path]:
    """Return the images of a folder in the natural order of their names."""
    files = list[Path]()
    for file in folder.iterdir():
        # some systems copy each image together with a hidden file of its attributes
        hidden = file.name.startswith(".")
        if file.suffix.lower() in IMAGES and not hidden:
            files.append(file)
    return sorted(files, key=_natural)


def _natural(file: Path) -> tuple[Sequence[tuple[int, str]], str]:
    """Return a sorting key by which 2 comes before 10, and numbers after text."""
    key = list[tuple[int, str]]()
    for part in re.findall(r"[0-9]+|[^0-9]+", file.name):
        key.append((int(part), "") if part.isdigit() else (-1, part))
    return key, file.name


class Numbered(NamedTuple):
    """The images of successive frames, and the numbers in their names."""

    files: list[Path | None]  # None for a missing number
    guesses: list[str]
    # the frames' numbers; None if the names do not count frames
    numbers: range | None = None


# digits of a number that still fits in 64 bits
DIGITS = 18


def numbered(images: Sequence[Path], name: str) -> Numbered:
    """Return the images of successive frames, by the numbers in their names.

    If only one number in the names changes, it counts the frames; otherwise the last
    number does.

    Args:
        images: The files as listed.
        name: What messages call them.

    Raises:
        InputError: Files have several formats, or two files have the same number. Some
            of them are probably not masks.

    """
    _check_one_kind(images, name)
    # text, number, text, number, ..., text
    parts = [re.split(r"([0-9]+)", file.stem) for file in images]
    column = _counting_column(parts)
    if len(images) < 2 or not all(
        len(part) >= 3 and len(part[column]) <= DIGITS for part in parts
    ):
        return Numbered(list(images), [])
    numbers = [int(part[column]) for part in parts]
    if _texts_differ(parts):
        _check_each_once(images, numbers, name)
    steps = np.diff(numbers)
    rising = bool((steps > 0).all())
    others = {(*part[:column], *part[column:][1:]) for part in parts}
    if len(others) > 1 or not rising:
        listed = f"{name}: the frames come as listed, not as numbered"
        return Numbered(list(images), [] if rising else [listed])
    step = int(np.gcd.reduce(steps))
    missing = int((steps // step - 1).sum())
    if missing > MOST_MISSING * len(images):
        ends = f"{numbers[0]} to {numbers[-1]}"
        uncounted = f"{name}: the numbers from {ends} do not count frames"
        return Numbered(list(images), [uncounted])
    counted = range(numbers[0], numbers[-1] + 1, step)
    return _spread(dict(zip(numbers, images, strict=True)), counted, name)


def _check_one_kind(images: Sequence[Path], name: str) -> None:
    """Raise InputError if images have several formats, by their suffixes."""
    kinds = Counter[str]()
    for file in images:
        suffix = file.suffix.lower()
        kinds[_KINDS.get(suffix, suffix)] += 1
    if len(kinds) > 1:
        came = " and ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        raise InputError(
            f"{name}: expected images of one kind, got {came}; "
            "name the files, such as masks/*.png"
        )


def _check_each_once(images: Sequence[Path], numbers: Sequence[int], name: str) -> None:
    """Raise InputError if two images have the same number."""
    first = dict[int, Path]()
    for number, image in zip(numbers, images, strict=True):
        if number in first:
            raise InputError(
                f"{name}: expected one image a frame, got {first[number].name} and "
                f"{image.name}; name the files, such as masks/*.png"
            )
        first[number] = image


def _texts_differ(parts: Sequence[Sequence[str]]) -> bool:
    """Return whether names, split into text and numbers, differ in their text."""
    return len({tuple(part[::2]) for part in parts}) > 1


def _counting_column(parts: Sequence[Sequence[str]]) -> int:
    """Return which part of names counts: the only number that changes, or the last one.

    `parts` are the names, split into text and numbers in turn.
    """
    last_number = -2
    if _texts_differ(parts):
        return last_number
    changing = list[int]()
    for column, texts in enumerate(zip(*parts, strict=True)):
        # 7 and 007 are the same number
        if len({text.lstrip("0") for text in texts}) > 1:
            changing.append(column)
    return changing[0] if len(changing) == 1 else last_number


def _spread(places: Mapping[int, Path], numbers: range, name: str) -> Numbered:
    """Return the image of each number; None for numbers without one."""
    files = [places.get(number) for number in numbers]
    missing = files.count(None)
    guesses = []
    if numbers.step > 1:
        guesses.append(f"{name}: every {numbers.step}th number is a frame")
    if missing:
        guesses.append(
            f"{name}: {missing} of the frames {numbers[0]} to {numbers[-1]} are "
            "missing, and are held"
        )
    return Numbered(files, guesses, numbers)


def numbered_together(cameras: Sequence[Images]) -> list[Images]:
    """Return the images of cameras, numbered so that one number is one moment.

    The lowest number of all cameras is frame 0. A number that a camera lacks is missing
    for that camera. If names do not count frames, cameras are paired in the order of
    their files, which is a guess.

    Raises:
        InputError: The cameras have no number in common.

    """
    names = [camera.name for camera in cameras]
    listed = [numbered(camera.files, camera.name) for camera in cameras]
    known = [view.numbers for view in listed if view.numbers is not None]
    if len(cameras) > 1 and len(known) == len(listed):
        listed = _paired(listed, known, names)
    elif len(cameras) > 1:
        _guess_order(listed, names)
    return [
        camera._replace(numbered=view)
        for camera, view in zip(cameras, listed, strict=True)
    ]


def _guess_order(listed: list[Numbered], names: Sequence[str]) -> None:
    """Add the guess that images are paired in their order, if there are several."""
    for k, view in enumerate(listed):
        if len(view.files) > 1:
            in_order = (
                f"images of {' and '.join(names)} are of one moment in the order in "
                "which they come, as not all of their names count frames"
            )
            listed[k] = view._replace(guesses=[*view.guesses, in_order])
            return


def _paired(
    listed: Sequence[Numbered], known: Sequence[range], names: Sequence[str]
) -> list[Numbered]:
    """Return the images of cameras, each at the place of its number.

    `known` are the numbers of each camera. Raises InputError if they share none.
    """
    shared = set.intersection(*(set(_by_number(view)) for view in listed))
    if not shared:
        came = " and ".join(
            f"{numbers[0]} to {numbers[-1]} of {name}"
            for numbers, name in zip(known, names, strict=True)
        )
        raise InputError(
            "images of one moment must have one number in the names of all cameras, "
            f"got {came}"
        )
    lowest = min(numbers[0] for numbers in known)
    highest = max(numbers[-1] for numbers in known)
    # one spacing on which the numbers of every camera lie
    steps = [numbers.step for numbers in known]
    offsets = [numbers[0] - lowest for numbers in known]
    every = range(lowest, highest + 1, math.gcd(*steps, *offsets))
    return [
        _spread(_by_number(view), every, name)
        for view, name in zip(listed, names, strict=True)
    ]


def _by_number(view: Numbered) -> dict[int, Path]:
    """Return the images of a camera by their numbers."""
    assert view.numbers is not None
    numbers = zip(view.numbers, view.files, strict=True)
    return {number: file for number, file in numbers if file is not None}


def together(views: Sequence[View]) -> list[View]:
    """Cut the views of several cameras to the frames that all of them have.

    Frames are compared by their numbers, if all cameras state them.

    Raises:
        InputError: The cameras have no frame in common, or they begin at different
            frames and not all of them state numbers.

    """
    starts = [int(view.numbers[0]) for view in views]
    stops = [int(view.numbers[-1]) + 1 for view in views]
    names = [view.name for view in views]
    if not all(view.counted for view in views):
        if len(set(starts)) > 1:
            each = zip(starts, names, strict=True)
            came = " and ".join(f"{first} of {name}" for first, name in each)
            raise InputError(f"cameras must begin with one frame, got frame {came}")
        return list(views)
    start = max(starts)
    stop = min(stops)
    spans = zip(starts, stops, names, strict=True)
    came = ", ".join(f"{first}:{last} of {name}" for first, last, name in spans)
    if start >= stop:
        raise InputError(f"cameras must have frames in common, got {came}")
    if len(set(starts)) > 1 or len(set(stops)) > 1:
        used = f"the frames {start}:{stop} are used, which all cameras have, of {came}"
        first_view = replace(views[0], guesses=[*views[0].guesses, used])
        views = [first_view, *views[1:]]
    return [
        view[start - first : stop - first]
        for view, first in zip(views, starts, strict=True)
    ]


def read_images(
    images: Images, frames: Range, label: int | None, fps: float | None
) -> View:
    """Return the view of images of one size.

    Raises InputError naming the file if one is not an image, or has another size.
    """
    name = images.name
    assert images.numbered is not None
    every = list[tuple[Path | None, int]]()
    for file in images.numbered.files:
        pages = 1 if file is None else page_count(existing(file))
        every += [(file, page) for page in range(pages)]
    start, stop = span(frames, len(every))
    chosen = every[start:stop]
    there = np.array([file is not None for file, _ in chosen])
    if not there.any():
        raise InputError(
            f"{name}: frames must choose some of the images that are there, "
            f"got none from {start} to {stop}"
        )
    size, is_person, kind = _decided(_marks(chosen, name, label), label, name)
    bits = _pack(_marks(chosen, name, label), int(there.sum()), size, is_person)
    known = None
    if not there.all():
        shown = bits
        bits = empty_planes(len(chosen), size)
        bits[~there] = 0
        bits[there] = shown
        known = full_planes(len(chosen), size)
        known[~there] = 0
    numbers = np.arange(start, stop)
    return View(
        name=name,
        numbers=numbers,
        times=times_of(numbers, fps),
        bits=bits,
        known=known,
        usable=there,
        size=size,
        fps=fps,
        guesses=[*images.numbered.guesses, *kind],
    )


def _marks(
    images: Sequence[tuple[Path | None, int]], name: str, label: int | None
) -> Iterator[Marks]:
    """Yield how each image marks a person. Missing images are skipped.

    `images` are files and pages; None for a missing file. Raises InputError if a file
    is not an image or cannot be a mask.
    """
    known = [(file, page) for file, page in images if file is not None]
    first: Marks | None = None
    for file, group in groupby(known, key=itemgetter(0)):
        pages = [page for _, page in group]
        remaining = len(pages)
        for marks in read_marks(file, pages, label is not None):
            remaining -= 1
            if marks.photo:
                raise _many_colours(str(file) if first else name)
            if first is None:
                check_decoded(name, marks.values.nbytes * len(known))
            if marks.values.dtype.kind == "f" and not np.isfinite(marks.values).all():
                raise InputError(f"{file}: masks must be finite, got nan or infinity")
            first = first or marks
            if marks.values.shape != first.values.shape:
                raise InputError(
                    f"{file}: mask must have shape {first.values.shape}, "
                    f"got {marks.values.shape}"
                )
            yield marks
        if remaining:
            raise InputError(
                f"{file}: expected an image ({FORMATS}), got another or a damaged file"
            )


def _packed(
    name: str,
    arrays: Mapping[str, Stored | NDArray[Any]],
    frames: Range,
    label: int | None,
    rate: float | None,
) -> View:
    """Return the view of the arrays of an .npz file, named as in `NAMES`.

    Args:
        name: What messages call the source.
        arrays: The arrays by name; only `masks` is required.
        frames: Which frames to read.
        label: The person's value; None to find it out.
        rate: Frames per second; None for what the arrays state.

    Raises:
        InputError: An array has a wrong shape, type or value, or no frame is usable.

    """
    stack = _checked_stack(name, arrays)
    count, height, width = stack.shape
    fps = _stated_rate(name, arrays)
    first = int(np.asarray(arrays["first"])) if "first" in arrays else 0
    if not 0 <= first <= LAST:
        raise InputError(
            f"{name}: first must be the number of a frame up to {LAST:,}, got {first}"
        )
    start, stop = span(frames, count, first)
    usable = np.ones(count, dtype=bool)
    if "usable" in arrays:
        usable = np.asarray(arrays["usable"])
    if not usable[start:stop].any():
        raise InputError(
            f"{name}: expected a frame that is usable, got none from {start} to {stop}"
        )
    size = (width, height)
    is_person = _above(0.0)
    guesses = list[str]()
    # the values of booleans need no count
    if stack.dtype.kind != "b" or label is not None:
        _, is_person, guesses = _decided(_chosen(name, stack, start, stop), label, name)
    masks = _pack(_chosen(name, stack, start, stop), stop - start, size, is_person)
    valid = None
    if "valid" in arrays:
        planes = _chosen(name, arrays["valid"], start, stop)
        valid = _pack(planes, stop - start, size, _above(0.0))
    landmarks = None
    if "landmarks" in arrays:
        landmarks = np.array(arrays["landmarks"], dtype=np.float64)[start:stop]
        if not np.isfinite(landmarks).all() or landmarks[..., 2].min() < 0.0:
            raise InputError(
                f"{name}: landmarks must be finite numbers with confidences of 0 or "
                "more, got others"
            )
    fps = rate or fps
    numbers = first + np.arange(start, stop)
    return View(
        name=name,
        numbers=numbers,
        times=times_of(numbers, fps),
        bits=masks,
        known=valid,
        usable=usable[start:stop].copy(),
        size=size,
        fps=fps,
        counted="first" in arrays,
        landmarks=landmarks,
        guesses=guesses,
    )


def _stated_rate(
    name: str, arrays: Mapping[str, Stored | NDArray[Any]]
) -> float | None:
    """Return the frame rate that arrays state, if any. Raises InputError if invalid."""
    if "fps" not in arrays:
        return None
    fps = float(np.asarray(arrays["fps"]))
    if not RATES[0] <= fps <= RATES[1]:
        ends = f"{RATES[0]:g} to {RATES[1]:g}"
        raise InputError(f"{name}: fps must lie in {ends}, got {fps:g}")
    return fps


# height over width: a picture of a standing person may be upright, but a narrower array
# has its axes in another order
NARROW = 4


def _checked_stack(
    name: str, arrays: Mapping[str, Stored | NDArray[Any]]
) -> Stored | NDArray[Any]:
    """Return the masks. Raises InputError if any array has a wrong shape or type."""
    if "masks" not in arrays:
        raise InputError(f"{name}: expected an .npz file with the key masks, got none")
    stack = arrays["masks"]
    shape = tuple(stack.shape)
    if len(shape) != 3 or 0 in shape or stack.dtype.kind not in "buif":
        raise InputError(
            f"{name}: masks must have shape (frames, height, width), "
            f"got {_described(stack)}"
        )
    count, height, width = shape
    if width * NARROW < height:
        raise InputError(
            f"{name}: masks must have shape (frames, height, width), "
            f"got {width} as the width of {shape}"
        )
    if height * width > PIXELS:
        raise InputError(
            f"{name}: expected at most {PIXELS // 10**6} million pixels a frame, "
            f"got {width}x{height}"
        )
    points = (count, len(JOINTS), 3)
    others = {
        "valid": _Expected(shape, "bui", f"have the masks' shape {quoted(shape)}"),
        "usable": _Expected((count,), "b", f"be {count} booleans"),
        "landmarks": _Expected(points, "f", f"be of shape {points}"),
        "fps": _Expected((), "iuf", "be a number, of frames a second"),
        "first": _Expected((), "iu", "be a whole number, of the first frame"),
    }
    for key, expected in others.items():
        stored = arrays.get(key)
        if stored is None:
            continue
        fits = tuple(stored.shape) == expected.shape
        if not fits or stored.dtype.kind not in expected.kinds:
            raise InputError(
                f"{name}: {key} must {expected.words}, got {_described(stored)}"
            )
    return stack


class _Expected(NamedTuple):
    """What an array must be."""

    shape: tuple[int, ...]
    kinds: str  # the kinds of NumPy dtypes, a letter each
    words: str  # the same in a message, after "must"


def _described(stored: Stored | NDArray[Any]) -> str:
    return f"{quoted(tuple(stored.shape))} {stored.dtype}"


def _chosen(
    name: str, stored: Stored | NDArray[Any], start: int, stop: int
) -> Iterator[Marks]:
    """Yield frames start to stop.

    The remaining frames are read too, because a checksum follows the last one.
    """
    for k, frame in enumerate(stored):
        if frame.dtype.kind == "f" and not np.isfinite(frame).all():
            raise InputError(
                f"{name}: masks must be finite, got nan or infinity in frame {k}"
            )
        if start <= k < stop:
            yield Marks(frame)


def _decided(
    frames: Iterable[Marks], label: int | None, name: str
) -> tuple[tuple[int, int], Classifier, list[str]]:
    """Return the size of frames, their classifier, and what was guessed about them."""
    counts = ValueCounts()
    size = (0, 0)
    for marks in frames:
        counts.add(marks)
        size = marks.values.shape[1], marks.values.shape[0]
    return size, *counts.classifier(label, name)


def _pack(
    frames: Iterable[Marks], count: int, size: tuple[int, int], is_person: Classifier
) -> Planes:
    """Return the bits of the person in `count` frames of one size."""
    planes = empty_planes(count, size)
    for k, marks in enumerate(frames):
        planes[k] = np.packbits(is_person(marks.values))
    return planes


@dataclass(eq=False)
class ValueCounts:
    """Counts the values in all masks of a source, and decides which are the person."""

    # whether values say how much of a pixel is the person, as in lossy images,
    # fractions and alpha channels
    soft: bool = False
    alpha: bool = False  # whether all masks are alpha channels
    several: int = 0  # masks with more than two values
    flat: int = 0  # the ones among these with flat areas, like maps of labels
    fractions: bool = False  # whether some values are not whole numbers
    lowest: float = np.inf
    highest: float = 0.0
    # pixels with each value; no longer counted once masks are soft
    pixels: Counter[int | float] = field(default_factory=Counter)
    # masks in which each value fills an area, and not only the edge between two others
    solid: Counter[int | float] = field(default_factory=Counter)

    def add(self, marks: Marks) -> None:
        """Count the next mask."""
        values = marks.values
        low = values.min()
        high = values.max()
        first = self.lowest == np.inf
        self.alpha = marks.alpha and (self.alpha or first)
        self.lowest = min(self.lowest, float(low))
        self.highest = max(self.highest, float(high))
        self.fractions |= values.dtype.kind == "f" and bool(
            (values != np.floor(values)).any()
        )
        self.soft |= marks.soft
        if self.soft:
            return
        top = int(np.count_nonzero(values == high))
        # masks with one or two values are common, and counting is faster than sorting
        if low == high:
            unique = np.array([high])
            counts = np.array([top])
        elif top + np.count_nonzero(values == low) == values.size:
            unique = np.array([low, high])
            counts = np.array([values.size - top, top])
        else:
            unique, counts = np.unique(values, return_counts=True)
        self.pixels.update(dict(zip(unique.tolist(), counts.tolist(), strict=True)))
        self.soft = len(self.pixels) > (2 if self.fractions else COUNTED_VALUES)
        if len(unique) > 1 and not self.soft:
            self.solid.update(_solid(values, unique))
            self.several += len(unique) > 2
            self.flat += len(unique) > 2 and flat_share(values) >= MOST

    def classifier(
        self, label: int | None, name: object
    ) -> tuple[Classifier, list[str]]:
        """Decide which values are the person.

        Args:
            label: The person's value, if the user gave one.
            name: What messages call the source.

        Returns:
            A function that turns values into a mask, and what was guessed about them.

        Raises:
            InputError: There are several labels, or the given one does not occur.

        """
        if label is not None:
            return self._labelled(label, name), []
        values = sorted(self.pixels)
        many = len(values) > MANY_COLOURS
        if many and not self.soft and 2 * self.flat > self.several:
            most = [value for value, _ in self.pixels.most_common() if value]
            raise self._several(name, most)
        if self.highest > SCALES[-1] and (self.soft or many):
            raise _many_colours(name)
        ends = f"{name}: masks of values from {self.lowest:.4g} to {self.highest:.4g}"
        if self.soft or many:
            half, kind = self._half
            return _above(half), [f"{ends} are {kind}: the person is above {half:g}"]
        if len(values) <= 2:
            threshold, usual = _of_two(values)
            guess = f"{ends}: the person is the higher of two"
            return _above(threshold), [] if usual else [guess]
        labels = [value for value, _ in self.solid.most_common() if value]
        if len(labels) > 1:
            raise self._several(name, labels)
        if labels:
            threshold = float(labels[0] // 2)
            # a value far above the only label is not its edge: in PASCAL VOC, 255 marks
            # the outlines of objects
            limit = max(labels[0], NEAR_SCALE * labels[0])
        else:
            threshold, _ = self._half
            limit = self.highest
        above = f"{ends}: the person is above {threshold:g}"
        if self.highest > limit:
            guess = f"{above}, and what is above {limit:g} is not"
            return _between(threshold, limit), [guess]
        return _above(threshold), [f"{above}, what is between is an edge"]

    def _labelled(self, label: int, name: object) -> Classifier:
        """Return the classifier of a label that the user gave."""
        if self.soft:
            kinds = "masks whose values are labels, PNG or whole numbers"
            raise InputError(f"{name}: label must be given for {kinds}, got soft ones")
        if label not in self.pixels:
            there = self._listed([value for value, _ in self.pixels.most_common()])
            raise InputError(
                f"{name}: label must be one of those that are there, {there}, "
                f"got {label}"
            )
        return lambda values: np.asarray(values == label)

    def _several(self, name: object, labels: Sequence[float]) -> InputError:
        """Return the error for masks with several labels that could be the person."""
        return InputError(
            f"{name}: expected masks of one person, got the labels "
            f"{self._listed(labels)}; --label N chooses one"
        )

    @property
    def _half(self) -> tuple[float, str]:
        """The value of a pixel that is half person, and what kind of values these are.

        It is rounded down, because whole numbers have no middle: 127 of 255. Numbers up
        to about 100 are percentages. Negative numbers are a network's logits, whose
        middle is 0, unless they are so small that resampling explains them. An alpha
        channel that is nowhere half opaque is a translucent colour.
        """
        usual = any(
            0.5 * scale <= self.highest <= NEAR_SCALE * scale for scale in SCALES
        )
        # resampling undershoots 0 as far as it overshoots the scale
        below = NEAR_SCALE - 1.0 if usual else RINGING
        if self.lowest < -below * self.highest:
            return 0.0, "logits"
        if self.alpha and self.highest <= SCALES[1] // 2:
            return float(self.highest // 2), "translucent"
        # fractions that fit no usual scale: above 1, and far below 255
        if self.fractions and NEAR_SCALE < self.highest < SCALES[1] / 4.0:
            return self.highest / 2.0, "degrees"
        # on the scale of 255, no pixel would be more than half person
        if 0.5 * PERCENT < self.highest <= NEAR_SCALE * PERCENT:
            return 0.5 * PERCENT, "percentages"
        scales = [scale for scale in SCALES if self.highest <= NEAR_SCALE * scale]
        full = scales[0] if scales else self.highest
        return (0.5 if full == 1.0 else float(full // 2)), "degrees"

    def _listed(self, labels: Sequence[float]) -> str:
        """Return labels for a message, shortened; colours as hexadecimal numbers."""
        are_colours = self.highest > SCALES[-1]
        written = [f"0x{value:06x}" if are_colours else str(value) for value in labels]
        return cut(", ".join(written))


def _of_two(values: Sequence[float]) -> tuple[float, bool]:
    """Return the threshold of at most two values, and whether they are usual.

    The higher of two values is the person. A single value is the person unless it is 0
    or negative. Usual values are 0, 1 and 255, and need no guess.
    """
    if not values:
        return 0.0, True
    usual = min(values[0], 0) == 0 and values[-1] in (0, *SCALES[:2])
    lower = values[0] if len(values) == 2 else min(values[0], 0)
    return float(lower), usual


def _above(threshold: float) -> Classifier:
    return lambda values: np.asarray(values > threshold)


def _between(threshold: float, most: float) -> Classifier:
    return lambda values: np.asarray((values > threshold) & (values <= most))


def _many_colours(name: object) -> InputError:
    return InputError(
        f"{name}: expected masks, got pictures in many colours; "
        "a person cut out needs an alpha channel"
    )


def _solid(values: Values, unique: NDArray[Any]) -> list[int]:
    """Return the values that fill 3 x 3 pixels somewhere, as a mere edge does not."""
    if len(unique) > MANY_COLOURS:
        return []
    numbers = np.searchsorted(unique, values).astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    same = cv2.erode(numbers, kernel) == cv2.dilate(numbers, kernel)
    return [int(unique[k]) for k in np.unique(numbers[same])]
