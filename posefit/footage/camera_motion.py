"""Whether the camera moves, by comparing pictures with the first one."""

from typing import Any

import cv2
import numpy as np

from posefit.footage.views import MOST
from posefit.silhouette.foreground import Image

MOVING_SHARE = 0.2  # share of the frames above which the camera counts as moving
COMPARED_EVERY = 5  # every fifth frame is compared with the first one
PICTURE_WIDTH = 160  # pixels: width of the pictures that are compared
TILES_A_SIDE = 4  # tiles per side of a picture
MIN_TILE_ROWS = 16  # rows of a tile: a wide picture is stretched until it has as many
NOISE_SIZE = 1.0  # pixels: smaller structures are filtered out as noise
# pixels: larger structures are filtered out, and tiles are searched this far around
MAX_SHIFT = 4
# grey levels per pixel: a tile that changes less along some axis shows no shift
MIN_TEXTURE = 0.7
FREE_SHARE = 0.25  # least share of these tiles that a person leaves free
# share of the width: a larger shift from the first frame means that the camera moved
MOVED_SHARE = 0.008


class CameraMotion:
    """Estimates whether the camera moves, by comparing pictures with the first one."""

    def __init__(self, size: tuple[int, int]) -> None:
        tall = round(PICTURE_WIDTH * size[1] / size[0])
        self._size = PICTURE_WIDTH, max(TILES_A_SIDE * MIN_TILE_ROWS, tall)
        # the tiles of the first picture; None for a tile without texture
        self._first: list[Any] | None = None
        self._shifts = list[float]()

    @property
    def moves(self) -> bool:
        """Whether the camera seems to move."""
        moved = sum(shift > MOVED_SHARE * PICTURE_WIDTH for shift in self._shifts)
        return moved > MOVING_SHARE * len(self._shifts)

    def add(self, k: int, image: Image) -> None:
        """Compare picture k with the first one, if it is its turn."""
        if k % COMPARED_EVERY == 0:
            self._shifts.append(self._shift(image))

    def _shift(self, image: Image) -> float:
        """Return the shift from the first picture, in pixels of the small pictures.

        A moving camera shifts every tile. A tile that a person covers may match
        anywhere. So the camera's shift is one that all textured tiles reach, except for
        a few. If most tiles have no texture, it is 0.
        """
        tiles = self._tiles(image)
        if self._first is None:
            inner = slice(MAX_SHIFT, -MAX_SHIFT)
            self._first = []
            for tile in tiles:
                self._first.append(tile[inner, inner] if _textured(tile) else None)
        shifts = list[float]()
        for before, now in zip(self._first, tiles, strict=True):
            if before is None:
                continue
            likeness = cv2.matchTemplate(now, before, cv2.TM_CCOEFF_NORMED)
            _, _, _, best = cv2.minMaxLoc(likeness)
            shifts.append(float(np.hypot(*np.subtract(best, MAX_SHIFT))))
        if len(shifts) <= MOST * TILES_A_SIDE**2:
            return 0.0
        return float(np.quantile(shifts, FREE_SHARE))

    def _tiles(self, image: Image) -> list[Any]:
        """Return the tiles of a picture, filtered to medium-sized structures."""
        resized = cv2.resize(image, self._size, interpolation=cv2.INTER_AREA)
        small = cv2.cvtColor(resized, cv2.COLOR_BGR2GRAY).astype(np.float32)
        # neither noise nor changing light may count as texture
        grey: Any = cv2.GaussianBlur(small, (0, 0), NOISE_SIZE)
        grey -= cv2.GaussianBlur(grey, (0, 0), MAX_SHIFT)
        wide, tall = (side // TILES_A_SIDE for side in self._size)
        tiles = list[Any]()
        for top in range(0, TILES_A_SIDE * tall, tall):
            for left in range(0, TILES_A_SIDE * wide, wide):
                tile = grey[top : top + tall, left : left + wide]
                tiles.append(np.ascontiguousarray(tile))
        return tiles


def _textured(tile: Any) -> bool:
    """Return whether a tile changes along every axis, so that it shows any shift."""
    down, across = np.gradient(tile)
    tensor = [
        [np.mean(across * across), np.mean(across * down)],
        [np.mean(across * down), np.mean(down * down)],
    ]
    return bool(np.linalg.eigvalsh(tensor)[0] > MIN_TEXTURE**2)
