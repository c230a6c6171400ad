"""Read a camera, a network stream or a pipe live, and find the person in each frame."""

import io
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain, islice
from pathlib import Path
from typing import Any, BinaryIO

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.footage.extraction import Extraction
from posefit.footage.images import PIXELS
from posefit.footage.segmenter import PersonSegmenter
from posefit.footage.video import Video, scaled
from posefit.footage.views import View
from posefit.motion.clips import FPS
from posefit.reading import quoted
from posefit.silhouette.foreground import BRIGHT, Image
from posefit.silhouette.mask import Mask

STALL_SECONDS = 5.0  # a stream without a frame for this long counts as broken
# the scene must be empty for this long at first, to learn the background: VSMM 1.1
EMPTY_SECONDS = 3.0


@dataclass(frozen=True, eq=False)
class LiveImage:
    """A frame of a stream: a picture (height, width, 3), or a mask (height, width)."""

    number: int  # place in the stream, counting skipped frames
    arrived: float  # seconds of `time.perf_counter`
    image: Image = field(repr=False)


class Stream:
    """The frames of a live source. Iterate over it to get a `LiveImage` at a time.

    A thread reads the source. If several frames arrive while one is tracked, only the
    newest is kept. Iteration raises InputError if a frame is damaged, or if no frame
    arrives for `STALL_SECONDS`.
    """

    def __init__(self, source: str, pipe: BinaryIO | None = None) -> None:
        """Open a source, and start to read.

        Args:
            source: The number of a device, an address that OpenCV opens, or "-" for
                standard input: binary PGM images, which are masks, or PPM images.
            pipe: What to read in place of standard input.

        Raises:
            InputError: The source cannot be opened.
        """
        self.name = source
        self.fps = FPS
        self.count = 0
        self.rate: float | None = None  # frames per second, if the source states them
        self._latest: LiveImage | None = None
        self._ended = False
        self._error: InputError | None = None
        self._changed = threading.Condition()
        frames: Iterator[Image]
        if source == "-":
            # the descriptor is duplicated, because Python aborts (SIGABRT) at exit if a
            # thread is reading from sys.stdin
            with suppress(io.UnsupportedOperation):  # a stream in memory has no file
                pipe = pipe or os.fdopen(os.dup(sys.stdin.fileno()), "rb")
            frames = netpbm_images(pipe or sys.stdin.buffer)
        else:
            name = opencv_name(source)
            address = name if os.path.exists(name) else source
            capture = cv2.VideoCapture(int(source) if source.isdigit() else address)
            if not capture.isOpened():
                raise InputError(
                    "live must be a device or an address that can be opened, or -, "
                    f"got {quoted(source)}"
                )
            # cameras report 0, NaN or absurd numbers if they do not know their rate
            rate = capture.get(cv2.CAP_PROP_FPS)
            self.rate = rate if np.isfinite(rate) and 1.0 <= rate <= 1000.0 else None
            self.fps = self.rate or FPS
            frames = _captured(capture)
        threading.Thread(target=self._read, args=(frames,), daemon=True).start()

    def __iter__(self) -> Iterator[LiveImage]:
        while True:
            with self._changed:
                came = self._changed.wait_for(
                    lambda: self._latest is not None or self._ended, STALL_SECONDS
                )
                image = self._latest
                self._latest = None
            if image is not None:
                yield image
            elif not came:
                raise InputError(
                    f"{self.name}: no frame arrived for {STALL_SECONDS:g} s"
                )
            elif self._error is not None:
                raise self._error
            else:
                return

    def _read(self, frames: Iterator[Image]) -> None:
        try:
            for image in frames:
                with self._changed:
                    self._latest = LiveImage(self.count, time.perf_counter(), image)
                    self.count += 1
                    self._changed.notify()
        # an error that ended this thread alone would look like the end of the stream
        except Exception as error:
            cause = str(error) or type(error).__name__
            self._error = InputError(f"{self.name}: {cause}, after {self.count} frames")
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify()


def netpbm_images(stream: BinaryIO) -> Iterator[Image]:
    """Yield the binary PGM and PPM images of a stream.

    PGM images have shape (height, width), PPM images (height, width, 3) in blue, green
    and red.

    Raises InputError for anything else, and for an incomplete image.
    """
    while magic := stream.read(2):
        if magic not in (b"P5", b"P6"):
            came = quoted(magic.decode("latin-1"))
            raise InputError(f"expected binary PGM or PPM images, got {came}")
        width = _number(stream)
        height = _number(stream)
        highest = _number(stream)
        if not (0 < width * height <= PIXELS and highest == 255):
            raise InputError(
                f"expected an image of at most {PIXELS // 10**6} million pixels in 255 "
                "levels"
            )
        is_grey = magic == b"P5"
        shape = (height, width) if is_grey else (height, width, 3)
        values = stream.read(int(np.prod(shape)))
        if len(values) < np.prod(shape):
            raise InputError("the last image is incomplete")
        image = np.frombuffer(values, dtype=np.uint8).reshape(shape)
        # PPM stores red first, OpenCV blue
        yield image if is_grey else np.ascontiguousarray(image[..., ::-1])


MAX_DIGITS = 10  # a number of pixels has no more: the header is damaged


def _number(stream: BinaryIO) -> int:
    """Return the next number of a netpbm header, and skip the byte after it."""
    digits = b""
    while len(digits) < MAX_DIGITS:
        byte = stream.read(1)
        # a comment reaches to the end of its line
        if byte == b"#":
            while stream.read(1) not in (b"\n", b""):
                pass
        elif byte.isdigit():
            digits += byte
        elif digits or not byte.isspace():
            break
    if not (digits and byte.isspace()):
        raise InputError("expected the header of an image, got something else")
    return int(digits)


def _captured(capture: Any) -> Iterator[Image]:
    """Yield frames until the capture ends."""
    read, image = capture.read()
    while read:
        yield image
        read, image = capture.read()
    capture.release()


def live_views(
    stream: Stream, how: Extraction | None, log: Callable[[str], None]
) -> Iterator[View]:
    """Yield a view of each frame of a stream. Its time is that of `time.perf_counter`.

    Grey frames are masks; colour frames are segmented.

    Args:
        stream: The frames.
        how: How to segment them. By default the first three seconds must show the empty
            scene, and each pixel's background is its mean over them.
        log: Takes messages for the user.

    Raises:
        InputError: The stream fails, see `Stream`, or its frames differ in size.
    """
    images = _of_one_size(stream)
    first = next(images)
    if first.image.ndim == 2:
        for live in chain([first], images):
            mask = live.image > BRIGHT
            usable = bool(mask.any() and not mask.all())
            yield _view(stream, live, mask, np.ones_like(mask), usable)
        return
    learned = [first.image]
    if how is None:
        log(f"learning the background: keep the scene empty for {EMPTY_SECONDS:g} s")
        learned += [
            live.image for live in islice(images, round(EMPTY_SECONDS * stream.fps) - 1)
        ]
        how = Extraction(background=f"0:{len(learned)}")
    else:
        images = chain([first], images)
    name = Path(stream.name)
    video = Video.of_images(learned, name, stream.fps, how.width)
    segmenter = PersonSegmenter(video, how)
    quality = None
    for live in images:
        image = scaled(live.image, video.size)
        (person, *_), _, landmarks = segmenter.frame(image)
        quality = quality or segmenter.quality()
        usable = bool(segmenter.row(quality, image, person, live.number)["usable"])
        view = _view(stream, live, person.mask, person.valid, usable)
        pictures = partial(iter, [image])
        yield replace(view, landmarks=landmarks[None], pictures=pictures)


def _view(
    stream: Stream, live: LiveImage, mask: Mask, valid: Mask, usable: bool
) -> View:
    return View(
        name=stream.name,
        numbers=np.array([live.number]),
        times=np.array([live.arrived]),
        bits=np.packbits(mask)[None],
        known=np.packbits(valid)[None],
        usable=np.array([usable]),
        size=(mask.shape[1], mask.shape[0]),
        fps=stream.rate,
    )


def _of_one_size(stream: Stream) -> Iterator[LiveImage]:
    """Yield the frames of a stream.

    Raises InputError if there are none, or if one has another size than the first.
    """
    first = None
    for live in stream:
        first = first or live
        if live.image.shape != first.image.shape:
            expected = _size_of(first.image)
            came = _size_of(live.image)
            raise InputError(
                f"{stream.name}: expected frames of {expected}, got {came}"
            )
        yield live
    if first is None:
        raise InputError(f"{stream.name}: expected frames, got none")


def _size_of(image: Image) -> str:
    """Return the width and the height of an image as a message shows them."""
    return f"{image.shape[1]}x{image.shape[0]}"
