"""Masks in memory, a bit a pixel, and what several cameras saw with them, frame by frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Observation
from posefit.geometry.calibration import Calibration
from posefit.geometry.skeleton import JOINTS
from posefit.limits import allowed_bytes
from posefit.silhouette.mask import Silhouette

ARRAYS = (".npz", ".npy")  # files of masks
Range = tuple[int | None, int | None]
# (T, bytes): of each frame the bits of its pixels, row by row
Planes = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class PackedMasks:
    """The masks of one camera: images and video are decoded to make it, and later stages unpack its bits."""

    names: Sequence[str] = field(repr=False)  # (T,) of the frames, for messages
    size: tuple[int, int]  # width and height
    masks: Planes = field(repr=False)
    # which pixels are known; None where all are
    valid: Planes | None = field(repr=False)
    # (T,) whether a frame shows enough of the person to be searched
    usable: NDArray[np.bool_] = field(repr=False)
    fps: float | None = None  # None where the source does not state it
    # (T, 27, 3), see `Segmenter`; None where there are none
    landmarks: Array | None = field(default=None, repr=False)
    first: int = 0  # the number of the first frame in the footage
    guesses: Sequence[str] = ()  # what the source does not state

    def __len__(self) -> int:
        return len(self.masks)

    def silhouette(self, k: int) -> Silhouette:
        """Return the silhouette of frame k."""
        valid = None if self.valid is None else unpacked(self.valid[k], self.size)
        return Silhouette.of(unpacked(self.masks[k], self.size), valid)


def unpacked(bits: NDArray[np.uint8], size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the mask (height, width) of a frame's bits."""
    width, height = size
    return (
        np.unpackbits(bits, count=width * height).reshape(height, width).view(np.bool_)
    )


def empty_planes(count: int, size: tuple[int, int]) -> Planes:
    """Return room for so many masks. Raises InputError where that is more memory than this process may have."""
    octets = (size[0] * size[1] + 7) // 8
    most = allowed_bytes()
    if count * octets > most:
        raise InputError(
            f"frames must be so few that their masks fit in {most / 1e9:.1f} GB of memory, "
            f"got {count} of {size[0]}x{size[1]} pixels"
        )
    return np.empty((count, octets), dtype=np.uint8)


def undistorted(
    masks: PackedMasks, calibration: Calibration, maps: tuple[Any, Any]
) -> PackedMasks:
    """Return masks, and landmarks, as of a pinhole camera; pixels that the lens did not cover are unknown.

    `maps` are those of the calibration for pictures of the masks' size.
    """
    straight = empty_planes(len(masks), masks.size)
    valid = empty_planes(len(masks), masks.size)
    for k in range(len(masks)):
        silhouette = masks.silhouette(k)
        for planes, plane in ((straight, silhouette.mask), (valid, silhouette.valid)):
            planes[k] = np.packbits(
                cv2.remap(plane.astype(np.uint8), *maps, cv2.INTER_NEAREST) != 0
            )
    bent = masks.landmarks
    landmarks = None if bent is None else calibration.straightened(bent, masks.size)
    return replace(masks, masks=straight, valid=valid, landmarks=landmarks)


@dataclass(frozen=True, eq=False)
class Views(Sequence[Observation]):
    """The observations of one camera or several that recorded the same frames.

    A frame is usable where one camera saw enough; the silhouette of a camera that did not is unknown then.
    """

    masks: Sequence[PackedMasks]
    # (T,) radians: about which way the person faces, NaN where unknown; empty where no frame's is known
    yaws: Array = field(default_factory=lambda: np.empty(0), repr=False)

    def __len__(self) -> int:
        return min(map(len, self.masks))

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < len(self):
            raise IndexError(k)
        silhouettes = [self._silhouette(masks, k) for masks in self.masks]
        usable = any(masks.usable[k] for masks in self.masks)
        known = k < len(self.yaws) and np.isfinite(self.yaws[k])
        landmarks = None
        if any(masks.landmarks is not None for masks in self.masks):
            unknown = np.zeros((len(JOINTS), 3))
            landmarks = np.array(
                [
                    unknown if view.landmarks is None else view.landmarks[k]
                    for view in self.masks
                ]
            )
        yaw = float(self.yaws[k]) if known else None
        return Observation(silhouettes, usable=usable, yaw=yaw, landmarks=landmarks)

    @cached_property
    def first(self) -> int:
        """The first frame usable in all cameras, or else in one. Raises InputError where there is none."""
        for enough in (all, any):
            for k in range(len(self)):
                if enough(masks.usable[k] for masks in self.masks):
                    return k
        raise InputError(
            f"{self.masks[0].names[0]}: expected a frame that is usable, got none from there on"
        )

    def _silhouette(self, masks: PackedMasks, k: int) -> Silhouette:
        silhouette = masks.silhouette(k)
        if len(self.masks) > 1 and not masks.usable[k]:
            return Silhouette.of(silhouette.mask, np.zeros_like(silhouette.mask))
        return silhouette


def span(frames: Range, count: int) -> tuple[int, int]:
    """Return start and stop of a range of `count` frames. Raises InputError where it holds none."""
    start, stop, _ = slice(*frames).indices(count)
    if start >= stop:
        low, high = ("" if value is None else value for value in frames)
        raise InputError(
            f"frames must choose some of the {count} frames, got {low}:{high}"
        )
    return start, stop
