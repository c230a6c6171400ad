"""Reads video, or pictures of a film, frame by frame, so that memory does not grow with its length."""

import errno
import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import repeat
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.footage.images import PIXELS, page_count, read_image
from posefit.footage.readers import Images
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import Image

HEAD = 2_000  # bytes at the beginning of a file by which a text is recognised
SQUARE = 0.02  # by how much the sides of a pixel may differ
Order = NDArray[np.int64]  # (T,) numbers of frames
CODE = "mp4v"
# MPEG-4 counts time in at most so many parts of a second, and OpenCV gives it a rate as
# a decimal fraction of at most three places
MAX_TICKS = 65_535
WRITTEN_RATES = 0.01, 60_000.0  # frames a second of a file that OpenCV writes
# of the distance between frames: one that comes so much too early or too late is not in
# its place
UNEVEN = 0.75
# seconds that the times of frames are rounded to in many files
STAMP = 1e-3
# by which share the length of a film may differ from its rate's without a word
SAME_RATE = 5e-3
# times the mean rate: frames are not taken more often, however short some of them are
DENSEST = 4.0
# posefit reports once what is wrong with a file; a user may set the variable to get FFmpeg's own messages
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


@dataclass(frozen=True)
class Video:
    """A film: a video file, opened again for each pass through its frames, or pictures, one a frame."""

    path: Path
    fps: float
    size: tuple[int, int]  # width and height in pixels, as filmed
    claimed: int = 0  # frames, by what the file says of itself; 0 where it says nothing
    # images, or their files and pages; of a video file none
    pictures: Sequence[tuple[Path, int] | Image] = field(
        default=(), repr=False, compare=False
    )
    warnings: Sequence[str] = ()  # what a user should know of its frames
    guesses: Sequence[str] = ()  # what it does not state
    # of the file's frames: one for each moment
    _order: Order = field(kw_only=True, repr=False, compare=False)
    # (T,) at that moment
    _filmed: NDArray[np.bool_] = field(kw_only=True, repr=False, compare=False)

    @classmethod
    def of(cls, path: str | Path) -> "Video":
        """Return a video. Raises InputError where the file is missing, cannot be read or has no frame."""
        path = Path(path)
        if not path.is_file():
            came = "a folder" if path.is_dir() else "nothing of that name"
            raise InputError(f"{path}: expected a video file, got {came}")
        _check_no_text(path)
        capture = cv2.VideoCapture(opencv_name(path))
        try:
            wide, tall = (
                capture.get(key)
                for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
            )
            if wide * tall > PIXELS:
                most = f"{PIXELS // 10**6} million pixels"
                raise InputError(
                    f"{path}: expected frames of at most {most}, got {wide:.0f}x{tall:.0f}"
                )
            read, image = capture.read()
            if not read:
                raise InputError(
                    f"{path}: expected a video that OpenCV can read, got none or one without frames"
                )
            fps, claimed, across, down = (
                float(capture.get(key))
                for key in (
                    cv2.CAP_PROP_FPS,
                    cv2.CAP_PROP_FRAME_COUNT,
                    cv2.CAP_PROP_SAR_NUM,
                    cv2.CAP_PROP_SAR_DEN,
                )
            )
            _check_written(path, image, capture)
        finally:
            capture.release()
        stated = np.isfinite(fps) and 0.0 < fps <= 1000.0
        moments = _moments(path)
        order, filmed, rate = _even(moments, fps if stated else FPS)
        warnings = []
        if across > 0.0 < down and abs(across / down - 1.0) > SQUARE:
            aspect = f"{across / down:.3g} times as wide as high"
            warnings.append(
                f"{path}: its pixels are {aspect}, which is not corrected: the person looks that much too slim"
            )
        if uneven := bool((np.diff(order) != 1).any()):
            held = np.count_nonzero(~filmed)
            warnings.append(
                f"{path}: its frames come at uneven times; it is sampled {rate:.3g} times a second, so that {held} of "
                f"{len(order)} frames stand for moments without a filmed one, and are held"
            )
        guesses = []
        by_stamps = rate != (fps if stated else FPS)
        if not stated:
            unsaid = (
                "by its frames' times" if by_stamps else "which the file does not state"
            )
            guesses.append(f"{path}: {rate:.4g} frames a second, {unsaid}")
        elif by_stamps and not uneven:
            guesses.append(
                f"{path}: {rate:.4g} frames a second by its frames' times, where its head says {fps:.4g}"
            )
        size = image.shape[1], image.shape[0]
        video = cls(
            path,
            rate,
            size,
            warnings=warnings,
            guesses=guesses,
            _order=order,
            _filmed=filmed,
        )
        # what a file says counts the frames as they were filmed, often by its length and the rate in its head
        return (
            replace(video, claimed=int(claimed))
            if 0.0 < claimed < 1e9 and not (uneven or by_stamps)
            else video
        )

    @classmethod
    def of_images(cls, images: Sequence[Image], name: Path, fps: float) -> "Video":
        """Return the film of images in memory."""
        order = np.arange(len(images))
        size = (images[0].shape[1], images[0].shape[0])
        return cls(name, fps, size, pictures=images, _order=order, _filmed=order >= 0)

    @classmethod
    def of_pictures(cls, images: Images, fps: float | None = None) -> "Video":
        """Return the film of pictures, 30 a second by default, in which a missing number holds the one before it."""
        assert images.numbered is not None
        files = [file for file in images.numbered.files if file is not None]
        guesses = list(images.numbered.guesses)
        pictures: list[tuple[Path, int] | Image] = [
            (file, page) for file in files for page in range(page_count(file))
        ]
        image = _picture(pictures[0])
        filmed = np.array([file is not None for file in images.numbered.files])
        # a film that begins with missing pictures holds the first one
        order = np.maximum(np.cumsum(filmed) - 1, 0)
        if len(pictures) > len(files):
            order = np.arange(len(pictures))
            filmed = np.ones(len(pictures), dtype=bool)
        size = image.shape[1], image.shape[0]
        if fps is None:
            guesses.append(f"{FPS:g} frames a second")
        return cls(
            Path(images.name),
            fps or FPS,
            size,
            0,
            pictures,
            guesses=guesses,
            _order=order,
            _filmed=filmed,
        )

    def frames(
        self, start: int, stop: int | None, size: tuple[int, int], step: int = 1
    ) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop, scaled to `size`.

        Raises InputError where a frame has another size than the first.
        """
        # a frame may stand for several moments
        wanted = Counter(self._order[start:stop:step].tolist())
        decoded = (
            (_picture(self.pictures[k]) for k in wanted)
            if self.pictures
            else self._decoded(list(wanted))
        )
        for (number, times), image in zip(wanted.items(), decoded, strict=False):
            if (image.shape[1], image.shape[0]) != self.size:
                came = f"{image.shape[1]}x{image.shape[0]} in frame {number}"
                raise InputError(
                    f"{self.path}: expected frames of {self.size[0]}x{self.size[1]}, got {came}"
                )
            yield from repeat(scaled(image, size), times)

    def _decoded(self, numbers: Sequence[int]) -> Iterator[Image]:
        """Yield the frames of these numbers of a video file, as far as it can be read."""
        capture = cv2.VideoCapture(opencv_name(self.path))
        k = -1
        try:
            for number in numbers:
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
        """Return how many frames there are: what a file says of itself is often wrong."""
        return len(self._order)

    def is_filmed(self, k: int) -> bool:
        """Return whether frame k was filmed at its time; else it is the frame before or after it once more."""
        return bool(self._filmed[k])


def _picture(source: tuple[Path, int] | Image) -> Image:
    if isinstance(source, np.ndarray):
        return source
    file, page = source
    image = read_image(file, grey=False, page=page)
    if image is None:
        raise InputError(f"{file}: expected a picture, got a file that is none")
    return image


def _check_no_text(path: Path) -> None:
    """Raise InputError for a text, such as a playlist, by which FFmpeg would open other files."""
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
    """Raise InputError where all frames are the same.

    OpenCV 4.13 to 5.0 do not convert interlaced frames, and return what was in memory before.
    """
    more, image = capture.read()
    if not more:
        return
    while more:
        if not np.array_equal(first, image):
            return
        more, image = capture.read()
    raise InputError(
        f"{path}: expected a film, got the same picture in all frames; if it is interlaced, which this OpenCV cannot "
        "read: ffmpeg -i FILE -vf yadif NEW.mp4"
    )


def scaled(image: Any, size: tuple[int, int]) -> Image:
    """Return a picture scaled to a width and a height: by a whole number first, which takes a tenth of the time."""
    wide = image.shape[1]
    tall = image.shape[0]
    whole = min(wide // size[0], tall // size[1])
    if whole > 1 and wide % whole == tall % whole == 0:
        image = cv2.resize(
            image, (wide // whole, tall // whole), interpolation=cv2.INTER_AREA
        )
    return np.asarray(
        cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8
    )


def _moments(path: Path) -> Array:
    """Return when each frame is shown, in seconds, by going through them."""
    capture = cv2.VideoCapture(opencv_name(path))
    times = []
    while capture.grab():
        times.append(capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3)
    capture.release()
    return np.array(times)


def _even(times: Array, fps: float) -> tuple[Order, NDArray[np.bool_], float]:
    """Return which frames are shown at even times, which of them then, and how many a second: all, if they are even.

    Frames at uneven times are taken at their usual distance, each moment the one that is nearest to it.
    """
    whole = np.arange(len(times))
    apart = np.diff(times)
    if len(times) < 3 or not (apart > 0.0).all():  # a file that does not say
        return whole, whole >= 0, fps
    mean = float(apart.mean())
    off = float(np.abs(times - times[0] - mean * whole).max())
    if off <= UNEVEN * mean:
        return whole, whole >= 0, _rate(times, off, fps)
    usual = max(float(np.median(apart)), mean / DENSEST)
    # stamps are rounded
    usual = float(apart.sum() / np.maximum(np.round(apart / usual), 1.0).sum())
    moments = times[0] + usual * np.arange(round((times[-1] - times[0]) / usual) + 1)
    later = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    earlier = moments - times[later - 1] <= times[later] - moments
    order = np.where(earlier, later - 1, later)
    off = np.abs(times[order] - moments)
    least = np.full(len(times), np.inf)
    np.minimum.at(least, order, off)
    return order, off == least[order], 1.0 / usual


def video_rate(fps: float) -> float:
    """Return the rate that an .mp4 file has for `fps`: 119.88 for 119.8765.

    It is rounded to three decimals up to 65 frames a second, to two up to 655, and to one above.
    """
    rate = float(np.clip(fps, *WRITTEN_RATES))
    digits = next(digits for digits in (3, 2, 1, 0) if rate * 10**digits <= MAX_TICKS)
    return round(rate, digits)


def _rate(times: Array, off: float, stated: float) -> float:
    """Return how many frames a second come at even times, which are `off` seconds off at most.

    It is the stated rate where the times allow it, or else the nearest whole rate, or 1000 / 1001 of one, that they do.
    """
    intervals = len(times) - 1
    lasted = float(times[-1] - times[0])
    rate = intervals / lasted
    # the first and the last may be off by as much
    slack = max(STAMP + 2.0 * off, SAME_RATE * lasted)

    def miss(likely: float) -> float:
        return abs(intervals / likely - lasted)

    if stated > 0.0 and miss(stated) <= slack:
        return stated
    usual = [each for each in (float(round(rate)), round(rate * 1.001) / 1.001) if each]
    nearest = min(usual, key=miss, default=rate)
    return nearest if miss(nearest) <= slack else rate


class VideoWriter:
    """Writes an .mp4 whose number of frames is checked at the end: OpenCV says nothing when the disk is full.

    Its rate is `video_rate`, which is rounded.
    """

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        self._path = path
        self._count = 0
        self._writer = cv2.VideoWriter(
            opencv_name(path), cv2.VideoWriter.fourcc(*CODE), video_rate(fps), size
        )
        if not self._writer.isOpened():
            raise InputError(
                f"expected OpenCV to write {CODE} video, got a build or a disk that cannot"
            )

    def write(self, image: Image) -> None:
        """Add a frame."""
        self._writer.write(image)
        self._count += 1

    def close(self) -> None:
        """Finish the file. Raises OSError where it does not hold all frames."""
        self._writer.release()
        capture = cv2.VideoCapture(opencv_name(self._path))
        written = (
            round(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
        )
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
