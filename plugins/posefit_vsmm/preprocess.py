"""From a mask to its contour, skeleton line and end points. VSMM step 1.

The background and its subtraction, 1.1 and 1.2, are `posefit.silhouette.foreground.mean_background`.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.silhouette.mask import Mask

MIN_PIECE = 0.05  # of the largest piece's area: a smaller piece is no part of a person
# radii of the body where it branches off: a shorter branch of the skeleton line is a
# bump of the outline
SPUR = 1.2


class Lines(NamedTuple):
    """The silhouette of a person as points in pixels."""

    pixels: Array  # (n, 2) all of the person's
    contour: Array  # (n, 2) the outer contour
    skeleton: Array  # (n, 2) the skeleton line
    ends: Array  # (n, 2) its end points


def lines_of(mask: Mask) -> Lines | None:
    """Return the lines of a mask (height, width); None where it is empty."""
    from skimage.morphology import skeletonize  # half a second to import

    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    if not width:
        return None
    crop = np.pad(mask[top : top + height, left : left + width], 2).astype(np.uint8)
    closed = cv2.morphologyEx(crop, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    clean = _large_pieces(np.asarray(closed, dtype=np.uint8))  # VSMM 1.3
    corner = np.array([left - 2, top - 2], dtype=np.float64) + 0.5  # pixel centres
    outlines, _ = cv2.findContours(clean, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    thin = np.asarray(skeletonize(clean > 0), dtype=np.uint8)  # type: ignore[no-untyped-call]  # VSMM 1.4
    ends = _ends(
        thin, np.asarray(cv2.distanceTransform(clean, cv2.DIST_L2, 3), dtype=np.float32)
    )
    return Lines(
        np.argwhere(clean)[:, ::-1] + corner,
        np.concatenate([outline[:, 0] for outline in outlines]) + corner,
        np.argwhere(thin)[:, ::-1] + corner,
        ends[:, ::-1] + corner,
    )


def _large_pieces(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0  # the background
    return np.asarray(
        (areas >= max(1.0, MIN_PIECE * areas.max()))[labels], dtype=np.uint8
    )


def _ends(thin: NDArray[np.uint8], radii: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return row and column (n, 2) of the ends of the skeleton line, but for those of spurs, which are pruned.

    A branch is what is left between an end and a junction, a pixel with more than two others around it.
    """
    square = np.ones((3, 3), np.uint8)
    count = cv2.filter2D(thin, -1, square, borderType=cv2.BORDER_CONSTANT)
    junctions = (thin > 0) & (count > 3)
    _, branches = cv2.connectedComponents(
        thin * (count <= 3).astype(np.uint8), connectivity=8
    )
    ends = []
    for end in np.argwhere((thin > 0) & (count == 2)):
        around = (
            cv2.dilate((branches == branches[tuple(end)]).astype(np.uint8), square) > 0
        )
        starts = np.argwhere(around & junctions)
        if (
            not len(starts)
            or np.hypot(*(end - starts[0])) > SPUR * radii[tuple(starts[0])]
        ):
            ends.append(end)
    return np.array(ends, dtype=np.int64).reshape(-1, 2)
