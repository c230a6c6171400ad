"""Read video, or pictures of a film, frame by frame, to keep memory constant."""

import errno
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import repeat
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.footage.images import PIXELS, page_count, read_image
from posefit.footage.numbering import Images
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image

HEAD = 2_000  # bytes at the beginning of a file that tell whether it is text
SQUARE = 0.02  # share by which the sides of a pixel may differ and count as equal
Order = NDArray[np.int64]  # (T,) numbers of frames
CODE = "mp4v"
# MPEG-4 divides a second into at most this many ticks, and OpenCV passes it the rate as
# a decimal fraction with at most three places
MAX_TICKS = 65_535
WRITTEN_RATES = 0.01, 60_000.0  # frames per second that OpenCV can write
MAX_RATE = 1_000.0  # frames per second: files that state more do not know their rate
MAX_CLAIMED = 1e9  # frames: files that state more do not know their length
# share of the distance between frames: if a frame comes this much too early or too
# late, the frames are not at even times
UNEVEN = 0.75
# seconds: many files round the times of frames to milliseconds
STAMP = 1e-3
# share by which a film's length may differ from the length by its stated rate
SAME_RATE = 5e-3
# times the mean rate: the highest rate at which uneven frames are sampled, because a
# few frames close together say nothing about the rest
DENSEST = 4.0
# posefit reports once what is wrong with a file. A user may set the variable to see
# FFmpeg's own messages
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


@dataclass(frozen=True)
class Video:
    """A film: a video file, reopened for each pass through it, or pictures.

    Frames are numbered in even steps of time. If the file's own frames are not evenly
    spaced, each number gets the nearest one.
    """

    path: Path
    fps: float
    size: tuple[int, int]  # width and height in pixels, as filmed
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
    _filmed: NDArray[np.bool_] = field(kw_only=True, repr=False, compare=False)

    @classmethod
    def of(cls, path: str | Path) -> "Video":
        """Open a video file.

        Raises:
            InputError: The file is missing, cannot be read, or has no frame.

        """
        path = Path(path)
        head = _read_head(path)
        is_stated = np.isfinite(head.fps) and 0.0 < head.fps <= MAX_RATE
        stated = head.fps if is_stated else FPS
        order, filmed, rate = _even(_moments(path), stated)
        is_uneven = bool((np.diff(order) != 1).any())
        warnings = []
        if head.aspect is not None and abs(head.aspect - 1.0) > SQUARE:
            warnings.append(
                f"{path}: its pixels are {head.aspect:.3g} times as wide as high, "
                "which is not corrected: the person looks that much too slim"
            )
        if is_uneven:
            held = np.count_nonzero(~filmed)
            warnings.append(
                f"{path}: its frames come at uneven times; it is sampled {rate:.3g} "
                f"times a second, so that {held} of {len(order)} frames stand for "
                "moments without a filmed one, and are held"
            )
        guesses = []
        by_times = rate != stated
        if not is_stated:
            reason = "which the file does not state"
            if by_times:
                reason = "by its frames' times"
            guesses.append(f"{path}: {rate:.4g} frames a second, {reason}")
        elif by_times and not is_uneven:
            guesses.append(
                f"{path}: {rate:.4g} frames a second by its frames' times, where its "
                f"head says {head.fps:.4g}"
            )
        # many files compute their number of frames from their length and their stated
        # rate, so that it counts nothing if that rate is wrong
        claimed = 0
        if 0.0 < head.claimed < MAX_CLAIMED and not is_uneven and not by_times:
            claimed = int(head.claimed)
        return cls(
            path,
            rate,
            head.size,
            claimed,
            warnings=warnings,
            guesses=guesses,
            _order=order,
            _filmed=filmed,
        )

    @classmethod
    def of_images(cls, images: Sequence[Image], name: Path, fps: float) -> "Video":
        """Return the film of images in memory."""
        order = np.arange(len(images))
        size = (images[0].shape[1], images[0].shape[0])
        return cls(name, fps, size, pictures=images, _order=order, _filmed=order >= 0)

    @classmethod
    def of_pictures(cls, images: Images, fps: float | None = None) -> "Video":
        """Return the film of numbered pictures, or of the pages of a file.

        A missing picture is replaced by the one before it. The default rate is 30
        frames per second, which is a guess. Raises InputError if the first picture
        cannot be read.
        """
        assert images.numbered is not None
        files = [file for file in images.numbered.files if file is not None]
        guesses = list(images.numbered.guesses)
        pictures = list[tuple[Path, int] | Image]()
        for file in files:
            pictures += [(file, page) for page in range(page_count(file))]
        first = _picture(pictures[0])
        if len(pictures) > len(files):
            order = np.arange(len(pictures))
            filmed = np.ones(len(pictures), dtype=bool)
        else:
            filmed = np.array([file is not None for file in images.numbered.files])
            # a film that begins with missing pictures repeats the first one
            order = np.maximum(np.cumsum(filmed) - 1, 0)
        if fps is None:
            guesses.append(f"{FPS:g} frames a second")
        return cls(
            Path(images.name),
            fps or FPS,
            (first.shape[1], first.shape[0]),
            pictures=pictures,
            guesses=guesses,
            _order=order,
            _filmed=filmed,
        )

    def frames(
        self, start: int, stop: int | None, size: tuple[int, int], step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame from start to stop, scaled to `size`.

        Raises InputError if a frame has another size than the first.
        """
        # a frame of the file may be repeated: it is decoded once
        wanted = Counter(self._order[start:stop:step].tolist())
        decoded = self._decoded(list(wanted))
        for (number, times), image in zip(wanted.items(), decoded, strict=False):
            if (image.shape[1], image.shape[0]) != self.size:
                came = f"{image.shape[1]}x{image.shape[0]} in frame {number}"
                raise InputError(
                    f"{self.path}: expected frames of {self.size[0]}x{self.size[1]}, "
                    f"got {came}"
                )
            yield from repeat(scaled(image, size), times)

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
        return bool(self._filmed[k])


def _picture(source: tuple[Path, int] | Image) -> Image:
    """Return a picture, which is read from its file and page if it is not in memory."""
    if isinstance(source, np.ndarray):
        return source
    file, page = source
    image = read_image(file, grey=False, page=page)
    if image is None:
        raise InputError(f"{file}: expected a picture, got another or a damaged file")
    return image


class _Head(NamedTuple):
    """What a video file states about itself."""

    size: tuple[int, int]  # width and height of the first frame
    fps: float  # may be 0, NaN or absurd
    claimed: float  # number of frames; may be absurd
    aspect: float | None  # width of a pixel over its height


def _read_head(path: Path) -> _Head:
    """Return what a video states about itself. Raises InputError if unreadable."""
    if not path.is_file():
        came = "a folder" if path.is_dir() else "nothing of that name"
        raise InputError(f"{path}: expected a video file, got {came}")
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
                f"{path}: expected a video that OpenCV can read, got none or one "
                "without frames"
            )
        fps = float(capture.get(cv2.CAP_PROP_FPS))
        claimed = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        across = float(capture.get(cv2.CAP_PROP_SAR_NUM))
        down = float(capture.get(cv2.CAP_PROP_SAR_DEN))
        _check_written(path, image, capture)
    finally:
        capture.release()
    aspect = across / down if across > 0.0 and down > 0.0 else None
    return _Head((image.shape[1], image.shape[0]), fps, claimed, aspect)


def _check_no_text(path: Path) -> None:
    """Raise InputError for a text file.

    FFmpeg would take it for a playlist and open the files that it lists.
    """
    with path.open("rb") as file:
        head = file.read(HEAD)
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
        f"{path}: expected a film, got the same picture in all frames; if it is "
        "interlaced, which this OpenCV cannot read: "
        "ffmpeg -i FILE -vf yadif NEW.mp4"
    )


def scaled(image: Any, size: tuple[int, int]) -> Image:
    """Return a picture scaled to a width and a height."""
    wide = image.shape[1]
    tall = image.shape[0]
    whole = min(wide // size[0], tall // size[1])
    # scaling down by a whole number first takes a tenth of the time
    if whole > 1 and wide % whole == tall % whole == 0:
        smaller = (wide // whole, tall // whole)
        image = cv2.resize(image, smaller, interpolation=cv2.INTER_AREA)
    result = cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    return np.asarray(result, dtype=np.uint8)


def _moments(path: Path) -> Array:
    """Return when each frame is shown (T,), in seconds, by going through the file."""
    capture = cv2.VideoCapture(opencv_name(path))
    times = []
    while capture.grab():
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
    capture.release()
    return np.array(times)


def _even(times: Array, fps: float) -> tuple[Order, NDArray[np.bool_], float]:
    """Return frames at even times.

    If the frames are evenly spaced, these are all of them. Otherwise moments are spaced
    at the frames' usual distance, and each one gets the nearest frame.

    Args:
        times: (T,) when each frame is shown, in seconds.
        fps: The rate that the file states.

    Returns:
        For each moment its frame, whether that frame was filmed then and is not a
        repetition, and the number of moments per second.

    """
    numbers = np.arange(len(times))
    all_filmed = numbers >= 0
    apart = np.diff(times)
    # a file without usable times
    if len(times) < 3 or not (apart > 0.0).all():
        return numbers, all_filmed, fps
    mean = float(apart.mean())
    largest_miss = float(np.abs(times - times[0] - mean * numbers).max())
    if largest_miss <= UNEVEN * mean:
        return numbers, all_filmed, _rate(times, largest_miss, fps)
    usual = max(float(np.median(apart)), mean / DENSEST)
    # times are rounded, so the median is inexact: the mean over all steps is better
    steps = np.maximum(np.round(apart / usual), 1.0)
    usual = float(apart.sum() / steps.sum())
    count = round((times[-1] - times[0]) / usual) + 1
    moments = times[0] + usual * np.arange(count)
    later = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    is_earlier_nearer = moments - times[later - 1] <= times[later] - moments
    order = np.where(is_earlier_nearer, later - 1, later)
    # of several moments with one frame, the nearest is the one when it was filmed
    miss = np.abs(times[order] - moments)
    least = np.full(len(times), np.inf)
    np.minimum.at(least, order, miss)
    return order, miss == least[order], 1.0 / usual


def video_rate(fps: float) -> float:
    """Return the rate that an .mp4 file states for `fps`: 119.88 for 119.8765.

    It is rounded to three decimals up to 65 frames per second, to two up to 655, and to
    one above.
    """
    rate = float(np.clip(fps, *WRITTEN_RATES))
    digits = next(digits for digits in (3, 2, 1, 0) if rate * 10**digits <= MAX_TICKS)
    return round(rate, digits)


def _rate(times: Array, off: float, stated: float) -> float:
    """Return the rate of frames at almost even times.

    This is the stated rate if the times allow it. Otherwise it is the nearest usual
    rate that they allow: a whole number, or 1000 / 1001 of one as in NTSC.

    Args:
        times: (T,) when each frame is shown, in seconds.
        off: By how many seconds a time differs at most from even ones.
        stated: The rate that the file states.

    """
    intervals = len(times) - 1
    lasted = float(times[-1] - times[0])
    rate = intervals / lasted
    # both the first and the last time may be wrong by `off`
    slack = max(STAMP + 2.0 * off, SAME_RATE * lasted)

    def miss(likely: float) -> float:
        return abs(intervals / likely - lasted)

    if stated > 0.0 and miss(stated) <= slack:
        return stated
    usual = [each for each in (float(round(rate)), round(rate * 1.001) / 1.001) if each]
    nearest = min(usual, key=miss, default=rate)
    return nearest if miss(nearest) <= slack else rate


class VideoWriter:
    """Writes an .mp4 file at the rate `video_rate`.

    The number of frames is checked at the end, because OpenCV does not report a full
    disk.
    """

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        self._path = path
        self._count = 0
        self._writer = cv2.VideoWriter(
            opencv_name(path), cv2.VideoWriter.fourcc(*CODE), video_rate(fps), size
        )
        if not self._writer.isOpened():
            raise InputError(
                f"expected OpenCV to write {CODE} video, got a build or a disk that "
                "cannot"
            )

    def write(self, image: Image) -> None:
        """Add a frame."""
        self._writer.write(image)
        self._count += 1

    def close(self) -> None:
        """Finish the file. Raises OSError if frames are missing in it."""
        self._writer.release()
        capture = cv2.VideoCapture(opencv_name(self._path))
        written = 0
        if capture.isOpened():
            written = round(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        capture.release()
        if written != self._count:
            raise OSError(
                errno.ENOSPC, f"room for {written} of {self._count} frames of video"
            )

    def __enter__(self) -> "VideoWriter":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self._writer.release()
