"""A video as a segmenter may look at it: at the working size, and no farther than the roi."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.footage.images import read_image
from posefit.footage.video import Video
from posefit.silhouette.foreground import Image

T = TypeVar("T", bound=np.generic)
Box = tuple[int, int, int, int]  # x, y, width, height


@dataclass(frozen=True)
class VideoFootage:
    """A video scaled to `size` and cut to `part`, x, y, width and height in its scaled pixels."""

    video: Video
    size: tuple[int, int]
    part: Box

    def __len__(self) -> int:
        return self._count

    @cached_property
    def _count(self) -> int:
        return self.video.count()

    def frames(self, start: int = 0, stop: int | None = None, step: int = 1) -> Iterator[Image]:
        """Yield every `step`th frame of start to stop."""
        return map(self.cut, self.video.frames(start, stop, self.size, step))

    def picture(self, path: str) -> Image:
        """Return a picture of the video's size as the video shows it. Raises ValueError where there is none."""
        image = read_image(path, grey=False)
        if image is None:
            raise ValueError(f"background must be frames A:B or an image, got {path!r}")
        came, wanted = (image.shape[1], image.shape[0]), self.video.size
        if came != wanted:
            raise ValueError(
                f"{path}: background must have the video's size {wanted[0]}x{wanted[1]}, got {came[0]}x{came[1]}"
            )
        return self.cut(np.asarray(cv2.resize(image, self.size, interpolation=cv2.INTER_AREA), dtype=np.uint8))

    def cut(self, image: NDArray[T]) -> NDArray[T]:
        """Return the part of a scaled frame or mask (height, width, ...) that a segmenter gets to see."""
        x, y, wide, tall = self.part
        return np.ascontiguousarray(image[y : y + tall, x : x + wide])
