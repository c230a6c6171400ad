"""A video at the size of its masks; the frames that are needed again are kept."""

import zlib
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.footage.extraction import Box
from posefit.footage.images import read_image
from posefit.footage.video import Video, scaled
from posefit.reading import quoted
from posefit.silhouette.foreground import Image

T = TypeVar("T", bound=np.generic)
Item = TypeVar("Item")
AHEAD = 2  # frames that are decoded while earlier ones are in use
# bytes of packed frames, about 300 of 640x360 pixels; longer films are decoded again
KEPT_BYTES = 50_000_000
# times the pixels of the masks: frames of fewer pixels are decoded again, not kept
LARGE = 4


class ScaledVideo:
    """A video whose frames are scaled down to a width.

    Some of its frames are needed more than once: to segment the person, and to show the
    track. They are kept from the first pass through them, packed.
    """

    def __init__(
        self, video: Video, width: int, kept: tuple[int, int] = (0, 0)
    ) -> None:
        """Scale a video.

        Args:
            video: The video.
            width: A wider video is scaled down to this width, in pixels.
            kept: The first of the frames to keep, and the frame after the last.

        """
        self.video = video
        self.scale = min(1.0, width / video.size[0])
        self.size = (
            max(1, round(video.size[0] * self.scale)),
            max(1, round(video.size[1] * self.scale)),
        )
        pixels = self.size[0] * self.size[1]
        # frames that are hardly scaled down are decoded faster than unpacked
        large = video.size[0] * video.size[1] >= LARGE * pixels
        self._span = kept if large else (0, 0)
        self._packed: list[bytes] | None = None

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from start to before stop."""
        if self._packed is not None and (start, stop, step) == (*self._span, 1):
            return _unpacked(self._packed, self.size)
        frames = ahead(self.video.frames(start, stop, self.size, step))
        first, last = self._span
        has_span = start <= first < last and (stop is None or stop >= last)
        if self._packed is None and has_span and step == 1:
            return self._kept_from(frames, start)
        return frames

    def _kept_from(self, frames: Iterator[Image], start: int) -> Iterator[Image]:
        """Yield frames, whose numbers begin at `start`, and keep those of the span."""
        first, last = self._span
        packed = list[bytes]()
        room = KEPT_BYTES
        before = _blank(self.size)
        for number, frame in enumerate(frames, start):
            if first <= number < last and room > 0:
                packed.append(_pack(frame, before))
                room -= len(packed[-1])
                # a copy, because the caller may write into the frame
                before = frame.copy()
            if room <= 0 and packed:
                packed.clear()
                self._span = (0, 0)
            yield frame
        if room > 0:
            self._packed = packed


def ahead(items: Iterator[Item]) -> Iterator[Item]:
    """Yield items that a thread makes while the caller uses earlier ones.

    Decoding runs outside of Python, so that a second core can do it.
    """
    end = object()
    with ThreadPoolExecutor(1) as pool:
        waiting = deque(pool.submit(next, items, end) for _ in range(AHEAD))
        while (item := waiting.popleft().result()) is not end:
            waiting.append(pool.submit(next, items, end))
            yield cast(Item, item)


def _blank(size: tuple[int, int]) -> Image:
    return np.zeros((size[1], size[0], 3), dtype=np.uint8)


def _pack(frame: Image, before: Image) -> bytes:
    """Return what changed since the frame before, compressed.

    Most of it is 0 if the camera stands still, because codecs repeat what they can.
    """
    # of zlib's strategies, run lengths are the fastest and smallest for such changes
    packing = zlib.compressobj(1, strategy=zlib.Z_RLE)
    return packing.compress((frame - before).tobytes()) + packing.flush()


def _unpacked(packed: Sequence[bytes], size: tuple[int, int]) -> Iterator[Image]:
    """Yield the frames of `_pack`."""
    frame = _blank(size)
    for changes in packed:
        changed = np.frombuffer(zlib.decompress(changes), dtype=np.uint8)
        frame = frame + changed.reshape(frame.shape)
        # a copy, because the caller may write into it
        yield frame.copy()


@dataclass(frozen=True)
class PartOfVideo:
    """A video as a segmenter gets it: scaled, then cut to `part`."""

    scaled: ScaledVideo
    part: Box

    def __len__(self) -> int:
        return self.scaled.video.count()

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from start to stop."""
        return map(self.cut, self.scaled.frames(start, stop, step))

    def picture(self, path: str) -> Image:
        """Return a picture of the video's size, scaled and cut as the video.

        Raises InputError if the file is not a picture, or has another size.
        """
        image = read_image(path, grey=False)
        if image is None:
            raise InputError(
                f"background must be frames A:B or an image, got {quoted(path)}"
            )
        tall, wide = image.shape[:2]
        width, height = self.scaled.video.size
        if (wide, tall) != (width, height):
            raise InputError(
                f"{path}: background must have the video's size {width}x{height}, "
                f"got {wide}x{tall}"
            )
        return self.cut(scaled(image, self.scaled.size))

    def cut(self, image: NDArray[T]) -> NDArray[T]:
        """Return the segmenter's part of a scaled image (height, width, ...)."""
        x, y, wide, tall = self.part
        return np.ascontiguousarray(image[y : y + tall, x : x + wide])
