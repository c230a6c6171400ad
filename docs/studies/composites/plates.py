"""Empty pictures of a real place, as a camera sees them one after the other: leaves that move, light, and noise.

They are made of the demonstration video of Sports2D: the median of its frames in which a part of the picture is empty,
and what its first second differs by. Several cameras see other parts of it, some mirrored.
"""

from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.footage.video import Video
from posefit.silhouette.foreground import Image

FILMED = (1768, 994)  # pixels of the video
EMPTY = (0, 8, 16, 24, 30, *range(216, 230))  # frames, an odd number: a pixel is empty in most of them
LIVING = 31  # frames from the first, whose difference from the empty picture is what lives in it
PEOPLE = 25  # grey levels: where it ever differs by more, somebody is there
SEEN = (1240, 697)  # pixels of the part that one camera sees
CORNERS = ((260, 297), (0, 297), (120, 250), (330, 200))  # left and top of that of each camera
FLICKER = 0.012  # of the brightness, slowly; and a third as much from frame to frame
NOISE = 2.0  # grey levels, of the sensor


@dataclass(frozen=True, eq=False)
class Plate:
    """The empty pictures of one camera."""

    still: NDArray[np.float32] = field(repr=False)  # (height, width, 3)
    living: NDArray[np.int8] = field(repr=False)  # (frames, height, width, 3), added to it

    def frame(self, k: int) -> NDArray[np.float32]:
        """Return the picture of frame k, without flicker or noise: to and fro through what lives."""
        last = len(self.living) - 1
        return np.asarray(self.still + self.living[last - abs(k % (2 * last) - last)])


def plate(video: str | Path, camera: int, size: tuple[int, int]) -> Plate:
    """Return the empty pictures of a camera by its number."""
    still, living = _empty(str(video))
    left, top = CORNERS[camera % len(CORNERS)]
    part = np.s_[top : top + SEEN[1], left : left + SEEN[0]]

    def scaled(image: Any) -> Any:
        seen = cv2.resize(image[part].astype(np.float32), size, interpolation=cv2.INTER_AREA)
        return seen[:, ::-1] if camera % 2 else seen

    return Plate(scaled(still), np.stack([scaled(one).astype(np.int8) for one in living]))


def sensed(image: NDArray[np.float32], k: int, rng: np.random.Generator) -> Image:
    """Return what a sensor makes of the picture of frame k."""
    gain = 1.0 + FLICKER * (np.sin(0.21 * k) + rng.normal() / 3.0)
    noise = NOISE * rng.standard_normal(image.shape, dtype=np.float32)
    return np.asarray(np.clip(gain * image + noise, 0.0, 255.0).astype(np.uint8))


def check_video(path: str) -> Video:
    """Return the video of empty pictures. Raises ValueError where it is another one."""
    video, frames = Video.of(path), max(EMPTY) + 1
    count = video.count() if video.size == FILMED else 0
    if count != frames:
        wanted, came = (f"{width}x{height}" for width, height in (FILMED, video.size))
        wanted, came = f"{wanted} pixels and {frames} frames", f"{came} and {count} frames" if count else f"{came}"
        raise ValueError(f"{path}: expected the demonstration video of Sports2D, {wanted}, got {came}")
    return video


@lru_cache(maxsize=1)
def _empty(path: str) -> tuple[NDArray[np.float32], list[NDArray[np.int8]]]:
    """Return the whole empty picture, and what the first frames differ from it by where nobody is."""
    video = check_video(path)
    frames = {k: image for k, image in enumerate(video.frames(0, None, FILMED)) if k in EMPTY or k < LIVING}
    half = len(EMPTY) // 2  # of an odd number: the median is one of them
    still = np.partition([frames[k] for k in EMPTY], half, axis=0)[half].astype(np.float32)
    most, away = np.zeros(still.shape[:2], dtype=np.float32), []
    for k in range(LIVING):
        differs = frames[k].astype(np.float32) - still
        most = np.maximum(most, cv2.GaussianBlur(np.abs(differs).max(axis=2), (0, 0), 4.0))
        away.append(np.clip(differs, -128.0, 127.0).astype(np.int8))  # a quarter of the memory
    somebody = cv2.dilate((most > PEOPLE).astype(np.uint8), np.ones((41, 41), dtype=np.uint8)) > 0
    for one in away:
        one[somebody] = 0
    return still, away
