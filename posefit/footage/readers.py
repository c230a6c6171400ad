"""Read masks from images, from an array, or from an .npz or .npy file.

| step | where |
|---|---|
| files to frames | `numbering.numbered`: a page per frame; missing ones are unknown |
| frames to values | `images.read_marks`, `archive.archived` |
| values to bits | `values.ValueCounts.classifier`, `_pack` |

All values are counted before any pixel is decided: each image is decoded twice, once to
count and once to decide.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from posefit.archive import Stored, archived, mapped
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.images import FORMATS, PIXELS, Marks, page_count, read_marks
from posefit.footage.numbering import Images
from posefit.footage.values import Classifier, ValueCounts, above, many_colours
from posefit.footage.views import (
    Planes,
    Range,
    View,
    check_some,
    empty_planes,
    known_planes,
    release,
    span,
    times_of,
)
from posefit.geometry.skeleton import JOINTS
from posefit.limits import RATES, check_decoded
from posefit.reading import existing, quoted

ARRAYS = (".npz", ".npy")  # files of masks
MAX_PACKED_BYTES = 2_000_000_000  # largest .npz file that is opened, in bytes
KEYS = ("masks", "valid", "usable", "fps", "first", "landmarks")  # keys of an .npz
MAX_NUMBER = 1_000_000_000  # largest number of a frame; larger ones are mistakes
# by name, as in `KEYS`; only `masks` is required
Arrays = Mapping[str, Stored | NDArray[Any]]


def read_array(
    stack: NDArray[Any], frames: Range, label: int | None, fps: float | None
) -> View:
    """Return the view of masks (T, height, width) in memory."""
    return view_of("masks", {"masks": stack}, frames, label, fps)


def read_npy(path: Path, frames: Range, label: int | None, fps: float | None) -> View:
    """Return the view of an .npy file of masks."""
    stack = mapped(existing(path))
    check_decoded(str(path), stack.nbytes)
    return view_of(str(path), {"masks": stack}, frames, label, fps)


def read_npz(path: Path, frames: Range, label: int | None, fps: float | None) -> View:
    """Return the view of an .npz file, which may have any of `KEYS`."""
    existing(path)
    with archived(path, KEYS, "the key masks", MAX_PACKED_BYTES, single=True) as arrays:
        check_decoded(str(path), sum(array.nbytes for array in arrays.values()))
        return view_of(str(path), arrays, frames, label, fps)


def first_number(path: Path) -> int:
    """Return the number of the first frame that an .npz file states; 0 by default."""
    with archived(path, KEYS, "the key masks", MAX_PACKED_BYTES, single=True) as arrays:
        return _stated_first(str(path), arrays)


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
    check_some(name, there, start)
    size, is_person, kind = _decided(_marks(chosen, name, label), label, name)
    bits = _pack(_marks(chosen, name, label), int(there.sum()), size, is_person)
    if not there.all():
        shown = bits
        bits = empty_planes(len(chosen), size)
        bits[~there] = 0
        bits[there] = shown
    numbers = np.arange(start, stop)
    return View(
        name=name,
        numbers=numbers,
        times=times_of(numbers, fps),
        bits=bits,
        known=known_planes(there, size),
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
                raise many_colours(str(file) if first else name)
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
                f"{file}: expected an image ({FORMATS}), got a damaged or another file"
            )


def view_of(
    name: str,
    arrays: Arrays,
    frames: Range,
    label: int | None,
    rate: float | None,
) -> View:
    """Return the view of arrays of masks, named as in `KEYS`.

    This is what the reader of a new kind of file calls once it has decoded the masks.

    Args:
        name: What messages call the source.
        arrays: The arrays by name.
        frames: Which frames to read.
        label: The person's value; None to find it out.
        rate: Frames per second; None for what the arrays state.

    Raises:
        InputError: An array has a wrong shape, type or value, or no frame is usable.
    """
    stack = _checked_stack(name, arrays)
    count, height, width = stack.shape
    fps = rate or _stated_rate(name, arrays)
    first = _stated_first(name, arrays)
    start, stop = span(frames, count, first)
    usable = _stated_usable(name, arrays, start, stop)
    size = (width, height)
    is_person = above(0.0)
    guesses = list[str]()
    # the values of booleans need no count
    if stack.dtype.kind != "b" or label is not None:
        _, is_person, guesses = _decided(_chosen(name, stack, start, stop), label, name)
    bits = _pack(_chosen(name, stack, start, stop), stop - start, size, is_person)
    known = None
    if "valid" in arrays:
        planes = _chosen(name, arrays["valid"], start, stop)
        known = _pack(planes, stop - start, size, above(0.0))
    numbers = first + np.arange(start, stop)
    return View(
        name=name,
        numbers=numbers,
        times=times_of(numbers, fps),
        bits=bits,
        known=known,
        usable=usable,
        size=size,
        fps=fps,
        states_numbers="first" in arrays,
        landmarks=_stated_landmarks(name, arrays, start, stop),
        guesses=guesses,
    )


def _stated_rate(name: str, arrays: Arrays) -> float | None:
    """Return the frame rate that arrays state, if any. Raises InputError if invalid."""
    if "fps" not in arrays:
        return None
    fps = float(np.asarray(arrays["fps"]))
    if not RATES[0] <= fps <= RATES[1]:
        ends = f"{RATES[0]:g} to {RATES[1]:g}"
        raise InputError(f"{name}: fps must lie in {ends}, got {fps:g}")
    return fps


def _stated_first(name: str, arrays: Arrays) -> int:
    """Return the number of the first frame that arrays state; 0 by default."""
    first = int(np.asarray(arrays["first"])) if "first" in arrays else 0
    if not 0 <= first <= MAX_NUMBER:
        raise InputError(
            f"{name}: first must be the number of a frame up to {MAX_NUMBER:,}, "
            f"got {first}"
        )
    return first


def _stated_usable(
    name: str, arrays: Arrays, start: int, stop: int
) -> NDArray[np.bool_]:
    """Return which frames from start to stop are marked as usable; all by default.

    Raises InputError if none is.
    """
    if "usable" not in arrays:
        return np.ones(stop - start, dtype=bool)
    usable = np.asarray(arrays["usable"])[start:stop].copy()
    if not usable.any():
        raise InputError(f"{name}: no frame from {start} to {stop} is marked as usable")
    return usable


def _stated_landmarks(name: str, arrays: Arrays, start: int, stop: int) -> Array | None:
    """Return the landmarks of frames start to stop that arrays state, if any."""
    if "landmarks" not in arrays:
        return None
    landmarks = np.array(arrays["landmarks"], dtype=np.float64)[start:stop]
    if not np.isfinite(landmarks).all() or landmarks[..., 2].min() < 0.0:
        raise InputError(
            f"{name}: landmarks must be finite numbers with confidences of 0 or "
            "more, got nan, infinity or a negative confidence"
        )
    return landmarks


# height over width: a picture of a standing person may be upright, but a narrower array
# has its axes in another order
MAX_NARROWNESS = 4


def _checked_stack(name: str, arrays: Arrays) -> Stored | NDArray[Any]:
    """Return the masks. Raises InputError if any array has a wrong shape or type."""
    if "masks" not in arrays:
        raise InputError(
            f"{name}: expected an .npz file with the key masks, got one without it"
        )
    stack = arrays["masks"]
    shape = tuple(stack.shape)
    if len(shape) != 3 or 0 in shape or stack.dtype.kind not in "buif":
        raise InputError(
            f"{name}: masks must have shape (frames, height, width), "
            f"got {_described(stack)}"
        )
    count, height, width = shape
    if width * MAX_NARROWNESS < height:
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
        release(planes, k)
    return planes
