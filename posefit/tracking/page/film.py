"""Small pictures of what was seen, as many as there is room for in a page."""

import base64
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask

FRAMES = 1_200  # of a track at most; of longer ones every second, fourth, ... is shown
FILMED, MASKS = 4_500_000, 1_200_000  # characters of all frames that were filmed, and of all cameras' masks together
HIGHEST = 360  # pixels of a picture
# pixels of height and quality of JPEG, 0 to 100: the first for which there is room, by the size of the first frame
FINENESS = ((HIGHEST, 70), (HIGHEST, 50), (HIGHEST, 35), (288, 35), (216, 35))
SPARE = 0.2  # of the room, as later frames may be larger


class Strip:
    """Keeps pictures of every frame, or of every second, fourth, ... once there is no more room."""

    def __init__(self, room: int, every: int) -> None:
        self.pictures: list[str] = []
        self.every = every
        self._room, self._count = room, 0

    def add(self, picture: Callable[[], str]) -> None:
        """Take the next frame, of which `picture` makes a picture if it is wanted."""
        if self._count % self.every == 0:
            self.pictures.append(picture())
            while len(self.pictures) > 1 and sum(map(len, self.pictures)) > self._room:
                self.pictures = self.pictures[::2]
                self.every *= 2
        self._count += 1

    def as_dict(self) -> dict[str, Any]:
        """Return the pictures, and of how many frames each is the first."""
        return {"every": self.every, "pictures": self.pictures}


class Film:
    """What the first camera filmed, where one did, and the masks of all cameras, frame by frame.

    `step` is that of the frames shown: a power of two, so that every picture is of one of them.
    """

    def __init__(self, scene: Scene) -> None:
        self.step = 1
        while scene.count > FRAMES * self.step:
            self.step *= 2
        self._wanted = -(-scene.count // self.step)
        self._fineness: tuple[int, int] | None = None  # not known before the first frame
        self._filmed = Strip(FILMED, self.step) if scene.pictures is not None else None
        self._masks = [Strip(MASKS // len(scene.cameras), self.step) for _ in scene.cameras]

    def add(self, observation: Observation, filmed: Image | None) -> None:
        """Take the next frame."""
        if self._filmed is not None and filmed is not None:
            if self._fineness is None:
                room = (1.0 - SPARE) * FILMED
                fitting = (how for how in FINENESS if self._wanted * len(_jpeg(filmed, *how)) <= room)
                self._fineness = next(fitting, FINENESS[-1])
            height, quality = self._fineness
            self._filmed.add(lambda: _jpeg(filmed, height, quality))
        for strip, silhouette in zip(self._masks, observation.silhouettes, strict=True):
            strip.add(lambda mask=silhouette.mask: _png(mask))  # type: ignore[misc]

    def as_dict(self) -> dict[str, Any]:
        """Return the pictures that there are, as a page's scripts read them."""
        return {
            "film": None if self._filmed is None else self._filmed.as_dict(),
            "masks": [strip.as_dict() for strip in self._masks],
        }


def _jpeg(image: Image, height: int, quality: int) -> str:
    return _encoded(".jpg", _small(image, height), [cv2.IMWRITE_JPEG_QUALITY, quality])


def _png(mask: Mask) -> str:
    """Return a mask as a picture of one bit a pixel, white where the mask is."""
    return _encoded(".png", 255 * _small(mask.astype(np.uint8)), [cv2.IMWRITE_PNG_BILEVEL, 1])


def _small(image: Image, highest: int = HIGHEST) -> Image:
    height, width = image.shape[:2]
    if height <= highest:
        return image
    size = (max(1, round(width * highest / height)), highest)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _encoded(suffix: str, image: Any, how: list[int]) -> str:
    done, content = cv2.imencode(suffix, image, how)
    assert done
    kind = {".jpg": "jpeg", ".png": "png"}[suffix]
    return f"data:image/{kind};base64,{base64.b64encode(content.tobytes()).decode()}"
