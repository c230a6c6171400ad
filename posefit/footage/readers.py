"""Masks from images, an array, or an .npz or .npy file: which pixels are the person's by the values of all of them.

Values may be 0 and 1, 0 and 255, degrees, an alpha channel or labels. One file does not show which, so the values of
all files are counted before any pixel is decided. An image is decoded once: its values wait, compressed, in a temporary
file, which is on the disk where they are many.
"""

import re
import tempfile
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.archive import Stored, archived, mapped
from posefit.errors import InputError
from posefit.footage.images import FORMATS, PIXELS, is_colourful, read_values
from posefit.footage.masks import PackedMasks, Planes, Range, empty_planes, existing, span
from posefit.geometry.skeleton import JOINTS
from posefit.limits import check_decoded
from posefit.reading import quoted
from posefit.silhouette.mask import Mask

IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
NUMBER_DIGITS = 1_000  # of a number in a name that files are sorted by
SPOOLED = 64_000_000  # bytes of compressed values that are kept in memory; more are on the disk
PACKED = 2_000_000_000  # bytes of an .npz file
MAX_FPS = 1000.0
NAMES = ("masks", "valid", "usable", "fps", "landmarks")

FEW_VALUES = 64  # masks with more values are soft
COUNTED_VALUES = 4_096
SCALES = (1.0, 255.0, 65_535.0)  # values of a pixel that is wholly the person's
LISTED_LABELS = 6  # in a message

Values = NDArray[Any]  # (height, width): grey levels, an alpha channel, indices of a palette, or colours 0xRRGGBB
Classifier = Callable[[Values], Mask]  # values to the mask (height, width) of the person


Masks = NDArray[Any] | tuple[Path, ...]  # of one camera: (frames, height, width), or an image a frame


def read_masks(source: Path | Masks, frames: Range, label: int | None = None) -> PackedMasks:
    """Return the masks of images, of a folder of them, of an array, or of an .npz or .npy file, cut to `frames`.

    Images of a folder come in the natural order of their names: 2 before 10. `label` is the person's value, where masks
    hold several. Raises InputError naming the file.
    """
    if isinstance(source, tuple):
        return read_images(source, name_of(source), frames, label)
    if isinstance(source, np.ndarray):
        return _packed(name_of(source), {"masks": source}, frames, label)
    if source.is_dir():
        # hidden files are ignored: some systems put one beside each image that they copy
        files = (file for file in source.iterdir() if file.suffix.lower() in IMAGES and not file.name.startswith("."))
        if not (images := sorted(files, key=_natural)):
            raise InputError(f"{source}: expected a folder with mask images ({', '.join(IMAGES)}), got none")
        return read_images(images, str(source), frames, label)
    existing(source)
    if source.suffix.lower() == ".npy":
        stack = mapped(source)
        check_decoded(str(source), stack.nbytes)
        return _packed(str(source), {"masks": stack}, frames, label)
    with archived(source, NAMES, "the key masks", PACKED) as arrays:
        check_decoded(str(source), sum(array.nbytes for array in arrays.values()))
        return _packed(str(source), arrays, frames, label)


def name_of(source: str | Path | Masks) -> str:
    """Return what messages call masks: their path, that of a single image, the folder of several, or `masks`."""
    if isinstance(source, str | Path):
        return str(source)
    if isinstance(source, tuple) and len(source) == 1:
        return str(source[0])
    return str(source[0].parent) if isinstance(source, tuple) and source[0].parent.name else "masks"


def read_images(images: Sequence[Path], name: str, frames: Range, label: int | None = None) -> PackedMasks:
    """Return the masks of images of one size. Raises InputError naming the file where one is none."""
    start, stop = span(frames, len(images))
    chosen = images[start:stop]
    if is_colourful(existing(chosen[0])):
        raise _many_colours(name)
    counts, shape = ValueCounts(), (0, 0)
    stored: list[tuple[int, np.dtype[Any]]] = []
    with tempfile.SpooledTemporaryFile(SPOOLED) as spool:
        for file in chosen:
            read = read_values(file, label is not None)
            if read is None:
                raise InputError(f"{file}: expected an image ({FORMATS}), got a file that is none")
            values, soft = read
            if not stored:
                shape = values.shape
                check_decoded(name, values.nbytes * len(chosen))
            if values.shape != shape:
                raise InputError(f"{file}: mask must have shape {shape}, got {values.shape}")
            counts.add(values, soft)
            stored.append((spool.write(zlib.compress(values.tobytes(), 1)), values.dtype))
        is_person, size = counts.classifier(label, name), (shape[1], shape[0])
        masks = empty_planes(len(chosen), size)
        spool.seek(0)
        for k, (length, dtype) in enumerate(stored):
            values = np.frombuffer(zlib.decompress(spool.read(length)), dtype).reshape(shape)
            masks[k] = np.packbits(is_person(values))
    usable = np.ones(len(chosen), dtype=bool)
    return PackedMasks([str(file) for file in chosen], size, masks, None, usable, first=start)


def _natural(file: Path) -> tuple[Sequence[tuple[int, str]], str]:
    """Return the key that files are sorted by: numbers in their names count as such."""
    parts = re.findall(r"[0-9]+|[^0-9]+", file.name)
    return [(int(p), "") if p.isdigit() and len(p) < NUMBER_DIGITS else (-1, p) for p in parts], file.name


def _packed(name: str, arrays: Mapping[str, Stored | NDArray[Any]], frames: Range, label: int | None) -> PackedMasks:
    """Return the masks of arrays by their names. Raises InputError naming what holds them where it holds none."""
    stack = _checked_stack(name, arrays)
    count, height, width = stack.shape
    usable = np.asarray(arrays["usable"]) if "usable" in arrays else np.ones(count, dtype=bool)
    fps = float(np.asarray(arrays["fps"])) if "fps" in arrays else None
    if fps is not None and not 0.0 < fps <= MAX_FPS:
        raise InputError(f"{name}: fps must be a number up to {MAX_FPS:g}, got {fps:g}")
    start, stop = span(frames, count)
    if not usable[start:stop].any():
        raise InputError(f"{name}: expected a frame that is usable, got none from {start} to {stop}")
    masks = _pack(stack, start, stop, _stack_classifier(name, stack, start, stop, label))
    valid = _pack(arrays["valid"], start, stop, _above(0.0)) if "valid" in arrays else None
    names = [f"{name}[{k}]" for k in range(start, stop)]
    landmarks = np.array(arrays["landmarks"], dtype=np.float64)[start:stop] if "landmarks" in arrays else None
    if landmarks is not None and not (np.isfinite(landmarks).all() and landmarks[..., 2].min() >= 0.0):
        raise InputError(f"{name}: landmarks must be finite numbers with confidences of 0 or more, got others")
    return PackedMasks(names, (width, height), masks, valid, usable[start:stop], fps, landmarks, start)


NARROW = 4  # times that a picture may be as high as wide: a person stands, but what is narrower is no picture


def _checked_stack(name: str, arrays: Mapping[str, Stored | NDArray[Any]]) -> Stored | NDArray[Any]:
    """Return the masks of arrays. Raises InputError where one of them has another shape or type."""
    if "masks" not in arrays:
        raise InputError(f"{name}: expected an .npz file with the key masks, got none")
    stack = arrays["masks"]
    shape = tuple(stack.shape)
    if len(shape) != 3 or 0 in shape or stack.dtype.kind not in "buif":
        raise InputError(f"{name}: masks must have shape (frames, height, width), got {_described(stack)}")
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
        "landmarks": ((shape[0], len(JOINTS), 3), "f", f"be of shape {shape[0], len(JOINTS), 3}"),
        "fps": ((), "iuf", f"be a number up to {MAX_FPS:g}"),
    }
    for key, (wanted, kinds, expected) in others.items():
        stored = arrays.get(key)
        if stored is not None and (tuple(stored.shape) != wanted or stored.dtype.kind not in kinds):
            raise InputError(f"{name}: {key} must {expected}, got {_described(stored)}")
    return stack


def _described(stored: Stored | NDArray[Any]) -> str:
    return f"{quoted(tuple(stored.shape))} {stored.dtype}"


def _stack_classifier(name: str, stored: Stored | NDArray[Any], start: int, stop: int, label: int | None) -> Classifier:
    """Return how frames start to stop become masks; booleans need no count."""
    if stored.dtype.kind == "b" and label is None:
        return _above(0.0)
    counts = ValueCounts()
    for k, frame in enumerate(stored):
        if frame.dtype.kind == "f" and not np.isfinite(frame).all():
            raise InputError(f"{name}: masks must be finite, got nan or infinity in frame {k}")
        if start <= k < stop:
            counts.add(frame, soft=False)
    return counts.classifier(label, name)


def _pack(stored: Stored | NDArray[Any], start: int, stop: int, is_person: Classifier) -> Planes:
    """Return the bits of frames start to stop; the others are read to the end, for the checksum."""
    planes = empty_planes(stop - start, (stored.shape[2], stored.shape[1]))
    for k, frame in enumerate(stored):
        if start <= k < stop:
            planes[k - start] = np.packbits(is_person(frame))
    return planes


@dataclass(eq=False)
class ValueCounts:
    """Counts the values in the masks of a source, one mask after the other, and decides which are the person's."""

    soft: bool = False  # whether a value is a degree: in lossy images, in fractions, in an alpha channel
    highest: float = 0.0
    pixels: Counter[int] = field(default_factory=Counter)  # with each value, while these are few
    solid: Counter[int] = field(default_factory=Counter)  # masks in which a value is more than an edge between others

    def add(self, values: Values, soft: bool) -> None:
        """Count the next mask."""
        self.highest = max(self.highest, float(values.max()))
        self.soft |= soft or values.dtype.kind == "f"
        if self.soft:
            return
        if self.highest > 1:
            unique, counts = np.unique(values, return_counts=True)
        else:  # faster than sorting zeros and ones
            ones = int(np.count_nonzero(values))
            unique, counts = np.flatnonzero([values.size - ones, ones]), np.array([values.size - ones, ones])
            counts = counts[counts > 0]
        self.soft = len(unique) + len(self.pixels) > COUNTED_VALUES
        if self.soft:
            return
        self.pixels.update(dict(zip(unique.tolist(), counts.tolist(), strict=True)))
        if len(unique) > 1:
            self.solid.update(_solid(values, unique))

    def classifier(self, label: int | None, name: object) -> Classifier:
        """Return how these values become masks. Raises InputError where it is open which label is the person."""
        if label is not None:
            if self.soft:
                kinds = "masks whose values are labels, PNG or whole numbers"
                raise InputError(f"{name}: label must be given for {kinds}, got soft ones")
            if label not in self.pixels:
                there = self._listed([value for value, _ in self.pixels.most_common()])
                raise InputError(f"{name}: label must be one of those that are there, {there}, got {label}")
            return lambda values: np.asarray(values == label)
        values = sorted(self.pixels)
        if self.highest > SCALES[-1] and (self.soft or len(values) > FEW_VALUES):
            raise _many_colours(name)
        if self.soft or len(values) > FEW_VALUES:
            return _above(self._half)
        if len(values) <= 2:  # whichever two they are
            return _above(float(values[0] if len(values) == 2 else min(values[0], 0)) if values else 0.0)
        labels = [value for value, _ in self.solid.most_common() if value]
        if len(labels) > 1:
            raise InputError(
                f"{name}: expected masks of one person, got the labels {self._listed(labels)}; --label N chooses one"
            )
        return _above(float(labels[0] // 2) if labels else self._half)

    @property
    def _half(self) -> float:
        """The value half way to a whole person: 127 of 255, as whole numbers have no middle."""
        full = next((scale for scale in SCALES if self.highest <= scale), self.highest)
        return 0.5 if full == 1.0 else float(full // 2)

    def _listed(self, labels: list[int]) -> str:
        """Return some labels, the commonest first; colours as hexadecimal numbers."""
        written = [str(value) if self.highest <= SCALES[-1] else f"0x{value:06x}" for value in labels[:LISTED_LABELS]]
        others = len(labels) - LISTED_LABELS
        return ", ".join(written) + (f" and {others} others" if others > 0 else "")


def _above(threshold: float) -> Classifier:
    return lambda values: np.asarray(values > threshold)


def _many_colours(name: object) -> InputError:
    return InputError(f"{name}: expected masks, got pictures in many colours; a person cut out needs an alpha channel")


def _solid(values: Values, unique: NDArray[Any]) -> list[int]:
    """Return those values that fill 3 x 3 pixels somewhere: what lies between two others at an edge does not."""
    if len(unique) > FEW_VALUES:
        return []
    numbers = np.searchsorted(unique, values).astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    same = cv2.erode(numbers, kernel) == cv2.dilate(numbers, kernel)
    return [int(unique[k]) for k in np.unique(numbers[same])]
