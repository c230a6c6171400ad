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
from posefit.geometry.camera import Camera
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
    # whether the source states its frames' numbers; else they are counted from 0
    counted: bool = False
    guesses: Sequence[str] = ()  # what the source does not state

    def __len__(self) -> int:
        return len(self.masks)

    def cut(self, start: int, stop: int) -> "PackedMasks":
        """Return the masks of frames start to stop, by their numbers in the footage."""
        rows = slice(start - self.first, stop - self.first)
        return replace(
            self,
            names=self.names[rows],
            masks=self.masks[rows],
            valid=None if self.valid is None else self.valid[rows],
            usable=self.usable[rows],
            landmarks=None if self.landmarks is None else self.landmarks[rows],
            first=start,
        )

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
    masks: PackedMasks,
    calibration: Calibration,
    maps: tuple[Any, Any],
    straight: Camera | None = None,
) -> PackedMasks:
    """Return masks, and landmarks, as of a pinhole camera; pixels that the lens did not cover are unknown.

    Args:
        masks: Of the camera that was calibrated.
        calibration: That camera's.
        maps: The calibration's, for pictures of the masks' size and for `straight`.
        straight: The pinhole camera; by default the calibration's, of the masks' size.

    Returns:
        Masks of the size of `maps`.

    """
    size = (maps[0].shape[1], maps[0].shape[0])
    mended = empty_planes(len(masks), size)
    valid = empty_planes(len(masks), size)
    for k in range(len(masks)):
        silhouette = masks.silhouette(k)
        # between four pixels the border is where half of them is the person
        share = cv2.remap(
            255 * silhouette.mask.astype(np.uint8), *maps, cv2.INTER_LINEAR
        )
        known = cv2.remap(silhouette.valid.astype(np.uint8), *maps, cv2.INTER_NEAREST)
        mended[k] = np.packbits(share > 127)
        valid[k] = np.packbits(known != 0)
    landmarks = masks.landmarks
    if landmarks is not None:
        landmarks = calibration.straightened(landmarks, masks.size, straight)
    return replace(masks, size=size, masks=mended, valid=valid, landmarks=landmarks)


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


def together(views: Sequence[PackedMasks], names: Sequence[str]) -> list[PackedMasks]:
    """Return the masks of several cameras, cut to the frames whose numbers all of them have, where they state numbers.

    Raises InputError where they have none in common, and where only some state that theirs begin elsewhere.
    """
    if not all(view.counted for view in views):
        firsts = [view.first for view in views]
        if len(set(firsts)) > 1:
            came = " and ".join(
                f"{first} of {name}" for first, name in zip(firsts, names, strict=True)
            )
            raise InputError(f"cameras must begin with one frame, got frame {came}")
        return list(views)
    ends = [(view.first, view.first + len(view)) for view in views]
    start = max(first for first, _ in ends)
    stop = min(last for _, last in ends)
    came = ", ".join(
        f"{first}:{last} of {name}"
        for (first, last), name in zip(ends, names, strict=True)
    )
    if start >= stop:
        raise InputError(f"cameras must have frames in common, got {came}")
    if len(set(ends)) > 1:
        used = f"the frames {start}:{stop} are used, which all cameras have, of {came}"
        first = replace(views[0], guesses=[*views[0].guesses, used])
        views = [first, *views[1:]]
    return [view.cut(start, stop) for view in views]


def span(frames: Range, count: int, first: int = 0) -> tuple[int, int]:
    """Return start and stop of a range of `count` frames, whose numbers begin at `first`, as indices.

    Negative ends count from the last frame. Raises InputError where the range holds none.
    """
    ends = [
        None if end is None else end if end < 0 else max(end - first, 0)
        for end in frames
    ]
    start, stop, _ = slice(*ends).indices(count)
    if start >= stop:
        low, high = ("" if value is None else value for value in frames)
        numbers = f" {first}:{first + count}" if first else ""
        raise InputError(
            f"frames must choose some of the {count} frames{numbers}, got {low}:{high}"
        )
    return start, stop
