"""Masks from images, an array, or an .npz or .npy file: which pixels are the person's by the values of all of them.

| step | where |
|---|---|
| files to frames | `numbered`: a frame a page; numbers that are missing are frames in which nothing is known |
| frames to values | `images.read_marks`, `archive.archived` |
| values to bits | `ValueCounts.classifier`, `_pack` |

Values may be 0 and 1, 0 and 255, degrees, an alpha channel or labels. One file does not show which, so the values of
all files are counted before any pixel is decided: an image is decoded once to count, and once to decide.
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
PACKED = 2_000_000_000  # bytes of an .npz file
_KINDS = {".jpeg": ".jpg", ".tiff": ".tif"}
NAMES = ("masks", "valid", "usable", "fps", "first", "landmarks")
LAST = 1_000_000_000  # number of a frame

# missing numbers for each image: where there are more, the numbers count something else
MOST_MISSING = 9.0
COUNTED_VALUES = 4_096
SCALES = (1.0, 255.0, 65_535.0)  # values of a pixel that is wholly the person's
PERCENT = 100.0
# times a scale: degrees may go a little beyond, as resampling makes them
NEAR_SCALE = 1.25
# of the highest value, where that is no usual scale: degrees go no farther below 0
RINGING = 0.1

# (height, width): grey levels, an alpha channel, indices of a palette, or colours
# 0xRRGGBB
Values = NDArray[Any]
# values to the mask (height, width) of the person
Classifier = Callable[[Values], Mask]


class Images(NamedTuple):
    """Image files of one camera, one a frame or a file of pages, and what messages call them."""

    name: str
    files: tuple[Path, ...]
    # those of successive frames, by the numbers in their names; None until `numbered_together`
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
    """Return the view of an .npz file of masks, and of what is with them: those are `NAMES`."""
    existing(path)
    with archived(path, NAMES, "the key masks", PACKED, single=True) as arrays:
        check_decoded(str(path), sum(array.nbytes for array in arrays.values()))
        return _packed(str(path), arrays, frames, label, fps)


def first_number(path: Path) -> int:
    """Return the number of the first frame of an .npz file, which it may state; else 0."""
    with archived(path, NAMES, "the key masks", PACKED, single=True) as arrays:
        return int(np.asarray(arrays["first"])) if "first" in arrays else 0


def images_in(folder: Path) -> list[Path]:
    """Return the images of a folder in the natural order of their names."""
    # hidden files are ignored: some systems put one beside each image that they copy
    files = (
        file
        for file in folder.iterdir()
        if file.suffix.lower() in IMAGES and not file.name.startswith(".")
    )
    return sorted(files, key=_natural)


def _natural(file: Path) -> tuple[Sequence[tuple[int, str]], str]:
    """Return the key that files are sorted by: numbers in their names count as such."""
    parts = re.findall(r"[0-9]+|[^0-9]+", file.name)
    return [(int(p), "") if p.isdigit() else (-1, p) for p in parts], file.name


class Numbered(NamedTuple):
    """The images of successive frames, and the numbers in their names."""

    files: list[Path | None]  # None for a number that is missing
    guesses: list[str]
    # of the frames, with the step from one to the next; None where names do not tell
    numbers: range | None = None


def numbered(images: Sequence[Path], name: str) -> Numbered:
    """Return the images of successive frames, by the numbers in their names.

    The number is the only one that changes, or else the last one. Raises InputError where files are of several kinds,
    or several have one number: some are no masks then.
    """
    kinds = Counter(
        _KINDS.get(suffix := file.suffix.lower(), suffix) for file in images
    )
    if len(kinds) > 1:
        came = " and ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        raise InputError(
            f"{name}: expected images of one kind, got {came}; name the files, such as masks/*.png"
        )
    parts = [re.split(r"([0-9]+)", file.stem) for file in images]
    column = _changing(parts)
    if len(images) < 2 or not all(
        len(part) >= 3 and len(part[column]) < 19 for part in parts
    ):
        return Numbered(list(images), [])
    numbers = [int(part[column]) for part in parts]
    if len({tuple(part[::2]) for part in parts}) > 1:
        twice = next(
            (k for k, number in enumerate(numbers) if number in numbers[:k]), None
        )
        if twice is not None:
            pair = (
                f"{images[numbers.index(numbers[twice])].name} and {images[twice].name}"
            )
            raise InputError(
                f"{name}: expected one image a frame, got {pair}; name the files, such as masks/*.png"
            )
    steps = np.diff(numbers)
    others = {(*part[:column], *part[column:][1:]) for part in parts}
    if len(others) > 1 or not (steps > 0).all():
        listed = f"{name}: the frames come as listed, not as numbered"
        return Numbered(list(images), [] if (steps > 0).all() else [listed])
    step = int(np.gcd.reduce(steps))
    missing = int((steps // step - 1).sum())
    if missing > MOST_MISSING * len(images):
        uncounted = f"{name}: the numbers from {numbers[0]} to {numbers[-1]} do not count frames"
        return Numbered(list(images), [uncounted])
    counted = range(numbers[0], numbers[-1] + 1, step)
    return _spread(dict(zip(numbers, images, strict=True)), counted, name)


def _changing(parts: Sequence[Sequence[str]]) -> int:
    """Return which part of names, texts and numbers in turn, counts: the only number that changes, or the last one."""
    if len({tuple(part[::2]) for part in parts}) > 1:
        return -2
    columns = zip(*parts, strict=True)
    changing = [
        column
        for column, texts in enumerate(columns)
        if len(set(map(_plain_number, texts))) > 1
    ]
    return changing[0] if len(changing) == 1 else -2


def _plain_number(text: str) -> str:
    return text.lstrip("0")


def _spread(places: Mapping[int, Path], numbers: range, name: str) -> Numbered:
    """Return the images of these numbers, some of which may be missing."""
    files = [places.get(number) for number in numbers]
    missing = files.count(None)
    guesses = []
    if numbers.step > 1:
        guesses.append(f"{name}: every {numbers.step}th number is a frame")
    if missing:
        guesses.append(
            f"{name}: {missing} of the frames {numbers[0]} to {numbers[-1]} are missing, and are held"
        )
    return Numbered(files, guesses, numbers)


def numbered_together(cameras: Sequence[Images]) -> list[Images]:
    """Return the images of cameras, numbered: of several, those with one number at one place.

    The lowest number of all is frame 0, and a number that a camera does not have is missing. Images whose names do not
    count frames are paired as they come, and that is guessed. Raises InputError where no number is in the names of all
    cameras.
    """
    names = [camera.name for camera in cameras]
    listed = [numbered(camera.files, camera.name) for camera in cameras]
    known = [view.numbers for view in listed if view.numbers is not None]
    if len(cameras) > 1 and len(known) == len(listed):
        listed = _paired(listed, known, names)
    elif len(cameras) > 1:
        several = next((k for k, view in enumerate(listed) if len(view.files) > 1), 0)
        if len(listed[several].files) > 1:
            in_order = (
                f"images of {' and '.join(names)} are of one moment in the order in which they come, "
                "as not all of their names count frames"
            )
            guesses = [*listed[several].guesses, in_order]
            listed[several] = listed[several]._replace(guesses=guesses)
    return [
        camera._replace(numbered=view)
        for camera, view in zip(cameras, listed, strict=True)
    ]


def _paired(
    listed: Sequence[Numbered], known: Sequence[range], names: Sequence[str]
) -> list[Numbered]:
    """Return the images of cameras, whose numbers are `known`, at the places of their numbers."""
    shared = set.intersection(*(_own_numbers(view) for view in listed))
    if not shared:
        came = " and ".join(
            f"{numbers[0]} to {numbers[-1]} of {name}"
            for numbers, name in zip(known, names, strict=True)
        )
        raise InputError(
            f"images of one moment must have one number in the names of all cameras, got {came}"
        )
    lowest = min(numbers[0] for numbers in known)
    highest = max(numbers[-1] for numbers in known)
    step = math.gcd(
        *(numbers.step for numbers in known),
        *(numbers[0] - lowest for numbers in known),
    )
    every = []
    for view, numbers, name in zip(listed, known, names, strict=True):
        places = {
            number: file
            for number, file in zip(numbers, view.files, strict=True)
            if file is not None
        }
        every.append(_spread(places, range(lowest, highest + 1, step), name))
    return every


def _own_numbers(view: Numbered) -> set[int]:
    """Return the numbers that a camera's images have."""
    assert view.numbers is not None
    numbers = zip(view.numbers, view.files, strict=True)
    return {number for number, file in numbers if file is not None}


def together(views: Sequence[View]) -> list[View]:
    """Return the views of several cameras, cut to the frames whose numbers all of them have, where they state numbers.

    Raises InputError where they have none in common, and where only some state that theirs begin elsewhere.
    """
    ends = [(int(view.numbers[0]), int(view.numbers[-1]) + 1) for view in views]
    if not all(view.counted for view in views):
        if len({first for first, _ in ends}) > 1:
            came = " and ".join(
                f"{first} of {view.name}"
                for (first, _), view in zip(ends, views, strict=True)
            )
            raise InputError(f"cameras must begin with one frame, got frame {came}")
        return list(views)
    start = max(first for first, _ in ends)
    stop = min(last for _, last in ends)
    came = ", ".join(
        f"{first}:{last} of {view.name}"
        for (first, last), view in zip(ends, views, strict=True)
    )
    if start >= stop:
        raise InputError(f"cameras must have frames in common, got {came}")
    if len(set(ends)) > 1:
        used = f"the frames {start}:{stop} are used, which all cameras have, of {came}"
        first = replace(views[0], guesses=[*views[0].guesses, used])
        views = [first, *views[1:]]
    places = [slice(start - first, stop - first) for first, _ in ends]
    return [view[rows] for view, rows in zip(views, places, strict=True)]


def read_images(
    images: Images, frames: Range, label: int | None, fps: float | None
) -> View:
    """Return the view of images of one size. Raises InputError naming the file where one is none."""
    name = images.name
    assert images.numbered is not None
    every = [
        (file, page)
        for file in images.numbered.files
        for page in range(1 if file is None else page_count(existing(file)))
    ]
    start, stop = span(frames, len(every))
    chosen = every[start:stop]
    there = np.array([file is not None for file, _ in chosen])
    if not there.any():
        raise InputError(
            f"{name}: frames must choose some of the images that are there, got none from {start} to {stop}"
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
        name,
        numbers,
        times_of(numbers, fps),
        bits,
        known,
        there,
        size,
        fps=fps,
        guesses=[*images.numbered.guesses, *kind],
    )


def _marks(
    images: Sequence[tuple[Path | None, int]], name: str, label: int | None
) -> Iterator[Marks]:
    """Yield how each of the images, files and pages but None, marks a person. Raises InputError where one does not."""
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
                    f"{file}: mask must have shape {first.values.shape}, got {marks.values.shape}"
                )
            yield marks
        if remaining:
            raise InputError(
                f"{file}: expected an image ({FORMATS}), got a file that is none"
            )


def _packed(
    name: str,
    arrays: Mapping[str, Stored | NDArray[Any]],
    frames: Range,
    label: int | None,
    rate: float | None,
) -> View:
    """Return the view of arrays by their names, at a `rate` or at their own.

    Raises InputError naming what holds them where it holds none.
    """
    stack = _checked_stack(name, arrays)
    count, height, width = stack.shape
    usable = (
        np.asarray(arrays["usable"])
        if "usable" in arrays
        else np.ones(count, dtype=bool)
    )
    fps = float(np.asarray(arrays["fps"])) if "fps" in arrays else None
    if fps is not None and not RATES[0] <= fps <= RATES[1]:
        ends = f"{RATES[0]:g} to {RATES[1]:g}"
        raise InputError(f"{name}: fps must lie in {ends}, got {fps:g}")
    first = int(np.asarray(arrays["first"])) if "first" in arrays else 0
    if not 0 <= first <= LAST:
        raise InputError(
            f"{name}: first must be the number of a frame up to {LAST:,}, got {first}"
        )
    start, stop = span(frames, count, first)
    if not usable[start:stop].any():
        raise InputError(
            f"{name}: expected a frame that is usable, got none from {start} to {stop}"
        )
    size = (width, height)
    is_person = _above(0.0)
    guesses = list[str]()
    if stack.dtype.kind != "b" or label is not None:  # booleans need no count
        _, is_person, guesses = _decided(_chosen(name, stack, start, stop), label, name)
    masks = _pack(_chosen(name, stack, start, stop), stop - start, size, is_person)
    valid = None
    if "valid" in arrays:
        valid = _pack(
            _chosen(name, arrays["valid"], start, stop), stop - start, size, _above(0.0)
        )
    landmarks = (
        np.array(arrays["landmarks"], dtype=np.float64)[start:stop]
        if "landmarks" in arrays
        else None
    )
    if landmarks is not None and not (
        np.isfinite(landmarks).all() and landmarks[..., 2].min() >= 0.0
    ):
        raise InputError(
            f"{name}: landmarks must be finite numbers with confidences of 0 or more, got others"
        )
    fps = rate or fps
    numbers = first + np.arange(start, stop)
    return View(
        name,
        numbers,
        times_of(numbers, fps),
        masks,
        valid,
        usable[start:stop].copy(),
        size,
        fps=fps,
        counted="first" in arrays,
        landmarks=landmarks,
        guesses=guesses,
    )


# times that a picture may be as high as wide: a person stands, but what is narrower is
# no picture
NARROW = 4


def _checked_stack(
    name: str, arrays: Mapping[str, Stored | NDArray[Any]]
) -> Stored | NDArray[Any]:
    """Return the masks of arrays. Raises InputError where one of them has another shape or type."""
    if "masks" not in arrays:
        raise InputError(f"{name}: expected an .npz file with the key masks, got none")
    stack = arrays["masks"]
    shape = tuple(stack.shape)
    if len(shape) != 3 or 0 in shape or stack.dtype.kind not in "buif":
        raise InputError(
            f"{name}: masks must have shape (frames, height, width), got {_described(stack)}"
        )
    if shape[2] * NARROW < shape[1]:
        raise InputError(
            f"{name}: masks must have shape (frames, height, width), got {shape[2]} as the width of {shape}"
        )
    if shape[1] * shape[2] > PIXELS:
        raise InputError(
            f"{name}: expected at most {PIXELS // 10**6} million pixels a frame, got {shape[2]}x{shape[1]}"
        )
    others: dict[str, tuple[tuple[int, ...], str, str]] = {
        "valid": (shape, "bui", f"have the masks' shape {quoted(shape)}"),
        "usable": (shape[:1], "b", f"be {shape[0]} booleans"),
        "landmarks": (
            (shape[0], len(JOINTS), 3),
            "f",
            f"be of shape {shape[0], len(JOINTS), 3}",
        ),
        "fps": ((), "iuf", "be a number, of frames a second"),
        "first": ((), "iu", "be a whole number, of the first frame"),
    }
    for key, (wanted, kinds, expected) in others.items():
        stored = arrays.get(key)
        if stored is not None and (
            tuple(stored.shape) != wanted or stored.dtype.kind not in kinds
        ):
            raise InputError(f"{name}: {key} must {expected}, got {_described(stored)}")
    return stack


def _described(stored: Stored | NDArray[Any]) -> str:
    return f"{quoted(tuple(stored.shape))} {stored.dtype}"


def _chosen(
    name: str, stored: Stored | NDArray[Any], start: int, stop: int
) -> Iterator[Marks]:
    """Yield frames start to stop; the others are read to the end, for the checksum."""
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
    """Return the size of frames, how their values become masks, and what was guessed of them."""
    counts = ValueCounts()
    size = (0, 0)
    for marks in frames:
        counts.add(marks)
        size = marks.values.shape[1], marks.values.shape[0]
    return size, *counts.classifier(label, name)


def _pack(
    frames: Iterable[Marks], count: int, size: tuple[int, int], is_person: Classifier
) -> Planes:
    """Return the bits of so many frames."""
    planes = empty_planes(count, size)
    for k, marks in enumerate(frames):
        planes[k] = np.packbits(is_person(marks.values))
    return planes


@dataclass(eq=False)
class ValueCounts:
    """Counts the values in the masks of a source, one mask after the other, and decides which are the person's."""

    # whether a value is a degree: in lossy images, in fractions, in an alpha channel
    soft: bool = False
    alpha: bool = False  # whether all are of alpha channels
    # masks with several values, and those of them whose areas are flat, as of labels
    several: int = 0
    flat: int = 0
    fractions: bool = False
    lowest: float = np.inf
    highest: float = 0.0
    # with each value, while these are few
    pixels: Counter[int | float] = field(default_factory=Counter)
    # masks in which a value is more than an edge between others
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
        # takes less time than sorting
        if low == high or top + np.count_nonzero(values == low) == values.size:
            different = slice(int(low == high), 2)
            unique = np.array([low, high])[different]
            counts = np.array([values.size - top, top])[different]
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
        """Return how these values become masks, and what was guessed of them.

        Raises InputError where it is open which label is the person.
        """
        if label is not None:
            if self.soft:
                kinds = "masks whose values are labels, PNG or whole numbers"
                raise InputError(
                    f"{name}: label must be given for {kinds}, got soft ones"
                )
            if label not in self.pixels:
                there = self._listed([value for value, _ in self.pixels.most_common()])
                raise InputError(
                    f"{name}: label must be one of those that are there, {there}, got {label}"
                )
            return lambda values: np.asarray(values == label), []
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
        if len(values) <= 2:  # whichever two they are
            usual = not values or (
                min(values[0], 0) == 0 and values[-1] in (0, *SCALES[:2])
            )
            threshold = (
                float(values[0] if len(values) == 2 else min(values[0], 0))
                if values
                else 0.0
            )
            return _above(threshold), [] if usual else [
                f"{ends}: the person is the higher of two"
            ]
        labels = [value for value, _ in self.solid.most_common() if value]
        if len(labels) > 1:
            raise self._several(name, labels)
        threshold = float(labels[0] // 2) if labels else self._half[0]
        # what is far above the only label is no edge of it, as the 255 around the objects of PASCAL VOC
        limit = max(labels[0], NEAR_SCALE * labels[0]) if labels else self.highest
        if self.highest > limit:
            return _between(threshold, limit), [
                f"{ends}: the person is above {threshold:g}, and what is above {limit:g} is not"
            ]
        return _above(threshold), [
            f"{ends}: the person is above {threshold:g}, what is between is an edge"
        ]

    def _several(self, name: object, labels: Sequence[float]) -> InputError:
        """Return the error of masks with several labels, none of which is known to be the person's."""
        return InputError(
            f"{name}: expected masks of one person, got the labels {self._listed(labels)}; --label N chooses one"
        )

    @property
    def _half(self) -> tuple[float, str]:
        """The value half way to a whole person, 127 of 255, as whole numbers have no middle; and what the values are.

        Numbers up to about 100 are percentages. Signed ones are a network's logits, of which 0 is the middle. Degrees
        that were resampled go a little below 0, and reach about a whole person. An alpha channel that is nowhere half
        opaque is a translucent colour.
        """
        usual = any(
            0.5 * scale <= self.highest <= NEAR_SCALE * scale for scale in SCALES
        )
        # degrees go as far below 0 as beyond the scale
        below = NEAR_SCALE - 1.0 if usual else RINGING
        if self.lowest < -below * self.highest:
            return 0.0, "logits"
        if self.alpha and self.highest <= SCALES[1] // 2:
            return float(self.highest // 2), "translucent"
        # of no usual scale
        if self.fractions and NEAR_SCALE < self.highest < SCALES[1] / 4.0:
            return self.highest / 2.0, "degrees"
        # above half of 255 there is nothing
        if 0.5 * PERCENT < self.highest <= NEAR_SCALE * PERCENT:
            return 0.5 * PERCENT, "percentages"
        full = next(
            (scale for scale in SCALES if self.highest <= NEAR_SCALE * scale),
            self.highest,
        )
        return (0.5 if full == 1.0 else float(full // 2)), "degrees"

    def _listed(self, labels: Sequence[float]) -> str:
        """Return some labels, the commonest first; colours as hexadecimal numbers."""
        written = [
            str(value) if self.highest <= SCALES[-1] else f"0x{value:06x}"
            for value in labels
        ]
        return cut(", ".join(written))


def _above(threshold: float) -> Classifier:
    return lambda values: np.asarray(values > threshold)


def _between(threshold: float, most: float) -> Classifier:
    return lambda values: np.asarray((values > threshold) & (values <= most))


def _many_colours(name: object) -> InputError:
    return InputError(
        f"{name}: expected masks, got pictures in many colours; a person cut out needs an alpha channel"
    )


def _solid(values: Values, unique: NDArray[Any]) -> list[int]:
    """Return those values that fill 3 x 3 pixels somewhere: what lies between two others at an edge does not."""
    if len(unique) > MANY_COLOURS:
        return []
    numbers = np.searchsorted(unique, values).astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    same = cv2.erode(numbers, kernel) == cv2.dilate(numbers, kernel)
    return [int(unique[k]) for k in np.unique(numbers[same])]
