"""Reads video frame by frame, so that memory does not grow with its length."""

import errno
import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.images import PIXELS
from posefit.silhouette.foreground import Image

Order = NDArray[np.int64]  # (T,) numbers of frames
CODE = "mp4v"
UNEVEN = 0.75  # of the distance between frames: one that comes so much too early or too late is not in its place
DENSEST = 4.0  # times the mean rate: frames are not taken more often, however short some of them are
# posefit reports once what is wrong with a file; a user may set the variable to get FFmpeg's own messages
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


@dataclass(frozen=True)
class Video:
    """A video file, opened again for each pass through its frames."""

    path: Path
    fps: float
    size: tuple[int, int]  # width and height in pixels, as filmed
    claimed: int = 0  # frames, by what the file says of itself; 0 where it says nothing
    _order: Order = field(kw_only=True, repr=False, compare=False)  # of the file's frames: one for each moment
    _filmed: NDArray[np.bool_] = field(kw_only=True, repr=False, compare=False)  # (T,) at that moment

    @classmethod
    def of(cls, path: str | Path) -> "Video":
        """Return a video. Raises InputError where the file is missing, cannot be read or has no frame."""
        path = Path(path)
        if not path.is_file():
            came = "a folder" if path.is_dir() else "nothing of that name"
            raise InputError(f"{path}: expected a video file, got {came}")
        capture = cv2.VideoCapture(str(path))
        try:
            wide, tall = (capture.get(key) for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
            if wide * tall > PIXELS:
                most = f"{PIXELS // 10**6} million pixels"
                raise InputError(f"{path}: expected frames of at most {most}, got {wide:.0f}x{tall:.0f}")
            read, image = capture.read()
            if not read:
                raise InputError(f"{path}: expected a video that OpenCV can read, got none or one without frames")
            fps = float(capture.get(cv2.CAP_PROP_FPS))
            claimed = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        finally:
            capture.release()
        rate = fps if np.isfinite(fps) and 0.0 < fps <= 1000.0 else 30.0
        order, filmed, rate = _even(_moments(path), rate)
        video = cls(path, rate, (image.shape[1], image.shape[0]), _order=order, _filmed=filmed)
        # what a file says counts the frames as they were filmed
        return replace(video, claimed=int(claimed)) if 0.0 < claimed < 1e9 and not video.uneven else video

    def frames(self, start: int, stop: int | None, size: tuple[int, int], step: int = 1) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop, scaled to `size`.

        Raises InputError where a frame has another size than the first.
        """
        wanted = self._order[start:stop:step]
        capture = cv2.VideoCapture(str(self.path))
        try:
            k, image = -1, None
            for number in wanted.tolist():
                while k < number - 1 and capture.grab():
                    k += 1
                if k < number:
                    read, filmed = capture.read()
                    if not read:
                        return
                    k += 1
                    if (filmed.shape[1], filmed.shape[0]) != self.size:
                        came = f"{filmed.shape[1]}x{filmed.shape[0]} in frame {k}"
                        raise InputError(f"{self.path}: expected frames of {self.size[0]}x{self.size[1]}, got {came}")
                    image = scaled(filmed, size)
                assert image is not None
                yield image
        finally:
            capture.release()

    def count(self) -> int:
        """Return how many frames there are: what a file says of itself is often wrong."""
        return len(self._order)

    def is_filmed(self, k: int) -> bool:
        """Return whether frame k was filmed at its time; else it is the frame before or after it once more."""
        return bool(self._filmed[k])

    @property
    def warnings(self) -> list[str]:
        """What a user should know of its frames' times."""
        if not self.uneven:
            return []
        held = np.count_nonzero(~self._filmed)
        return [
            f"{self.path}: its frames come at uneven times; it is sampled {self.fps:.3g} times a second, so that "
            f"{held} of {self.count()} frames stand for moments without a filmed one, and are held"
        ]

    @property
    def uneven(self) -> bool:
        """Whether its frames come at times so uneven that some are taken twice, or none at all."""
        return bool((np.diff(self._order) != 1).any())


def scaled(image: Any, size: tuple[int, int]) -> Image:
    """Return a picture scaled to a width and a height: by a whole number first, which takes a tenth of the time."""
    wide, tall = image.shape[1], image.shape[0]
    whole = min(wide // size[0], tall // size[1])
    if whole > 1 and wide % whole == tall % whole == 0:
        image = cv2.resize(image, (wide // whole, tall // whole), interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _moments(path: Path) -> Array:
    """Return when each frame is shown, in seconds, by going through them."""
    capture, times = cv2.VideoCapture(str(path)), []
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
    if np.abs(times - times[0] - mean * whole).max() <= UNEVEN * mean:
        return whole, whole >= 0, fps
    usual = max(float(np.median(apart)), mean / DENSEST)
    usual = float(apart.sum() / np.maximum(np.round(apart / usual), 1.0).sum())  # stamps are rounded
    moments = times[0] + usual * np.arange(round((times[-1] - times[0]) / usual) + 1)
    later = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    earlier = moments - times[later - 1] <= times[later] - moments
    order = np.where(earlier, later - 1, later)
    off = np.abs(times[order] - moments)
    least = np.full(len(times), np.inf)
    np.minimum.at(least, order, off)
    return order, off == least[order], 1.0 / usual


class VideoWriter:
    """Writes an .mp4 whose number of frames is checked at the end: OpenCV says nothing when the disk is full."""

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        self._path, self._count = path, 0
        self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*CODE), fps, size)
        if not self._writer.isOpened():
            raise InputError(f"{path}: expected OpenCV to write {CODE} video, got a build or a disk that cannot")

    def write(self, image: Image) -> None:
        """Add a frame."""
        self._writer.write(image)
        self._count += 1

    def close(self) -> None:
        """Finish the file. Raises OSError where it does not hold all frames."""
        self._writer.release()
        capture = cv2.VideoCapture(str(self._path))
        written = round(capture.get(cv2.CAP_PROP_FRAME_COUNT)) if capture.isOpened() else 0
        capture.release()
        if written != self._count:
            raise OSError(errno.ENOSPC, f"room for {written} of {self._count} frames of video")

    def __enter__(self) -> "VideoWriter":
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self._writer.release()
