"""Write video."""

import errno
from pathlib import Path

import cv2
import numpy as np

from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.silhouette.foreground import Image

CODE = "mp4v"
# MPEG-4 divides a second into at most this many ticks, and OpenCV passes it the rate as
# a decimal fraction with at most three places
MAX_TICKS = 65_535
WRITTEN_RATES = 0.01, 60_000.0  # frames per second that OpenCV can write


def video_rate(fps: float) -> float:
    """Return the rate that an .mp4 file states for `fps`: 119.88 for 119.8765.

    It is rounded to three decimals up to 65 frames per second, to two up to 655, and to
    one above.
    """
    rate = float(np.clip(fps, *WRITTEN_RATES))
    digits = next(digits for digits in (3, 2, 1, 0) if rate * 10**digits <= MAX_TICKS)
    return round(rate, digits)


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
                f"OpenCV cannot write {CODE} video here: check the disk, or install "
                "opencv-python-headless, which has FFmpeg"
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
