"""Read video, or pictures of a film, frame by frame, to keep memory constant.

A film's frames are scaled to the width at which the person is segmented as soon as they
are decoded. Those that are needed again are kept, see `kept`.
"""

import os
from collections import Counter, deque
from collections.abc import Container, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, TypeVar, cast

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.footage.images import PIXELS, page_count, read_image
from posefit.footage.kept import ROOM, KeptFrames
from posefit.footage.numbering import Images
from posefit.footage.rates import Order, even
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image

Item = TypeVar("Item")
HEAD_BYTES = 2_000  # bytes at the beginning of a file that tell whether it is text
SQUARE_SHARE = 0.02  # share by which the sides of a pixel may differ and count as equal
MAX_RATE = 1_000.0  # frames per second: files that state more do not know their rate
MAX_CLAIMED = 1e9  # frames: files that state more do not know their length
# cv2.CAP_PROP_PTS, the time of the last frame that was read, in frames; OpenCV before
# 4.11 returns 0 or less
PTS = 71
FRAMES_AHEAD = 2  # frames that are decoded while earlier ones are in use
# posefit reports once what is wrong with a file. A user may set the variable to see
# FFmpeg's own messages
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


@dataclass(frozen=True)
class Video:
    """A film: a video file or pictures, whose frames are scaled down to a width.

    Frames are numbered in even steps of time. If the file's own frames are not evenly
    spaced, each number gets the nearest one.
    """

    path: Path
    fps: float
    filmed: tuple[int, int]  # width and height in pixels, as filmed
    size: tuple[int, int]  # the same of the frames, after scaling
    claimed: int = 0  # number of frames that the file states; 0 if it states none
    # images, or their files and pages; empty for a video file
    pictures: Sequence[tuple[Path, int] | Image] = field(
        default=(), repr=False, compare=False
    )
    warnings: Sequence[str] = ()  # what a user should know about the frames
    guesses: Sequence[str] = ()  # what the file does not state
    # (T,) for each frame, which of the file's frames it is
    _order: Order = field(kw_only=True, repr=False, compare=False)
    # (T,) whether it was filmed at that time, and is not a repetition
    _is_filmed: NDArray[np.bool_] = field(kw_only=True, repr=False, compare=False)
    # some of the file's frames, after scaling
    _kept: KeptFrames = field(kw_only=True, repr=False, compare=False)

    @classmethod
    def of(cls, path: str | Path, width: int | None = None) -> "Video":
        """Open a video file.

        Args:
            path: The file.
            width: A wider video is scaled down to this width, in pixels; None for its
                own.

        Raises:
            InputError: The file is missing, cannot be read, or has no frame.
        """
        path = Path(path)
        head = _read_head(path)
        is_stated = np.isfinite(head.fps) and 0.0 < head.fps <= MAX_RATE
        stated = head.fps if is_stated else FPS
        size = _scaled_size(head.size, width)
        kept = KeptFrames(size, _kept_at_first(head, size))
        order, filmed, rate = even(_moments(path, head.size, size, kept), stated)
        is_uneven = bool((np.diff(order) != 1).any())
        warnings = []
        if head.aspect is not None and abs(head.aspect - 1.0) > SQUARE_SHARE:
            warnings.append(
                f"{path}: its pixels are {head.aspect:.3g} times as wide as high. This "
                "is not corrected, so the person looks too slim by this factor"
            )
        if is_uneven:
            held = np.count_nonzero(~filmed)
            warnings.append(
                f"{path}: its frames come at uneven times, so it is sampled {rate:.3g} "
                f"times a second; {held} of these {len(order)} frames were not filmed, "
                "and are held"
            )
        guesses = []
        by_times = rate != stated
        if not is_stated:
            reason = "which the file does not state"
            if by_times:
                reason = "by the times of its frames"
            guesses.append(f"{path}: {rate:.4g} frames a second, {reason}")
        elif by_times and not is_uneven:
            guesses.append(
                f"{path}: {rate:.4g} frames a second by the times of its frames, "
                f"although its header says {head.fps:.4g}"
            )
        # many files compute their number of frames from their length and their stated
        # rate, so that it counts nothing if that rate is wrong
        claimed = 0
        if 0.0 < head.claimed < MAX_CLAIMED and not is_uneven and not by_times:
            claimed = int(head.claimed)
            # a length may be counted from a time before the first frame
            if claimed - head.start >= len(order):
                claimed -= head.start
        return cls(
            path,
            rate,
            head.size,
            size,
            claimed,
            warnings=warnings,
            guesses=guesses,
            _order=order,
            _is_filmed=filmed,
            _kept=kept,
        )

    @classmethod
    def of_images(
        cls,
        images: Sequence[Image],
        name: Path,
        fps: float | None = None,
        width: int | None = None,
    ) -> "Video":
        """Return the film of images in memory. The default rate is a guess: 30."""
        filmed = (images[0].shape[1], images[0].shape[0])
        size = _scaled_size(filmed, width)
        return cls(
            name,
            fps or FPS,
            filmed,
            size,
            pictures=images,
            guesses=_guessed_rate(fps),
            _order=np.arange(len(images)),
            _is_filmed=np.ones(len(images), dtype=bool),
            # they are in memory already
            _kept=KeptFrames(size, ()),
        )

    @classmethod
    def of_pictures(
        cls, images: Images, fps: float | None = None, width: int | None = None
    ) -> "Video":
        """Return the film of numbered pictures, or of the pages of a file.

        A missing picture is replaced by the one before it. The default rate is 30
        frames per second, which is a guess. Raises InputError if the first picture
        cannot be read.
        """
        assert images.numbered is not None
        files = [file for file in images.numbered.files if file is not None]
        pictures = list[tuple[Path, int] | Image]()
        for file in files:
            pictures += [(file, page) for page in range(page_count(file))]
        first = _picture(pictures[0])
        if len(pictures) > len(files):
            order = np.arange(len(pictures))
            is_filmed = np.ones(len(pictures), dtype=bool)
        else:
            is_filmed = np.array([file is not None for file in images.numbered.files])
            # a film that begins with missing pictures repeats the first one
            order = np.maximum(np.cumsum(is_filmed) - 1, 0)
        filmed = (first.shape[1], first.shape[0])
        size = _scaled_size(filmed, width)
        fits = len(pictures) * _bytes_of(size) <= ROOM
        return cls(
            Path(images.name),
            fps or FPS,
            filmed,
            size,
            pictures=pictures,
            guesses=[*images.numbered.guesses, *_guessed_rate(fps)],
            _order=order,
            _is_filmed=is_filmed,
            _kept=KeptFrames(size, range(len(pictures)) if fits else ()),
        )

    @property
    def scale(self) -> float:
        """Pixels of the frames per pixel as filmed."""
        return self.size[0] / self.filmed[0]

    def keep(self, start: int, stop: int) -> None:
        """Keep these frames when they are decoded, even if others do not fit.

        They are segmented, and then shown with their track.
        """
        if not self._kept.wanted:
            self._kept.wanted = frozenset(self._order[start:stop].tolist())

    def frames(
        self, start: int = 0, stop: int | None = None, step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from start to before stop, as a new array.

        Raises InputError if a frame has another size than the first.
        """
        # a frame of the file may be repeated: it is read once
        wanted = Counter(self._order[start:stop:step].tolist())
        missing = [number for number in wanted if number not in self._kept]
        decoded = ahead(self._decoded(missing))
        to_decode = frozenset(missing)
        for number, times in wanted.items():
            if number not in to_decode:
                image = self._kept[number]
            else:
                following = next(decoded, None)
                if following is None:  # the file breaks off
                    return
                image = self._scaled(following, number)
                self._kept.add(number, image)
            yield image
            for _ in range(times - 1):
                yield image.copy()

    def _scaled(self, image: Image, number: int) -> Image:
        """Return a frame of the file, scaled."""
        if (image.shape[1], image.shape[0]) != self.filmed:
            came = f"{image.shape[1]}x{image.shape[0]} in frame {number}"
            raise InputError(
                f"{self.path}: expected frames of {self.filmed[0]}x{self.filmed[1]}, "
                f"got {came}"
            )
        return scaled(image, self.size)

    def _decoded(self, numbers: Sequence[int]) -> Iterator[Image]:
        """Yield these frames of the file, in rising order, until it ends."""
        if self.pictures:
            yield from (_picture(self.pictures[k]) for k in numbers)
            return
        capture = cv2.VideoCapture(opencv_name(self.path))
        k = -1
        try:
            for number in numbers:
                # frames in between are skipped without converting them
                while k < number - 1 and capture.grab():
                    k += 1
                read, image = capture.read()
                if not read:
                    return
                k += 1
                yield np.asarray(image, dtype=np.uint8)
        finally:
            capture.release()

    def count(self) -> int:
        """Return how many frames can be read; files often state a wrong number."""
        return len(self._order)

    def is_filmed(self, k: int) -> bool:
        """Return whether frame k was filmed at its time, and is not a repetition."""
        return bool(self._is_filmed[k])


def _guessed_rate(fps: float | None) -> list[str]:
    """Return the guess of the rate of pictures, if the user does not state one."""
    return [f"{FPS:g} frames a second"] if fps is None else []


def _picture(source: tuple[Path, int] | Image) -> Image:
    """Return a picture, which is read from its file and page if it is not in memory."""
    if isinstance(source, np.ndarray):
        return source
    file, page = source
    image = read_image(file, grey=False, page=page)
    if image is None:
        raise InputError(f"{file}: expected a picture, got a damaged or another file")
    return image


class _Head(NamedTuple):
    """What a video file states about itself."""

    size: tuple[int, int]  # width and height of the first frame
    fps: float  # may be 0, NaN or absurd
    claimed: float  # number of frames; may be absurd
    start: int  # how many frames would fit before the first one; 0 if unknown
    aspect: float | None  # width of a pixel over its height


def _read_head(path: Path) -> _Head:
    """Return what a video states about itself. Raises InputError if unreadable."""
    if path.is_dir():
        raise InputError(f"{path}: expected a video file, got a folder")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    _check_no_text(path)
    capture = cv2.VideoCapture(opencv_name(path))
    try:
        wide = capture.get(cv2.CAP_PROP_FRAME_WIDTH)
        tall = capture.get(cv2.CAP_PROP_FRAME_HEIGHT)
        # checked before the first frame is decoded
        if wide * tall > PIXELS:
            most = f"{PIXELS // 10**6} million pixels"
            raise InputError(
                f"{path}: expected frames of at most {most}, got {wide:.0f}x{tall:.0f}"
            )
        read, image = capture.read()
        if not read:
            raise InputError(
                f"{path}: expected a video that OpenCV can read, got a damaged or "
                "another file: convert it with ffmpeg -i FILE -c:v libx264 NEW.mp4"
            )
        fps = float(capture.get(cv2.CAP_PROP_FPS))
        claimed = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        start = max(0, int(capture.get(PTS)))
        across = float(capture.get(cv2.CAP_PROP_SAR_NUM))
        down = float(capture.get(cv2.CAP_PROP_SAR_DEN))
        _check_written(path, image, capture)
    finally:
        capture.release()
    aspect = across / down if across > 0.0 and down > 0.0 else None
    return _Head((image.shape[1], image.shape[0]), fps, claimed, start, aspect)


def _check_no_text(path: Path) -> None:
    """Raise InputError for a text file.

    FFmpeg would take it for a playlist and open the files that it lists.
    """
    with path.open("rb") as file:
        head = file.read(HEAD_BYTES)
    is_text = (
        head
        and not head.startswith(b"YUV4MPEG2")
        and all(byte >= 32 or byte in b"\t\n\r\f" for byte in head)
    )
    if is_text or head.startswith((b"ffconcat", b"#EXTM3U")):
        raise InputError(f"{path}: expected a video that OpenCV can read, got a text")


def _check_written(path: Path, first: Any, capture: Any) -> None:
    """Raise InputError if all frames are equal.

    OpenCV 4.13 to 5.0 do not convert interlaced frames, and return whatever was in
    memory before.
    """
    more, image = capture.read()
    if not more:
        return
    while more:
        if not np.array_equal(first, image):
            return
        more, image = capture.read()
    raise InputError(
        f"{path}: all frames show the same picture; if the video is interlaced, "
        "convert it with ffmpeg -i FILE -vf yadif NEW.mp4"
    )


def scaled(image: Any, size: tuple[int, int]) -> Image:
    """Return a picture scaled down to a width and a height."""
    wide = image.shape[1]
    tall = image.shape[0]
    whole = min(wide // size[0], tall // size[1])
    # scaling down by a whole number first takes a tenth of the time
    if whole > 1 and wide % whole == tall % whole == 0:
        wide //= whole
        tall //= whole
        image = cv2.resize(image, (wide, tall), interpolation=cv2.INTER_AREA)
    # below a factor of two, linear interpolation skips no pixel. It takes a tenth of
    # the time, and keeps outlines sharper than the mean over an area
    is_near = wide < 2 * size[0] and tall < 2 * size[1]
    interpolation = cv2.INTER_LINEAR if is_near else cv2.INTER_AREA
    result = cv2.resize(image, size, interpolation=interpolation)
    return np.asarray(result, dtype=np.uint8)


def _scaled_size(filmed: tuple[int, int], width: int | None) -> tuple[int, int]:
    """Return the size of frames that are scaled down to a width, if they are wider."""
    scale = min(1.0, (width or filmed[0]) / filmed[0])
    return max(1, round(filmed[0] * scale)), max(1, round(filmed[1] * scale))


def _bytes_of(size: tuple[int, int]) -> int:
    """Return the bytes of a frame."""
    return 3 * size[0] * size[1]


def _kept_at_first(head: _Head, size: tuple[int, int]) -> Container[int]:
    """Return the frames to keep when the file is opened: all that it states, or none.

    If a film is too long, only frames that are needed later are kept.
    """
    fits = 0.0 < head.claimed * _bytes_of(size) <= ROOM
    return range(round(head.claimed)) if fits else ()


def _moments(
    path: Path, filmed: tuple[int, int], size: tuple[int, int], kept: KeptFrames
) -> Array:
    """Return when each frame is shown (T,), in seconds, by decoding the whole file.

    What files state about the number and the times of their frames is often wrong.

    Args:
        path: The file.
        filmed: Width and height of its frames.
        size: Width and height to which they are scaled.
        kept: Chooses and keeps frames.
    """
    times = list[float]()
    # a second core decodes the next frames while this one is scaled and kept
    for number, (seconds, image) in enumerate(ahead(_timed(path, kept))):
        times.append(seconds)
        if image is not None and (image.shape[1], image.shape[0]) == filmed:
            kept.add(number, scaled(image, size))
    return np.array(times)


def _timed(path: Path, kept: KeptFrames) -> Iterator[tuple[float, Image | None]]:
    """Yield when each frame of a file is shown, in seconds, and its picture.

    The picture is None if it is not to be kept, or is damaged.
    """
    capture = cv2.VideoCapture(opencv_name(path))
    number = 0
    try:
        while capture.grab():
            seconds = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            image: Any = None
            if kept.takes(number):
                _, image = capture.retrieve()
            yield seconds, image
            number += 1
    finally:
        capture.release()


def ahead(items: Iterator[Item]) -> Iterator[Item]:
    """Yield items that a thread makes while the caller uses earlier ones.

    Decoding runs outside of Python, so that a second core can do it.
    """
    end = object()
    with ThreadPoolExecutor(1) as pool:
        waiting = deque(pool.submit(next, items, end) for _ in range(FRAMES_AHEAD))
        while (item := waiting.popleft().result()) is not end:
            waiting.append(pool.submit(next, items, end))
            yield cast(Item, item)
