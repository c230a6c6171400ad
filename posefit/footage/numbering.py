"""The image files of a camera's frames, by the numbers in their names."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from posefit.errors import InputError
from posefit.footage.images import IMAGES

_FORMATS = {".jpeg": ".jpg", ".tiff": ".tif"}  # two suffixes of one format
# missing numbers per image: with more, the numbers do not count frames but something
# else, such as a date
MOST_MISSING = 9.0
# digits of a number that still fits in 64 bits
DIGITS = 18
# most objects or cameras that the last number of names counts, if it is not the frame
MOST_OBJECTS = 8
# words before a number that does not count frames
_NO_FRAME = re.compile(
    r"(^|[^a-z])(cam(era)?|view|obj(ect)?|person|id|inst(ance)?|track|player|subject"
    r"|label)[^a-z]*$",
    re.IGNORECASE,
)


class Images(NamedTuple):
    """Image files of one camera: one file per frame, or one file of several pages."""

    name: str  # what messages call them
    files: tuple[Path, ...]
    # the files in the order of their numbers; None before `numbered_together`
    numbered: "Numbered | None" = None


class Numbered(NamedTuple):
    """The images of successive frames, and the numbers in their names."""

    files: list[Path | None]  # None for a missing number
    guesses: list[str]
    # the frames' numbers; None if the names do not count frames
    numbers: range | None = None


def images_in(folder: Path) -> list[Path]:
    """Return the images of a folder in the natural order of their names."""
    files = list[Path]()
    for file in folder.iterdir():
        # some systems copy each image together with a hidden file of its attributes
        hidden = file.name.startswith(".")
        if file.suffix.lower() in IMAGES and not hidden:
            files.append(file)
    return sorted(files, key=natural)


def natural(file: Path) -> tuple[Sequence[tuple[int, str]], str]:
    """Return a sorting key by which 2 comes before 10, and numbers after text."""
    key = list[tuple[int, str]]()
    for part in re.findall(r"[0-9]+|[^0-9]+", file.name):
        key.append((int(part), "") if part.isdigit() else (-1, part))
    return key, file.name


def numbered(images: Sequence[Path], name: str) -> Numbered:
    """Return the images of successive frames, by the numbers in their names.

    If only one number in the names changes, it counts the frames; otherwise the last
    number does.

    Args:
        images: The files as listed.
        name: What messages call them.

    Raises:
        InputError: Files have several formats, two files have the same number, or some
            have none. Some of them are probably not masks, or of another camera.
    """
    _check_one_kind(images, name)
    # text, number, text, number, ..., text
    parts = [re.split(r"([0-9]+)", file.stem) for file in images]
    _check_all_numbered(images, parts, name)
    _check_one_a_frame(images, parts, name)
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
    # names that differ in more than this number do not count frames by it alone
    rests = set[tuple[str, ...]]()
    for part in parts:
        rest = list(part)
        del rest[column]
        rests.add(tuple(rest))
    # 1 and 01 are the same number
    if len(rests) == 1 and len(set(numbers)) < len({file.name for file in images}):
        _check_each_once(images, numbers, name)
    if len(rests) > 1 or not rising:
        listed = f"{name}: the frames are in the listed order, not by their numbers"
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
        kinds[_FORMATS.get(suffix, suffix)] += 1
    if len(kinds) > 1:
        came = " and ".join(f"{count} {kind}" for kind, count in kinds.most_common())
        raise InputError(
            f"{name}: expected images of one kind, got {came}; "
            "name the files, such as masks/*.png"
        )


def _check_all_numbered(
    images: Sequence[Path], parts: Sequence[Sequence[str]], name: str
) -> None:
    """Raise InputError if a few of many images have no number in their names."""
    others = [
        image for image, part in zip(images, parts, strict=True) if len(part) == 1
    ]
    if 0 < 2 * len(others) <= len(images):
        raise InputError(
            f"{name}: expected a number in the name of every image, got "
            f"{others[0].name}; name the files, such as masks/*_*.png"
        )


def _check_one_a_frame(
    images: Sequence[Path], parts: Sequence[Sequence[str]], name: str
) -> None:
    """Raise InputError if names seem to count objects or cameras in each frame.

    Such names have two numbers that change. One has a word such as `cam` before it, or
    is the last one and takes few values, while most pairs of the two are there.
    """
    if _texts_differ(parts):
        return
    columns = _changing(parts)
    if len(columns) == 1 and len({file.parent for file in images}) > 1:
        _check_each_once(images, [int(part[columns[0]]) for part in parts], name)
    if len(columns) != 2:
        return
    values = {column: [int(part[column]) for part in parts] for column in columns}
    for column, other in (columns, columns[::-1]):
        objects = len(set(values[column]))
        frames = len(set(values[other]))
        is_named = _NO_FRAME.search(parts[0][column - 1])
        is_few = column > other and objects < frames and objects <= MOST_OBJECTS
        if (is_named or is_few) and 2 * len(images) >= objects * frames:
            _check_each_once(images, values[other], name)


def _check_each_once(images: Sequence[Path], numbers: Sequence[int], name: str) -> None:
    """Raise InputError if two images have the same number."""
    first = dict[int, Path]()
    for number, image in zip(numbers, images, strict=True):
        if number in first:
            one, other = first[number], image
            if one.name == other.name:
                raise InputError(
                    f"{name}: expected one image a frame, got {one} and {other}; give "
                    "the folder of each camera"
                )
            raise InputError(
                f"{name}: expected one image a frame, got {one.name} and "
                f"{other.name}; name the files that count, such as masks/*_1.png"
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
    changing = _changing(parts)
    return changing[0] if len(changing) == 1 else last_number


def _changing(parts: Sequence[Sequence[str]]) -> list[int]:
    """Return which numbers change in names that have the same texts."""
    changing = list[int]()
    for column, texts in enumerate(zip(*parts, strict=True)):
        # 7 and 007 are the same number
        if len({text.lstrip("0") for text in texts}) > 1:
            changing.append(column)
    return changing


def _spread(by_number: Mapping[int, Path], numbers: range, name: str) -> Numbered:
    """Return the image of each number; None for numbers without one."""
    files = [by_number.get(number) for number in numbers]
    missing = files.count(None)
    guesses = []
    if numbers.step > 1:
        guesses.append(f"{name}: the numbers of frames rise by {numbers.step}")
    if missing:
        guesses.append(
            f"{name}: {missing} of the frames {numbers[0]} to {numbers[-1]} are "
            "missing, and the pose is held"
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
    known = [images.numbers for images in listed if images.numbers is not None]
    if len(cameras) > 1 and len(known) == len(listed):
        listed = _paired(listed, known, names)
    elif len(cameras) > 1:
        _guess_order(listed, names)
    return [
        camera._replace(numbered=images)
        for camera, images in zip(cameras, listed, strict=True)
    ]


def _guess_order(listed: list[Numbered], names: Sequence[str]) -> None:
    """Add the guess that images are paired in their order, if there are several."""
    for k, images in enumerate(listed):
        if len(images.files) > 1:
            in_order = (
                f"images of {' and '.join(names)} are paired in the order of their "
                "names, because not all of these contain the number of a frame"
            )
            listed[k] = images._replace(guesses=[*images.guesses, in_order])
            return


def _paired(
    listed: Sequence[Numbered], known: Sequence[range], names: Sequence[str]
) -> list[Numbered]:
    """Return the images of cameras, each at the place of its number.

    `known` are the numbers of each camera. Raises InputError if they share none.
    """
    shared = set.intersection(*(set(_by_number(images)) for images in listed))
    if not shared:
        came = " and ".join(
            f"{numbers[0]} to {numbers[-1]} of {name}"
            for numbers, name in zip(known, names, strict=True)
        )
        raise InputError(
            "images of the same moment must have the same number in the names of all "
            f"cameras, got {came}"
        )
    lowest = min(numbers[0] for numbers in known)
    highest = max(numbers[-1] for numbers in known)
    # one spacing on which the numbers of every camera lie
    steps = [numbers.step for numbers in known]
    offsets = [numbers[0] - lowest for numbers in known]
    every = range(lowest, highest + 1, math.gcd(*steps, *offsets))
    return [
        _spread(_by_number(images), every, name)
        for images, name in zip(listed, names, strict=True)
    ]


def _by_number(images: Numbered) -> dict[int, Path]:
    """Return the images of a camera by their numbers."""
    assert images.numbers is not None
    numbers = zip(images.numbers, images.files, strict=True)
    return {number: file for number, file in numbers if file is not None}
