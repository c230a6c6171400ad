"""Small pictures of footage and masks for a page of limited size.

Each frame of footage has two pictures: the part around the person, and the whole frame
at a coarser resolution.
"""

import base64
from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np

from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.silhouette.outlines import NEAR

MAX_FRAMES = 1_200  # longer tracks show every second, fourth, ... frame
# characters for all frames of footage, and for the masks of all cameras
MAX_FILM = 4_500_000
MAX_MASKS = 1_200_000
SPARE = 0.2  # this share is kept free: later frames may be larger than the first
MAX_HEIGHT = 360  # pixels of a picture
# height in pixels and JPEG quality, 0 to 100, of the part around the person and of the
# whole frame, finest first
FINENESS = (
    ((MAX_HEIGHT, 75), (200, 50)),
    ((MAX_HEIGHT, 50), (200, 50)),
    ((288, 40), (180, 35)),
    ((216, 35), (120, 30)),
)
MARGIN = 0.25  # on each side, as a share of the larger side of a person's box

Fineness = tuple[tuple[int, int], tuple[int, int]]
Box = tuple[int, int, int, int]  # left, top, width and height in a camera's pixels


class Strip:
    """Pictures of every frame, or of every second, fourth, ... to limit their size.

    Args:
        room: The most characters of all pictures.
        step: Which of the frames it gets: every `step`-th one.
    """

    def __init__(self, room: int, step: int) -> None:
        self.pictures: list[tuple[Any, ...]] = []  # a box and its pictures
        self.every = step  # every `every`-th frame has a picture
        self._step = step
        self._room = room
        self._count = 0

    def add(self, box: Box, pictures: Callable[[], list[str]]) -> None:
        """Take the next frame.

        `pictures` makes its pictures, of which the first shows the box. It is called
        only if the frame is kept.
        """
        if self._count % self.every == 0:
            self.pictures.append((box, *pictures()))
            # every second picture is dropped until the rest fit
            while len(self.pictures) > 1 and self._size() > self._room:
                self.pictures = self.pictures[::2]
                self.every *= 2
        self._count += self._step

    def _size(self) -> int:
        """Return the characters of all pictures."""
        return sum(len(text) for _, *texts in self.pictures for text in texts)

    def as_dict(self) -> dict[str, Any]:
        """Return the pictures, and the number of frames that each represents."""
        return {"every": self.every, "pictures": self.pictures}


class Stills:
    """Pictures of the first camera's footage, if any, and of all cameras' masks.

    The page shows every `step`-th frame, where `step` is a power of two, so that every
    picture belongs to a frame that the page shows.
    """

    def __init__(self, scene: Scene) -> None:
        self.step = 1
        while scene.count > MAX_FRAMES * self.step:
            self.step *= 2
        self._body = scene.body
        self._cameras = scene.cameras
        self._wanted = -(-scene.count // self.step)
        self._count = 0
        self._fineness: Fineness | None = None  # unknown before the first frame
        self._film: Strip | None = None
        if scene.pictures is not None:
            self._film = Strip(MAX_FILM, self.step)
        room = MAX_MASKS // len(scene.cameras)
        self._masks = [Strip(room, self.step) for _ in scene.cameras]

    def add(self, frame: Frame, observation: Observation, filmed: Image | None) -> None:
        """Take the next frame."""
        number = self._count
        self._count += 1
        # finding the person in the other frames of a long film would take minutes
        if number % self.step:
            return
        masks = [silhouette.mask for silhouette in observation.silhouettes]
        boxes = []
        for mask, camera in zip(masks, self._cameras, strict=True):
            boxes.append(_box(mask, self._body, camera, frame))
        if self._film is not None and filmed is not None:
            if self._fineness is None:
                each = int((1.0 - SPARE) * MAX_FILM / self._wanted)
                self._fineness = _finest(filmed, boxes[0], each)
            fineness = self._fineness
            self._film.add(boxes[0], lambda: _photographs(filmed, boxes[0], fineness))
        for strip, mask, box in zip(self._masks, masks, boxes, strict=True):
            strip.add(box, partial(_mask_picture, mask, box))

    def as_dict(self) -> dict[str, Any]:
        """Return the pictures as a page's scripts read them."""
        return {
            "film": None if self._film is None else self._film.as_dict(),
            "masks": [strip.as_dict() for strip in self._masks],
        }


def _finest(filmed: Image, box: Box, room: int) -> Fineness:
    """Return the finest setting whose pictures of a frame fit, else the coarsest."""
    for fineness in FINENESS:
        if sum(map(len, _photographs(filmed, box, fineness))) <= room:
            return fineness
    return FINENESS[-1]


def _box(mask: Mask, body: Body, camera: Camera, frame: Frame) -> Box:
    """Return the box around the mask and the body, with a margin."""
    pixels, depths = camera.project(body.skeleton.joints(frame.pose, frame.translation))
    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    points = [pixels[depths > NEAR]]
    if width:
        points.append(np.array([[left, top], [left + width, top + height]]))
    size = np.array([camera.width, camera.height])
    inside = np.clip(np.concatenate(points), 0, size)
    if not len(inside):
        return (0, 0, camera.width, camera.height)
    low = inside.min(axis=0)
    high = inside.max(axis=0)
    space = MARGIN * (high - low).max() + 1.0
    left, top = np.floor(np.clip(low - space, 0, size - 1)).astype(int).tolist()
    right, bottom = np.ceil(np.clip(high + space, 1, size)).astype(int).tolist()
    return (left, top, right - left, bottom - top)


def _cut(image: Image, box: Box) -> Image:
    left, top, width, height = box
    return image[top : top + height, left : left + width]


def _photographs(image: Image, box: Box, fineness: Fineness) -> list[str]:
    """Return the part in a box and the whole image, each as a JPEG for a page."""
    texts = []
    for picture, (height, quality) in zip(
        (_cut(image, box), image), fineness, strict=True
    ):
        parameters = [cv2.IMWRITE_JPEG_QUALITY, quality]
        texts.append(_encoded(".jpg", _small(picture, height), parameters))
    return texts


def _mask_picture(mask: Mask, box: Box) -> list[str]:
    """Return one picture: a part of a mask as a PNG of one bit per pixel."""
    small = 255 * _small(_cut(mask.astype(np.uint8), box), MAX_HEIGHT)
    return [_encoded(".png", small, [cv2.IMWRITE_PNG_BILEVEL, 1])]


def _small(image: Image, highest: int) -> Image:
    """Return a picture scaled down to `highest` in height and twice that in width."""
    height, width = image.shape[:2]
    factor = max(height / highest, width / (2 * highest))
    if factor <= 1.0:
        return image
    size = (max(1, round(width / factor)), max(1, round(height / factor)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _encoded(suffix: str, image: Any, parameters: list[int]) -> str:
    done, content = cv2.imencode(suffix, image, parameters)
    assert done
    kind = suffix[1:].replace("jpg", "jpeg")
    text = base64.b64encode(content.tobytes()).decode()
    return f"data:image/{kind};base64,{text}"
