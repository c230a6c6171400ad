"""How much of what moves in the pictures the fitted body covers: it needs no mask to be right."""

from collections import deque
from collections.abc import Iterator, Sequence

import cv2
import numpy as np

from posefit.fitting.tracker import Frame
from posefit.footage.quality import AROUND, LAG, changed_pixels
from posefit.footage.scene import Scene
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.tracking.trust.signs import longer_side

CLOTHES = 0.05  # of the person's longer side: motion as near as that to the body is its own clothes' and hair's
FEW = 0.02  # of the body's area: fewer pixels that moved are noise


def explained(scene: Scene, frames: Sequence[Frame], usable: Sequence[bool]) -> float | None:
    """Return which share of the pixels that move, at the person and around, the fitted body covers.

    The pixels of all usable frames count together, as the first camera filmed them. None where nobody filmed, or
    nothing moves.
    """
    if scene.pictures is None:
        return None
    counts = [count for count, ok in zip(_counts(scene, frames, scene.pictures()), usable, strict=False) if ok]
    inside, all_of_them = np.sum(counts, axis=0) if counts else (0, 0)
    return float(inside / all_of_them) if all_of_them else None


def covered(image: Image, then: Image, body: Mask, seen: Mask, reach: float) -> tuple[int, int]:
    """Return how many pixels that moved since another picture lie at the body, and how many there are.

    Looked at is what is as near as half of `reach`, the person's longer side in pixels, to the body or to what was
    seen of him; both masks are those of the two pictures together.
    """
    either = body | seen
    if not either.any():
        return 0, 0
    rows, columns = np.flatnonzero(either.any(axis=1)), np.flatnonzero(either.any(axis=0))
    far = round(AROUND * reach)
    window = np.s_[
        max(0, rows[0] - far) : rows[-1] + 1 + far,
        max(0, columns[0] - far) : columns[-1] + 1 + far,
    ]
    changed = changed_pixels(image, then)[window]
    count = int(changed.sum())
    if count <= FEW * body.sum():
        return 0, 0
    width = 2 * max(1, round(CLOTHES * reach)) + 1
    near = cv2.dilate(body[window].astype(np.uint8), np.ones((width, width), dtype=np.uint8)) > 0
    return int((changed & near).sum()), count


def _counts(scene: Scene, frames: Sequence[Frame], pictures: Iterator[Image]) -> Iterator[tuple[int, int]]:
    """Yield what `covered` gives for each frame; nothing moves before the first."""
    camera, reach = scene.cameras[0], 0
    before: deque[tuple[Image, Mask, Mask]] = deque(maxlen=max(1, round(LAG * scene.fps)))
    for frame, observation, image in zip(frames, scene.observations, pictures, strict=False):
        body, seen = project(scene.body, camera, frame.pose, frame.translation), observation.silhouettes[0].mask
        reach = max(reach, longer_side(seen))
        if before:
            then, old_body, old_seen = before[0]
            yield covered(image, then, body | old_body, seen | old_seen, reach)
        else:
            yield 0, 0
        before.append((image, body, seen))
