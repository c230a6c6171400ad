"""Reads video frame by frame, so that memory does not grow with its length."""

import errno
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from posefit.footage.images import PIXELS
from posefit.silhouette.foreground import Image

CODE = "mp4v"
# what is wrong with a file is said once, by us; a user who wants to hear FFmpeg may set it himself
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")


@dataclass(frozen=True)
class Video:
    """A video file, opened anew each time its frames are asked for."""

    path: Path
    fps: float
    size: tuple[int, int]  # width and height in pixels, as filmed
    claimed: int = 0  # frames, by what the file says of itself; 0 where it says nothing

    @classmethod
    def of(cls, path: str | Path) -> "Video":
        """Return a video. Raises ValueError where the file is missing, cannot be read or has no frame."""
        path = Path(path)
        if not path.is_file():
            came = "a folder" if path.is_dir() else "nothing of that name"
            raise ValueError(f"{path}: expected a video file, got {came}")
        capture = cv2.VideoCapture(str(path))
        try:
            wide, tall = (capture.get(one) for one in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
            if wide * tall > PIXELS:
                most = f"{PIXELS // 10**6} million pixels"
                raise ValueError(f"{path}: expected frames of at most {most}, got {wide:.0f}x{tall:.0f}")
            read, image = capture.read()
            if not read:
                raise ValueError(f"{path}: expected a video that OpenCV can read, got none or one without frames")
            fps = float(capture.get(cv2.CAP_PROP_FPS))
            claimed = float(capture.get(cv2.CAP_PROP_FRAME_COUNT))
        finally:
            capture.release()
        rate = fps if np.isfinite(fps) and 0.0 < fps <= 1000.0 else 30.0
        return cls(path, rate, (image.shape[1], image.shape[0]), int(claimed) if 0.0 < claimed < 1e9 else 0)

    def frames(self, start: int, stop: int | None, size: tuple[int, int], step: int = 1) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop, scaled to `size`.

        Raises ValueError where a frame has another size than the first.
        """
        capture = cv2.VideoCapture(str(self.path))
        try:
            k = 0
            while stop is None or k < stop:
                if k < start or (k - start) % step:
                    if not capture.grab():
                        return
                else:
                    read, image = capture.read()
                    if not read:
                        return
                    if (image.shape[1], image.shape[0]) != self.size:
                        came = f"{image.shape[1]}x{image.shape[0]} in frame {k}"
                        raise ValueError(f"{self.path}: expected frames of {self.size[0]}x{self.size[1]}, got {came}")
                    yield np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
                k += 1
        finally:
            capture.release()

    def count(self) -> int:
        """Return how many frames there are, by going through them: what a file says of itself is often wrong."""
        capture, count = cv2.VideoCapture(str(self.path)), 0
        while capture.grab():
            count += 1
        capture.release()
        return count


class VideoWriter:
    """Writes an .mp4 whose number of frames is checked at the end: OpenCV says nothing when the disk is full."""

    def __init__(self, path: Path, fps: float, size: tuple[int, int]) -> None:
        self._path, self._count = path, 0
        self._writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*CODE), fps, size)
        if not self._writer.isOpened():
            raise ValueError(f"{path}: expected OpenCV to write {CODE} video, got a build or a disk that cannot")

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
