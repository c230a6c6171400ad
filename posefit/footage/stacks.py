"""The masks of an .npz file: unpacked frame by frame, and kept as bits, eight pixels a byte."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.archive import Stored, archived
from posefit.footage.given.values import Palette, Reading
from posefit.footage.masks import Range, existing, span
from posefit.reading import quoted
from posefit.silhouette.mask import Silhouette

PACKED = 2_000_000_000  # bytes of a file
UNPACKED = 6_000_000_000  # bytes that its arrays unpack to; in memory they are an eighth of that
FASTEST = 1000.0  # frames a second
NAMES = ("masks", "valid", "usable", "fps")

KNOWN = Reading()  # of what is 0 or not

Planes = NDArray[np.uint8]  # (T, bytes of a frame)


@dataclass(frozen=True, eq=False)
class StackMasks:
    """The masks of an .npz file."""

    path: Path
    start: int  # of the frames that were chosen, in the file
    size: tuple[int, int]  # width and height
    masks: Planes = field(repr=False)
    known: Planes | None = field(default=None, repr=False)  # where anything is known
    usable: NDArray[np.bool_] | None = field(default=None, repr=False)  # (T,)
    fps: float | None = None  # where the file says it

    @classmethod
    def of(cls, path: Path, frames: Range, label: int | None = None) -> "StackMasks":
        """Return the masks of an .npz file, cut to `frames`. Raises ValueError naming the file where it is none."""
        existing(path)
        with archived(path, NAMES, "the key masks", UNPACKED, PACKED) as found:
            if "masks" not in found:
                raise ValueError(f"{path}: expected an .npz file with the key masks, got none")
            stack, known = found["masks"], found.get("valid")
            _check_shapes(path, stack, known)
            usable, fps = _usable(path, found.get("usable"), stack.shape[0]), _fps(path, found.get("fps"))
            start, stop = span(frames, stack.shape[0])
            if usable is not None and not usable[start:stop].any():
                raise ValueError(f"{path}: expected a frame that is usable, got none from {start} to {stop}")
            masks = _packed(stack, start, stop, _reading(path, stack, start, stop, label))
            valid = None if known is None else _packed(known, start, stop, KNOWN)
        size = stack.shape[2], stack.shape[1]
        return cls(path, start, size, masks, valid, None if usable is None else usable[start:stop], fps)

    def __len__(self) -> int:
        return len(self.masks)

    def is_usable(self, k: int) -> bool:
        """Return whether mask k shows enough of the person to be searched; masks that do not say so do."""
        return self.usable is None or bool(self.usable[k])

    def label(self, k: int) -> str:
        """Return the place of mask k in the file."""
        return f"{self.path}[{self.start + k}]"

    def silhouette(self, k: int) -> Silhouette:
        """Return mask k."""
        return Silhouette.of(self._plane(self.masks, k), None if self.known is None else self._plane(self.known, k))

    def _plane(self, planes: Planes, k: int) -> NDArray[np.bool_]:
        width, height = self.size
        return np.unpackbits(planes[k], count=width * height).reshape(height, width).view(np.bool_)


def _check_shapes(path: Path, stack: Stored, known: Stored | None) -> None:
    if len(stack.shape) != 3 or 0 in stack.shape or stack.dtype.kind not in "buif":
        came = f"{_shape(stack.shape)} {stack.dtype}"
        raise ValueError(f"{path}: masks must have shape (frames, height, width), got {came}")
    if known is not None and (known.shape != stack.shape or known.dtype.kind not in "bui"):
        came = f"{_shape(known.shape)} {known.dtype}"
        raise ValueError(f"{path}: valid must have the masks' shape {_shape(stack.shape)}, got {came}")


def _shape(shape: Sequence[int]) -> str:
    return quoted(tuple(shape))


def _reading(path: Path, stored: Stored, start: int, stop: int, label: int | None) -> Reading:
    """Return how frames start to stop are read; what is true or false needs no look."""
    if stored.dtype.kind == "b" and label is None:
        return KNOWN
    palette = Palette()
    for k, frame in enumerate(stored.rows()):
        _check_finite(path, k, frame)
        if start <= k < stop:
            palette.add(frame, soft=False)
    return palette.reading(label, path)


def _check_finite(path: Path, k: int, frame: NDArray[Any]) -> None:
    if frame.dtype.kind == "f" and not np.isfinite(frame).all():
        raise ValueError(f"{path}: masks must be finite, got nan or infinity in frame {k}")


def _packed(stored: Stored, start: int, stop: int, reading: Reading) -> Planes:
    """Return the bits of frames start to stop; of the others nothing is kept, but they are read to the end."""
    height, width = stored.shape[1:]
    planes = np.empty((stop - start, (height * width + 7) // 8), dtype=np.uint8)
    for k, frame in enumerate(stored.rows()):
        if start <= k < stop:
            planes[k - start] = np.packbits(reading.person(frame))
    return planes


def _usable(path: Path, stored: Stored | None, count: int) -> NDArray[np.bool_] | None:
    if stored is None:
        return None
    if stored.shape != (count,) or stored.dtype != np.bool_:
        raise ValueError(f"{path}: usable must be {count} booleans, got {_shape(stored.shape)} {stored.dtype}")
    return np.asarray(stored.read(), dtype=np.bool_)


def _fps(path: Path, stored: Stored | None) -> float | None:
    if stored is None:
        return None
    number: Any = stored.read() if stored.shape == () and stored.dtype.kind in "iuf" else None
    if number is None or not 0.0 < number <= FASTEST:
        came = number.tolist() if number is not None else f"{_shape(stored.shape)} {stored.dtype}"
        raise ValueError(f"{path}: fps must be a number up to 1000, got {came}")
    return float(number)
