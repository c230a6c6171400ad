"""The `View`: what one camera saw. Readers return one, and later steps take one.

from posefit.footage.kinds import resolve
from posefit.footage.source import views_of_masks

(view,) = views_of_masks(resolve("masks.npz"))
print(view.numbers[view.usable], view.silhouette(0).mask.shape)
"""

import mmap
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from tempfile import TemporaryFile
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.limits import allowed_bytes
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask, Silhouette

# a majority: tests of "most frames" or "most pixels" all compare with this share
MOST = 0.5
# first and last frame, as in a slice
Range = tuple[int | None, int | None]
# (T, bytes): the pixels of each frame as bits, row by row; unused bits at the end are 0
Planes = NDArray[np.uint8]
# masks of one camera that are held in memory
PLANES_BYTES = 128_000_000
READ_AROUND = 65_536  # bytes before and after a page that Linux maps with it
# the fields of a `View` with one row per frame; some may be None
PER_FRAME = ("numbers", "times", "bits", "known", "usable", "landmarks", "facings")


@dataclass(frozen=True, eq=False)
class View:
    """What one camera saw: the masks of its frames, one bit per pixel.

    A view is immutable and its arrays are read-only. `dataclasses.replace` and the
    functions below return new views.
    """

    name: str  # name of the source, for messages
    numbers: NDArray[np.int64]  # (T,) frame numbers, as filmed
    # (T,) seconds since frame 0 at an even rate; of a stream, when each frame came, by
    # the clock of `time.perf_counter`
    times: Array
    bits: Planes = field(repr=False)  # pixels that show the person
    # pixels that are known to be person or background; None if all are
    known: Planes | None = field(repr=False)
    # (T,) whether a frame shows enough of the person to be searched
    usable: NDArray[np.bool_] = field(repr=False)
    size: tuple[int, int]  # width and height
    fps: float | None = None  # None if the source does not state it
    # whether the source states its frame numbers; if not, they are counted from 0
    states_numbers: bool = False
    # width and height of the film, if the masks were segmented from one
    filmed: tuple[int, int] | None = None
    # (T, 27, 3) as `Segmenter.landmarks`; None if the segmenter reports none
    landmarks: Array | None = field(default=None, repr=False)
    # (T,) as `Segmenter.facing`, NaN if unknown or if the person walks across the
    # picture; None if all are unknown
    facings: Array | None = field(default=None, repr=False)
    moves: bool = False  # whether the camera seems to move
    doubt: str = ""  # what is wrong with the masks, if anything
    warnings: Sequence[str] = ()  # what a user should check before trusting the masks
    guesses: Sequence[str] = ()  # what the source does not state and posefit assumes
    # yields the pictures, at the masks' size; None if the source contains masks only
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Make the arrays read-only, because several views share them."""
        for name in PER_FRAME:
            value = getattr(self, name)
            if value is not None:
                value.flags.writeable = False

    def __len__(self) -> int:
        return len(self.numbers)

    def __getitem__(self, rows: slice) -> "View":
        """Return the view of a slice of its frames, counted from 0."""
        cut: dict[str, Any] = {}
        for name in PER_FRAME:
            value = getattr(self, name)
            cut[name] = None if value is None else value[rows]
        return replace(self, **cut)

    def silhouette(self, k: int) -> Silhouette:
        """Decode and return the silhouette of frame k, counted from 0."""
        known = None
        if self.known is not None:
            every = np.packbits(np.ones(self.size[0] * self.size[1], dtype=bool))
            # None if all pixels are known: silhouettes then share one array
            if not np.array_equal(self.known[k], every):
                known = unpacked(self.known[k], self.size)
            release(self.known, k)
        mask = unpacked(self.bits[k], self.size)
        release(self.bits, k)
        return Silhouette.of(mask, known)

    def masks(self) -> Iterator[Mask]:
        """Decode and yield the mask of each frame."""
        for k, bits in enumerate(self.bits):
            mask = unpacked(bits, self.size)
            release(self.bits, k)
            yield mask

    @property
    def shows(self) -> NDArray[np.bool_]:
        """Whether each frame (T,) has both person and background pixels."""
        every = full_planes(1, self.size)[0]
        shows = np.empty(len(self), dtype=bool)
        # frame by frame, because all planes of a long film need much memory
        for k, frame in enumerate(self.bits):
            known = every if self.known is None else self.known[k]
            bits = frame & known
            shows[k] = bits.any() and (bits != known).any()
            release(self.bits, k)
            if self.known is not None:
                release(self.known, k)
        return shows


def concatenated(views: Sequence[View]) -> View:
    """Return one view of all frames of several views, in order, without pictures.

    What some of the views do not know is None in the result, except for `known`.
    """
    if any(view.known is not None for view in views):
        views = [_with_known(view) for view in views]
    rows: dict[str, Any] = {}
    for name in PER_FRAME:
        values = [getattr(view, name) for view in views]
        rows[name] = None
        if all(value is not None for value in values):
            rows[name] = np.concatenate(values)
    return replace(views[0], **rows, pictures=None)


def _with_known(view: View) -> View:
    """Return a view that states which pixels are known."""
    if view.known is not None:
        return view
    return replace(view, known=full_planes(len(view), view.size))


def with_common_frames(views: Sequence[View]) -> list[View]:
    """Cut the views of several cameras to the frames that all of them have.

    Frames are compared by their numbers, if all cameras state them.

    Raises:
        InputError: The cameras have no frame in common, or they begin at different
            frames and not all of them state numbers.
    """
    starts = [int(view.numbers[0]) for view in views]
    stops = [int(view.numbers[-1]) + 1 for view in views]
    names = [view.name for view in views]
    if not all(view.states_numbers for view in views):
        if len(set(starts)) > 1:
            each = zip(starts, names, strict=True)
            came = " and ".join(f"{first} of {name}" for first, name in each)
            raise InputError(
                f"all cameras must begin with the same frame, got frame {came}"
            )
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


def times_of(numbers: NDArray[np.int64], fps: float | None) -> Array:
    """Return the times (T,) of frames in seconds, at 30 per second if `fps` is None."""
    return np.asarray(numbers / (fps or FPS))


def unpacked(bits: NDArray[np.uint8], size: tuple[int, int]) -> Mask:
    """Return the mask (height, width) of a frame's bits."""
    width, height = size
    pixels = np.unpackbits(bits, count=width * height)
    return pixels.reshape(height, width).view(np.bool_)


def border_of(planes: Planes, size: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the pixels (T, n) along the border of masks, without decoding the rest."""
    width, height = size
    places = np.arange(width * height).reshape(height, width)
    border = np.concatenate([places[[0, -1]].ravel(), places[:, [0, -1]].ravel()])
    octets = planes[:, border >> 3]  # (T, n): the byte that contains each pixel
    # `packbits` stores the first pixel in the highest bit
    shift = (7 - (border & 7)).astype(np.uint8)
    return np.asarray(octets >> shift & 1 > 0)


def empty_planes(count: int, size: tuple[int, int]) -> Planes:
    """Return uninitialised planes for `count` masks.

    More than `PLANES_BYTES` are in a temporary file without a name. Call `release`
    after reading or writing a frame of them.

    Raises:
        InputError: The planes need more memory than this process may use.
    """
    octets = (size[0] * size[1] + 7) // 8
    most = allowed_bytes()
    if count * octets > most:
        raise InputError(
            f"the masks must fit in {most / 1e9:.1f} GB of memory, got {count} frames "
            f"of {size[0]}x{size[1]} pixels: choose fewer with --frames"
        )
    if count * octets <= PLANES_BYTES:
        return np.empty((count, octets), dtype=np.uint8)
    try:
        with TemporaryFile() as file:
            # a file with holes would end the process once the disk is full
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(file.fileno(), 0, count * octets)
            return np.memmap(file, np.uint8, "r+", shape=(count, octets))
    except OSError:  # without a disk that has room, memory has to do
        return np.empty((count, octets), dtype=np.uint8)


def release(planes: Planes, k: int, count: int = 1) -> None:
    """Take some planes from frame k on out of memory if they are in a file.

    Otherwise all planes that were ever read or written would count as memory of this
    process. Nothing is lost, and the operating system keeps what it has room for.
    """
    mapped = getattr(planes, "_mmap", None)
    if mapped is None or not hasattr(mmap, "MADV_DONTNEED"):
        return
    # a slice of planes begins later in the file than the planes
    before = np.frombuffer(mapped, np.uint8, 1).ctypes.data
    start = planes[k].ctypes.data - before
    # reading one page maps its neighbours, too
    first = max(start - READ_AROUND, 0) // mmap.PAGESIZE * mmap.PAGESIZE
    last = min(start + count * planes.shape[1] + READ_AROUND, len(mapped))
    mapped.madvise(mmap.MADV_DONTNEED, first, last - first)


def full_planes(count: int, size: tuple[int, int]) -> Planes:
    """Return planes of `count` masks in which every pixel is set."""
    planes = empty_planes(count, size)
    every = np.packbits(np.ones(size[0] * size[1], dtype=bool))
    for k in range(count):
        planes[k] = every
        release(planes, k)
    return planes


def check_some(name: str, there: NDArray[np.bool_], start: int) -> None:
    """Raise InputError if none of the chosen images (T,) is there."""
    if not there.any():
        raise InputError(
            f"{name}: frames must contain an image, "
            f"got none from {start} to {start + len(there)}"
        )


def known_planes(there: NDArray[np.bool_], size: tuple[int, int]) -> Planes | None:
    """Return planes that are unknown where an image (T,) is missing, else known.

    None if no image is missing.
    """
    if there.all():
        return None
    known = full_planes(len(there), size)
    known[~there] = 0
    return known


def range_warning(frames: Range, first: int, count: int) -> str:
    """Return a message if a range names frames that a source does not have, else "".

    Args:
        frames: The range, as for `span`.
        first: Number of the first frame that is used.
        count: How many frames are used.
    """
    start, stop = frames
    early = start is not None and 0 <= start < first
    late = stop is not None and stop > first + count
    if not (early or late):
        return ""
    return (
        f"frames {_range_text(frames)} were chosen, and {first}:{first + count} are "
        "used: there are no others"
    )


def _range_text(frames: Range) -> str:
    """Return a range as a user writes it, such as 10: or 0:50."""
    start, stop = ("" if end is None else end for end in frames)
    return f"{start}:{stop}"


def span(frames: Range, count: int, first: int = 0) -> tuple[int, int]:
    """Return the indices (start, stop) of a range of frame numbers.

    Args:
        frames: First number and the number after the last. Negative ones count from the
            end; None means the first or the last frame.
        count: How many frames there are.
        first: Number of the first frame.

    Raises:
        InputError: The range contains no frame.
    """
    ends = list[int | None]()
    for end in frames:
        if end is not None and end >= 0:
            end = max(end - first, 0)
        ends.append(end)
    start, stop, _ = slice(*ends).indices(count)
    if start >= stop:
        numbers = f" {first}:{first + count}" if first else ""
        raise InputError(
            f"frames must contain one of the {count} frames{numbers}, "
            f"got {_range_text(frames)}"
        )
    return start, stop
