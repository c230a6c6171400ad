"""From a mask to lines: the outer contour, the skeleton line and its end points. VSMM step 1.

The background and its subtraction, 1.1 and 1.2, are `posefit.silhouette.foreground.mean_background`.
"""

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.silhouette.mask import Mask
from posefit_vsmm.kernels import branch

PIECE = 0.05  # of the largest piece's area: a smaller piece is no part of a person
SPUR = 1.2  # radii of the body where it branches off: a shorter branch of the skeleton line is a bump of the outline


@dataclass(frozen=True, eq=False)
class Lines:
    """The silhouette of a person as points in pixels."""

    area: int  # pixels
    centroid: Array  # (2,)
    pixels: Array = field(repr=False)  # (n, 2) all of the person's
    contour: Array = field(repr=False)  # (n, 2) the outer contour
    skeleton: Array = field(repr=False)  # (n, 2) the skeleton line
    ends: Array = field(repr=False)  # (n, 2) its end points


def lines_of(mask: Mask) -> Lines | None:
    """Return the lines of a mask (height, width); None where it is empty."""
    from skimage.morphology import skeletonize  # half a second to import

    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    top, left = rows[0], columns[0]
    crop = np.pad(mask[top : rows[-1] + 1, left : columns[-1] + 1], 2).astype(np.uint8)
    closed = cv2.morphologyEx(crop, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    clean = _pieces(np.asarray(closed, dtype=np.uint8))  # VSMM 1.3
    corner = np.array([left - 2, top - 2], dtype=np.float64) + 0.5  # pixel centres
    outlines, _ = cv2.findContours(clean, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    thin = skeletonize(clean > 0)  # type: ignore[no-untyped-call]  # VSMM 1.4
    ends = _ends(thin, np.asarray(cv2.distanceTransform(clean, cv2.DIST_L2, 3), dtype=np.float32))
    pixels = np.argwhere(clean)[:, ::-1] + corner
    return Lines(
        len(pixels),
        pixels.mean(axis=0),
        pixels,
        np.concatenate([outline[:, 0] for outline in outlines]) + corner,
        np.argwhere(thin)[:, ::-1] + corner,
        ends[:, ::-1] + corner,
    )


def _pieces(mask: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a mask without its specks."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    kept = areas >= PIECE * areas.max()
    kept[0] = False
    return kept[labels].astype(np.uint8) if count > 2 else mask


def _ends(thin: Mask, radii: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return row and column (n, 2) of the ends of the skeleton line, but for those of spurs, which are pruned."""
    number = cv2.filter2D(thin.astype(np.uint8), -1, np.ones((3, 3), np.uint8), borderType=cv2.BORDER_CONSTANT)
    ends = []
    for end in np.argwhere(thin & (number == 2)):
        row, column = branch(thin, number, end[0], end[1])
        if row < 0 or np.hypot(end[0] - row, end[1] - column) > SPUR * radii[row, column]:
            ends.append(end)
    return np.array(ends, dtype=np.int64).reshape(-1, 2)
