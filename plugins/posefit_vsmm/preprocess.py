"""From a mask to its contour, skeleton line and end points. VSMM step 1.

Steps 1.1 and 1.2, the background and its subtraction, are in
`posefit.silhouette.foreground.mean_background`.
"""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.silhouette.mask import Mask

# share of the largest piece's area: smaller pieces are not part of a person
MIN_PIECE = 0.05
# A branch of the skeleton line shorter than this many radii of the body, measured where
# it branches off, is a bump of the outline.
SPUR = 1.2


class Lines(NamedTuple):
    """The silhouette of a person as points in pixels."""

    pixels: Array  # (n, 2) all pixels of the person
    contour: Array  # (n, 2) the outer contour
    skeleton: Array  # (n, 2) the skeleton line
    ends: Array  # (n, 2) its end points


def lines_of(mask: Mask) -> Lines | None:
    """Return the lines of a mask (height, width), or None if it is empty."""
    from skimage.morphology import skeletonize  # half a second to import

    left, top, width, height = cv2.boundingRect(mask.astype(np.uint8))
    if not width:
        return None
    crop = np.pad(mask[top : top + height, left : left + width], 2).astype(np.uint8)
    closed = cv2.morphologyEx(crop, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    clean = _large_pieces(np.asarray(closed, dtype=np.uint8))  # VSMM 1.3
    corner = np.array([left - 2, top - 2], dtype=np.float64) + 0.5  # pixel centres
    outlines, _ = cv2.findContours(clean, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    line = skeletonize(clean > 0)  # type: ignore[no-untyped-call]  # VSMM 1.4
    thin = np.asarray(line, dtype=np.uint8)
    radii = np.asarray(cv2.distanceTransform(clean, cv2.DIST_L2, 3), dtype=np.float32)
    ends = _ends(thin, radii)
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
    """Return row and column (n, 2) of the ends of the skeleton line, without spurs.

    A junction is a pixel of the line with more than two neighbours. A branch is the
    part between an end and a junction; a short branch is a spur.
    """
    square = np.ones((3, 3), np.uint8)
    count = cv2.filter2D(thin, -1, square, borderType=cv2.BORDER_CONSTANT)
    junctions = (thin > 0) & (count > 3)
    without_junctions = thin * (count <= 3).astype(np.uint8)
    _, branches = cv2.connectedComponents(without_junctions, connectivity=8)
    ends = []
    for end in np.argwhere((thin > 0) & (count == 2)):
        branch = (branches == branches[tuple(end)]).astype(np.uint8)
        around = cv2.dilate(branch, square) > 0
        starts = np.argwhere(around & junctions)
        if len(starts):
            length = np.hypot(*(end - starts[0]))
            if length <= SPUR * radii[tuple(starts[0])]:
                continue
        ends.append(end)
    return np.array(ends, dtype=np.int64).reshape(-1, 2)
