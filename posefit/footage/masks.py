"""Masks that are read when their turn comes, so that memory does not grow with their number."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Observation
from posefit.footage.given.values import Palette, Reading, many_colours
from posefit.silhouette.mask import Mask, Silhouette

DIGITS = 1_000  # of a number in a name
FPS = 30.0  # of motions and masks, where nobody says
IMAGES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
Range = tuple[int | None, int | None]


class Masks(Protocol):
    """What one camera saw of a person, frame by frame."""

    def __len__(self) -> int:
        """How many frames there are."""
        ...

    def is_usable(self, k: int) -> bool:
        """Return whether frame k shows enough of the person to be searched."""
        ...

    def silhouette(self, k: int) -> Silhouette:
        """Return the silhouette of frame k. Raises ValueError naming the frame where there is none."""
        ...

    def label(self, k: int) -> str:
        """Return what to call frame k in a message."""
        ...


@dataclass(frozen=True, eq=False)
class FolderMasks:
    """The masks of a folder of images, each read when its turn comes."""

    files: Sequence[Path]
    reading: Reading  # of their values
    labelled: bool
    fps: float | None = None  # a folder does not say it

    @classmethod
    def of(cls, path: Path, frames: Range, label: int | None = None) -> "FolderMasks":
        """Return the masks of a folder, in the order of their names, cut to `frames`: 2 comes before 10.

        Raises ValueError naming the file where one is no image, or of another size than the first.
        """
        from posefit.footage.images import is_colourful

        # a hidden file is none of them: some systems put one beside each image that they copy
        files = (file for file in path.iterdir() if file.suffix.lower() in IMAGES and not file.name.startswith("."))
        found = sorted(files, key=_natural)
        if not found:
            raise ValueError(f"{path}: expected a folder with mask images ({', '.join(IMAGES)}), got none")
        chosen = found[slice(*span(frames, len(found)))]
        if is_colourful(chosen[0]):
            raise many_colours(path)
        palette, shape = Palette(), None
        for file in chosen:
            values, soft = _values(file, label is not None)
            shape = values.shape if shape is None else shape
            if values.shape != shape:
                raise ValueError(f"{file}: mask must have shape {shape}, got {values.shape}")
            palette.add(values, soft)
        return cls(chosen, palette.reading(label, path), label is not None)

    def __len__(self) -> int:
        return len(self.files)

    def is_usable(self, k: int) -> bool:
        """Return that there is a mask k: that too little of the person is seen, a folder cannot say."""
        return k < len(self)

    def label(self, k: int) -> str:
        """Return the file of mask k."""
        return str(self.files[k])

    def silhouette(self, k: int) -> Silhouette:
        """Return mask k. Raises ValueError naming the file where it is no image."""
        return Silhouette.of(self.reading.person(_values(self.files[k], self.labelled)[0]))


def _values(file: Path, labelled: bool) -> tuple[NDArray[Any], bool]:
    from posefit.footage.images import FORMATS, read_values

    found = read_values(file, labelled)
    if found is None:
        raise ValueError(f"{file}: expected an image ({FORMATS}), got a file that is none")
    return found


def _natural(file: Path) -> tuple[Sequence[tuple[int, str]], str]:
    """Return what files are sorted by: numbers in their names count as such."""
    parts = re.findall(r"[0-9]+|[^0-9]+", file.name)
    return [(int(part), "") if part.isdigit() and len(part) < DIGITS else (-1, part) for part in parts], file.name


class PackedMasks:
    """Masks and what is known of them in two files of bits, eight pixels a byte, which stay on the disk."""

    def __init__(self, folder: Path, size: tuple[int, int], usable: NDArray[np.bool_], name: str, start: int) -> None:
        self._size, self._usable, self._name, self._start = size, usable, name, start
        self._stride = (size[0] * size[1] + 7) // 8
        self._files = [folder / f"{kind}.bits" for kind in KINDS]

    def __len__(self) -> int:
        return len(self._usable)

    def is_usable(self, k: int) -> bool:
        """Return whether frame k shows enough of the person to be searched."""
        return bool(self._usable[k])

    def label(self, k: int) -> str:
        """Return the video and its frame."""
        return f"{self._name}, frame {self._start + k}"

    def silhouette(self, k: int) -> Silhouette:
        """Return the silhouette of frame k."""
        width, height = self._size
        planes = []
        for file in self._files:
            packed = np.fromfile(file, np.uint8, self._stride, offset=k * self._stride)
            planes.append(np.unpackbits(packed, count=width * height).reshape(height, width))
        return Silhouette.of(*planes)


KINDS = ("masks", "valid")


def packed(mask: Mask) -> bytes:
    """Return a mask as `PackedMasks` reads it."""
    return np.packbits(mask).tobytes()


@dataclass(frozen=True, eq=False)
class Straight:
    """Masks whose lens distortion is undone; what the lens did not see is unknown."""

    masks: Masks
    maps: tuple[Any, Any] = field(repr=False)

    def __len__(self) -> int:
        return len(self.masks)

    def is_usable(self, k: int) -> bool:
        """Return whether frame k shows enough of the person to be searched."""
        return self.masks.is_usable(k)

    def label(self, k: int) -> str:
        """Return what to call frame k."""
        return self.masks.label(k)

    def silhouette(self, k: int) -> Silhouette:
        """Return the silhouette of frame k as a pinhole camera would have seen it."""
        import cv2

        bent = self.masks.silhouette(k)
        mask, valid = (
            cv2.remap(plane.astype(np.uint8), *self.maps, cv2.INTER_NEAREST) for plane in (bent.mask, bent.valid)
        )
        return Silhouette.of(mask, valid)


@dataclass(frozen=True, eq=False)
class Views(Sequence[Observation]):
    """What several cameras saw at the same times. A camera that saw too little in a frame counts for nothing there."""

    masks: Sequence[Masks]
    # radians (T,): about which way he faces; nan where nobody knows, and none where nobody says
    yaws: Array = field(default_factory=lambda: np.empty(0), repr=False)

    def __len__(self) -> int:
        return min(map(len, self.masks))

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < len(self):
            raise IndexError(k)
        silhouettes = [self._silhouette(v, k) for v in range(len(self.masks))]
        return Observation(silhouettes, usable=self.is_usable(k), yaw=self.yaw(k))

    def __iter__(self) -> Iterator[Observation]:
        return (self[k] for k in range(len(self)))

    def yaw(self, k: int) -> float | None:
        """Return about which way the person faces in frame k, in radians; None where nobody knows."""
        return float(self.yaws[k]) if k < len(self.yaws) and np.isfinite(self.yaws[k]) else None

    def is_usable(self, k: int) -> bool:
        """Return whether a camera saw enough in frame k."""
        return any(masks.is_usable(k) for masks in self.masks)

    @cached_property
    def first(self) -> int:
        """The first frame that all cameras, or else some, find usable. Raises ValueError where there is none."""
        for enough in (all, any):
            for k in range(len(self)):
                if enough(masks.is_usable(k) for masks in self.masks):
                    return k
        raise ValueError(f"{self.masks[0].label(0)}: expected a frame that is usable, got none from there on")

    @cached_property
    def sizes(self) -> list[tuple[int, int]]:
        """Width and height of each camera's masks."""
        return [masks.silhouette(self.first).size for masks in self.masks]

    def _silhouette(self, view: int, k: int) -> Silhouette:
        masks = self.masks[view]
        silhouette = masks.silhouette(k)
        if len(self.masks) > 1 and not masks.is_usable(k):
            return Silhouette.of(silhouette.mask, np.zeros_like(silhouette.mask))
        return silhouette


def span(frames: Range, count: int) -> tuple[int, int]:
    """Return start and stop of some of `count` frames. Raises ValueError where that is none."""
    start, stop, _ = slice(*frames).indices(count)
    if start >= stop:
        low, high = ("" if value is None else value for value in frames)
        raise ValueError(f"frames must choose some of the {count} frames, got {low}:{high}")
    return start, stop


def existing(path: Path) -> Path:
    """Return a path. Raises ValueError where there is nothing, or an empty file."""
    if not path.exists():
        expected = "a file" if path.suffix else "a file or a folder"
        raise ValueError(f"{path}: expected {expected}, got nothing of that name")
    if path.is_file() and not path.stat().st_size:
        raise ValueError(f"{path}: expected a file with content, got an empty one")
    return path
