"""Small pictures of what was seen, as many and as fine as there is room for in a page.

Of a frame that was filmed there are two: the part about the person, and all of it, coarse.
"""

import base64
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np

from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.silhouette.rasteriser import NEAR

FRAMES = 1_200  # of a track at most; of longer ones every second, fourth, ... is shown
FILMED, MASKS = 4_500_000, 1_200_000  # characters of all frames that were filmed, and of all cameras' masks together
SPARE = 0.2  # of the room for what was filmed, as later frames may need more than the first
HIGHEST = 360  # pixels of a picture
# pixels of height and quality of JPEG, 0 to 100, of the part about the person and of the whole frame: the finest
# for which there is room
FINENESS = (
    ((HIGHEST, 75), (200, 50)),
    ((HIGHEST, 50), (200, 50)),
    ((288, 40), (180, 35)),
    ((216, 35), (120, 30)),
)
AROUND = 0.25  # of the larger side of a person's box, to each side

Fineness = tuple[tuple[int, int], tuple[int, int]]
Box = tuple[int, int, int, int]  # left, top, width and height in pixels of a camera


class Strip:
    """Keeps pictures of every frame, or of every second, fourth, ... once there is no more room."""

    def __init__(self, room: int, every: int) -> None:
        self.pictures: list[tuple[Box, list[str]]] = []
        self.every = every
        self._room, self._count = room, 0

    def add(self, box: Box, pictures: Callable[[], list[str]]) -> None:
        """Take the next frame, whose `pictures` are made if they are wanted; the first is of the box."""
        if self._count % self.every == 0:
            self.pictures.append((box, pictures()))
            while len(self.pictures) > 1 and sum(len(one) for _, each in self.pictures for one in each) > self._room:
                self.pictures = self.pictures[::2]
                self.every *= 2
        self._count += 1

    def as_dict(self) -> dict[str, Any]:
        """Return the pictures, and of how many frames each is the first."""
        return {"every": self.every, "pictures": [[list(box), *each] for box, each in self.pictures]}


class Album:
    """Pictures of what the first camera filmed, where one did, and the masks of all cameras, frame by frame.

    `step` is that of the frames shown: a power of two, so that every picture is of one of them.
    """

    def __init__(self, scene: Scene) -> None:
        self.step = 1
        while scene.count > FRAMES * self.step:
            self.step *= 2
        self._body, self._cameras = scene.body, scene.cameras
        self._wanted = -(-scene.count // self.step)
        self._fineness: Fineness | None = None  # not known before the first frame
        self._filmed = Strip(FILMED, self.step) if scene.pictures is not None else None
        self._masks = [Strip(MASKS // len(scene.cameras), self.step) for _ in scene.cameras]

    def add(self, frame: Frame, observation: Observation, filmed: Image | None) -> None:
        """Take the next frame."""
        masks = [silhouette.mask for silhouette in observation.silhouettes]
        boxes = [_about(one, self._body, camera, frame) for one, camera in zip(masks, self._cameras, strict=True)]
        if self._filmed is not None and filmed is not None:
            if self._fineness is None:
                each = int((1.0 - SPARE) * FILMED / self._wanted)
                fitting = (how for how in FINENESS if sum(map(len, _photographs(filmed, boxes[0], how))) <= each)
                self._fineness = next(fitting, FINENESS[-1])
            fineness = self._fineness
            self._filmed.add(boxes[0], lambda: _photographs(filmed, boxes[0], fineness))
        for strip, mask, box in zip(self._masks, masks, boxes, strict=True):
            strip.add(box, lambda mask=mask, box=box: [_png(mask, box)])  # type: ignore[misc]

    def as_dict(self) -> dict[str, Any]:
        """Return the pictures that there are, as a page's scripts read them."""
        return {
            "film": None if self._filmed is None else self._filmed.as_dict(),
            "masks": [strip.as_dict() for strip in self._masks],
        }


def _about(mask: Mask, body: Body, camera: Camera, frame: Frame) -> Box:
    """Return the part of a picture that holds the mask and the body, with some space about them."""
    pixels, depths = camera.project(body.skeleton.joints(frame.pose, frame.translation))
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    points = [pixels[depths > NEAR]]
    if len(rows):
        points.append(np.array([[columns[0], rows[0]], [columns[-1] + 1, rows[-1] + 1]]))
    size = np.array([camera.width, camera.height])
    inside = np.clip(np.concatenate(points), 0, size)
    if not len(inside):
        return (0, 0, camera.width, camera.height)
    low, high = inside.min(axis=0), inside.max(axis=0)
    space = AROUND * (high - low).max() + 1.0
    left, top = np.floor(np.clip(low - space, 0, size - 1)).astype(int).tolist()
    right, bottom = np.ceil(np.clip(high + space, 1, size)).astype(int).tolist()
    return (left, top, right - left, bottom - top)


def _cut(image: Image, box: Box) -> Image:
    left, top, width, height = box
    return image[top : top + height, left : left + width]


def _photographs(image: Image, box: Box, fineness: Fineness) -> list[str]:
    return [_jpeg(_cut(image, box), *fineness[0]), _jpeg(image, *fineness[1])]


def _jpeg(image: Image, height: int, quality: int) -> str:
    return _encoded(".jpg", _small(image, height), [cv2.IMWRITE_JPEG_QUALITY, quality])


def _png(mask: Mask, box: Box) -> str:
    """Return a part of a mask as a picture of one bit a pixel, white where the mask is."""
    small = 255 * _small(_cut(mask.astype(np.uint8), box), HIGHEST)
    return _encoded(".png", small, [cv2.IMWRITE_PNG_BILEVEL, 1])


def _small(image: Image, highest: int) -> Image:
    """Return a picture that is at most so high, and at most twice as wide as that."""
    height, width = image.shape[:2]
    factor = max(height / highest, width / (2 * highest))
    if factor <= 1.0:
        return image
    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _encoded(suffix: str, image: Any, how: list[int]) -> str:
    done, content = cv2.imencode(suffix, image, how)
    assert done
    kind = {".jpg": "jpeg", ".png": "png"}[suffix]
    return f"data:image/{kind};base64,{base64.b64encode(content.tobytes()).decode()}"
