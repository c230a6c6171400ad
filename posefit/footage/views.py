"""What one camera saw: every reader makes a `View`, and everything after takes it.

from posefit.footage.source import resolve, views_of

(view,) = views_of(resolve("masks.npz"))
print(view.numbers[view.usable], view.silhouette(0).mask.shape)
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
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
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask, Silhouette

MOST = 0.5  # a larger share of something is most of it
Range = tuple[int | None, int | None]
# (T, bytes): of each frame the bits of its pixels, row by row; bits after the last are 0
Planes = NDArray[np.uint8]
# bytes of the masks that are kept as they were decoded; those of a short film
DECODED_BYTES = 64_000_000


@dataclass(frozen=True, eq=False)
class View:
    """What one camera saw, a bit a pixel, however it came. Its arrays are read-only.

    `replace` and the functions below return other views; nothing changes one.
    """

    name: str  # of the source
    numbers: NDArray[np.int64]  # (T,) of the frames, as filmed
    times: Array  # (T,) seconds, as filmed
    bits: Planes = field(repr=False)  # the person
    known: Planes | None = field(repr=False)  # which pixels are; None where all are
    # (T,) whether a frame shows enough of the person to be searched
    usable: NDArray[np.bool_] = field(repr=False)
    size: tuple[int, int]  # width and height
    fps: float | None = None  # None where the source does not state it
    # whether the source states its frames' numbers; else they are counted from 0
    counted: bool = False
    # width and height of the pictures, where the masks were taken out of some
    filmed: tuple[int, int] | None = None
    # (T, 27, 3), see `Segmenter`; None where there are none
    landmarks: Array | None = field(default=None, repr=False)
    # (T,) as `Segmenter.facing`, NaN where unknown or going along; None where all are
    facings: Array | None = field(default=None, repr=False)
    moves: bool = False  # whether the camera seems to
    doubt: str = ""  # what is wrong with the masks, if anything
    warnings: Sequence[str] = ()  # what a user should check before they trust the masks
    guesses: Sequence[str] = ()  # what the source does not state
    # yields the pictures, of the masks' size; None where the source is of masks
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Make the arrays read-only: who wrote into one would change what others decode."""
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: slice) -> "View":
        """Return the view of some frames, by their places."""
        cut: dict[str, Any] = {
            name: value[rows]
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray)
        }
        return replace(self, **cut)

    def silhouette(self, k: int) -> Silhouette:
        """Return the silhouette of the frame at place k, which is decoded for it."""
        known = None if self.known is None else unpacked(self.known[k], self.size)
        return Silhouette.of(unpacked(self.bits[k], self.size), known)

    @property
    def shows(self) -> NDArray[np.bool_]:
        """Whether each frame (T,) shows a person before a background, by its bits."""
        known = full_planes(1, self.size) if self.known is None else self.known
        bits = self.bits & known
        return np.asarray(bits.any(axis=1) & (bits != known).any(axis=1))


def joined(views: Sequence[View]) -> View:
    """Return the view of successive frames, each of which is a view."""
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(view, name) for view in views])
        for name, value in vars(views[0]).items()
        if isinstance(value, np.ndarray)
    }
    return replace(views[0], **arrays, pictures=None)


def times_of(numbers: NDArray[np.int64], fps: float | None) -> Array:
    """Return when frames come (T,), in seconds, at a rate; where it is unknown 30 a second."""
    return np.asarray(numbers / (fps or FPS))


def unpacked(bits: NDArray[np.uint8], size: tuple[int, int]) -> Mask:
    """Return the mask (height, width) of a frame's bits."""
    width, height = size
    return (
        np.unpackbits(bits, count=width * height).reshape(height, width).view(np.bool_)
    )


def border_of(planes: Planes, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the pixels (T, n) along the border of masks, of which nothing else is decoded."""
    width, height = size
    places = np.arange(width * height).reshape(height, width)
    places = np.concatenate([places[[0, -1]].ravel(), places[:, [0, -1]].ravel()])
    return np.asarray(planes[:, places >> 3] >> (7 - (places & 7)) & 1 > 0)


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


def full_planes(count: int, size: tuple[int, int]) -> Planes:
    """Return so many masks that cover the picture."""
    planes = empty_planes(count, size)
    planes[:] = np.packbits(np.ones(size[0] * size[1], dtype=bool))
    return planes


def undistorted(
    view: View,
    calibration: Calibration,
    maps: tuple[Any, Any],
    straight: Camera | None = None,
) -> View:
    """Return a view, and its landmarks, as of a pinhole camera; pixels that the lens did not cover are unknown.

    Args:
        view: Of the camera that was calibrated.
        calibration: That camera's.
        maps: The calibration's, for pictures of the view's size and for `straight`.
        straight: The pinhole camera; by default the calibration's, of the view's size.

    Returns:
        A view of the size of `maps`.

    """
    size = (maps[0].shape[1], maps[0].shape[0])
    bits = empty_planes(len(view), size)
    known = empty_planes(len(view), size)
    for k in range(len(view)):
        silhouette = view.silhouette(k)
        # between four pixels the border is where half of them is the person
        share = cv2.remap(
            255 * silhouette.mask.astype(np.uint8), *maps, cv2.INTER_LINEAR
        )
        covered = cv2.remap(silhouette.valid.astype(np.uint8), *maps, cv2.INTER_NEAREST)
        bits[k] = np.packbits(share > 127)
        known[k] = np.packbits(covered != 0)
    landmarks = view.landmarks
    if landmarks is not None:
        landmarks = calibration.straightened(landmarks, view.size, straight)
    return replace(view, size=size, bits=bits, known=known, landmarks=landmarks)


class Observations(Sequence[Observation]):
    """The observations of views of the same frames, whose masks are decoded when they are searched first.

    A frame is usable where one camera saw enough; the silhouette of a camera that did not is unknown then. `yaws` (T,)
    are radians: about which way the person faces, NaN where unknown; empty where no frame's is known.
    """

    def __init__(self, views: Sequence[View], yaws: Array | None = None) -> None:
        self.views = views
        self.yaws = np.empty(0) if yaws is None else yaws
        self._count = min(map(len, views))
        self.usable = np.any([view.usable[: self._count] for view in views], axis=0)
        pixels = sum(view.size[0] * view.size[1] for view in views)
        # of a silhouette: two arrays of bytes, and two of bits
        self._most = max(DECODED_BYTES // int(2.25 * pixels), 1)
        self._decoded = OrderedDict[int, list[Silhouette]]()

    def __reduce__(self) -> Any:
        return Observations, (self.views, self.yaws)

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < len(self):
            raise IndexError(k)
        known = k < len(self.yaws) and np.isfinite(self.yaws[k])
        landmarks = None
        if any(view.landmarks is not None for view in self.views):
            unknown = np.zeros((len(JOINTS), 3))
            landmarks = np.array(
                [
                    unknown if view.landmarks is None else view.landmarks[k]
                    for view in self.views
                ]
            )
        yaw = float(self.yaws[k]) if known else None
        return Observation(
            _Silhouettes(self, k),
            usable=bool(self.usable[k]),
            yaw=yaw,
            landmarks=landmarks,
        )

    @property
    def first(self) -> int:
        """The first frame usable in all cameras, or else in one. Raises InputError where there is none."""
        usable = np.array([view.usable[: len(self)] for view in self.views])
        for enough in (usable.all(axis=0), usable.any(axis=0)):
            if enough.any():
                return int(enough.argmax())
        view = self.views[0]
        raise InputError(
            f"{view.name}, frame {view.numbers[0]}: expected a frame that is usable, got none from there on"
        )

    def silhouettes(self, k: int) -> list[Silhouette]:
        """Return the silhouettes of the frame at place k, one a view. Those that were used last are kept."""
        kept = self._decoded.pop(k, None)
        if kept is None:
            kept = [self._silhouette(view, k) for view in self.views]
        self._decoded[k] = kept
        while len(self._decoded) > self._most:
            self._decoded.popitem(last=False)
        return kept

    def _silhouette(self, view: View, k: int) -> Silhouette:
        if len(self.views) > 1 and not view.usable[k]:
            unknown = np.zeros(view.size[::-1], dtype=bool)
            return Silhouette.of(unknown, unknown)
        return view.silhouette(k)


class _Silhouettes(Sequence[Silhouette]):
    """The silhouettes of one frame, decoded when they are used: whether it is usable needs none of them."""

    def __init__(self, observations: Observations, k: int) -> None:
        self._observations = observations
        self._k = k

    def __reduce__(self) -> Any:
        return list, ([*self],)

    def __len__(self) -> int:
        return len(self._observations.views)

    def __getitem__(self, number):  # type: ignore[no-untyped-def]
        return self._observations.silhouettes(self._k)[number]


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
