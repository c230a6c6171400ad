"""What each frame's mask says of itself: how large it is, what moves beside it, and whether it is an empty place.

Nothing here knows the true mask. A mask is held against the picture it was taken from, the pictures shortly before, and
the background that was learned, where there is one.
"""

from collections import deque
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.silhouette.foreground import Image, Person
from posefit.silhouette.mask import Mask

LATEST = 15  # frames that a frame's area is compared with
CHANGE = 0.5  # a frame whose area is off by more than this share of the latest is not usable
# the area of a person's silhouette over the square of its longer side: 0.08 to 0.47 in 1,296 poses of the library seen
# from anywhere
FILL = (0.07, 0.5)
SMALLEST = 12  # pixels of the longer side below which nobody can be told from noise
LAG = 0.1  # seconds between two pictures that are compared for motion
MOVING = 25  # grey levels by which a pixel that moved has changed
ENOUGH = 0.1  # of the mask's area: fewer pixels that moved beside it say nothing
AROUND = 0.5  # of the person's longer side: motion is looked for as far as that from the mask
SLACK = 0.02  # of the same: motion as near as that to the mask is the mask's own
BESIDE = 0.5  # a frame is not usable where a larger share of what moves lies outside the mask
EDGE = 1.5  # an edge is in one picture and not in the other where it is so many times as strong there,
STEP = 6.0  # and by so many grey levels


class Watch:
    """Looks at one frame after the other; `rows` of what it says become quality.csv."""

    def __init__(self, fps: float, background: Image | None = None) -> None:
        self._edges = None if background is None else _edges(background)
        self._before: deque[tuple[Image, Mask]] = deque(maxlen=max(1, round(LAG * fps)))
        self._areas: deque[int] = deque(maxlen=LATEST)
        self._sides: deque[int] = deque(maxlen=LATEST)

    def look(self, image: Image, found: Person, frame: int) -> dict[str, Any]:
        """Return a frame's row: usable where the mask is whole, looks like a person and covers what moves.

        Its area must not be far from that of the frames before either, as far as they looked like a person.
        """
        side = _longer_side(found.mask)
        beside = self._beside(image, found, side)
        ghost = self._is_ghost(image, found.mask)
        whole = found.area > 0 and not found.touches_border
        likely = (
            whole and side >= SMALLEST and FILL[0] <= found.area / side**2 <= FILL[1] and beside <= BESIDE and not ghost
        )
        usual = float(np.median(self._areas)) if self._areas else float(found.area)
        jitter = abs(found.area / usual - 1.0) if usual else 0.0
        if likely:
            self._areas.append(found.area)
        if whole:
            self._sides.append(side)
        self._before.append((image, found.mask))
        return {
            "frame": frame,
            "area": found.area,
            "longer_side": side,
            "jitter": round(jitter, 4),
            "pieces": found.pieces,
            "rival": round(found.rival, 4),
            "touches_border": int(found.touches_border),
            "beside": round(beside, 4),
            "ghost": int(ghost),
            "usable": int(likely and jitter <= CHANGE),
        }

    def _beside(self, image: Image, found: Person, side: int) -> float:
        """Return which share of the pixels that moved, at the person and around, lies outside the mask."""
        if not self._before or not found.area:
            return 0.0
        then, mask = self._before[0]
        mine = found.mask | mask
        reach = max(side, *self._sides) if self._sides else side
        rows, columns = np.flatnonzero(mine.any(axis=1)), np.flatnonzero(mine.any(axis=0))
        far = round(AROUND * reach)
        window = np.s_[
            max(0, rows[0] - far) : rows[-1] + 1 + far,
            max(0, columns[0] - far) : columns[-1] + 1 + far,
        ]
        changed = changed_pixels(image, then)[window] & found.valid[window]
        width = 2 * max(1, round(SLACK * reach)) + 1
        near = cv2.dilate(mine[window].astype(np.uint8), np.ones((width, width), dtype=np.uint8)) > 0
        beside = int((changed & ~near).sum())
        return float(beside / changed.sum()) if beside > ENOUGH * found.area else 0.0

    def _is_ghost(self, image: Image, mask: Mask) -> bool:
        """Return whether the outline of a mask is an edge of the background rather than of the picture.

        It is where somebody who was learned into the background has gone.
        """
        if self._edges is None or not mask.any():
            return False
        inner = cv2.erode(mask.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) > 0
        outline = mask & ~inner
        now, before = _edges(image)[outline], self._edges[outline]
        return bool((before > EDGE * now + STEP).sum() > (now > EDGE * before + STEP).sum())


def changed_pixels(image: Image, then: Image) -> Mask:
    """Return which pixels (height, width) changed from one picture to another, but for single ones, which are noise."""
    changed = np.asarray(cv2.absdiff(image, then).max(axis=2) > MOVING, dtype=np.uint8)
    return np.asarray(cv2.medianBlur(changed, 5) > 0)


def _edges(image: Image) -> NDArray[np.float32]:
    """Return how strong an edge is at each pixel (height, width), or next to it, in grey levels a pixel."""
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    across, down = (cv2.Sobel(grey, cv2.CV_32F, *way, scale=0.125) for way in ((1, 0), (0, 1)))
    return np.asarray(cv2.dilate(cv2.magnitude(across, down), np.ones((3, 3), dtype=np.uint8)), dtype=np.float32)


def _longer_side(mask: Mask) -> int:
    """Return the longer side of a mask's bounding box, 0 where it is empty."""
    if not mask.any():
        return 0
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    return int(max(rows[-1] - rows[0], columns[-1] - columns[0])) + 1
