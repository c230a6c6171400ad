"""Which pieces of a mask are one person, whether others made it or a segmenter did."""

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.silhouette.mask import Mask, padded_box

# of the taller piece's height: pieces as near as that are one person's
PIECE_REACH = 0.06
# of the height of both: parts of a person that stand above each other are no farther
# apart
ABOVE_GAP = 0.3
MIN_PIECE_AREA = 0.05  # of the largest piece's area: smaller pieces are noise
RIVAL_AREA = 0.25  # of the largest person's area: something smaller is no person


class Pieces(NamedTuple):
    """One person in a mask."""

    mask: Mask  # (height, width)
    # in the mask without larger people: how many are large enough to be part of one
    pieces: int
    # the area of the largest of these that is not theirs, as a share of their own
    rival: float


def people_in(mask: Mask, known: Mask | None = None) -> list[Pieces]:
    """Return the people in a mask (height, width), the largest first; none in an empty one.

    Pieces near each other are one person's, and specks are that of the person whom they are near. In masks that others
    made, with the pixels that are `known`, so are pieces with unknown pixels between them, and one above the other, as
    a table leaves them. A segmenter, which gives none, leaves clothes and shadows out, and what is above another piece
    is often another person.
    """
    box = padded_box(mask, 0)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask[box].astype(np.uint8), connectivity=8
    )
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    if count == 1:
        return []
    owners = np.arange(count)
    if count > 2:
        owners = _owners(labels, stats, areas, None if known is None else known[box])
    totals = np.bincount(owners, areas, count)
    order = [
        owner
        for owner in np.argsort(-totals, kind="stable").tolist()
        if totals[owner] >= RIVAL_AREA * totals.max()
    ]
    result = list[Pieces]()
    others = areas.copy()
    for owner in order:
        person = np.zeros_like(mask)
        person[box] = (owners == owner)[labels]
        large = int(np.count_nonzero(others > MIN_PIECE_AREA * others.max()))
        others[owners == owner] = 0
        result.append(Pieces(person, large, float(others.max() / totals[owner])))
    return result


def _owners(
    labels: NDArray[Any],
    stats: NDArray[Any],
    areas: NDArray[Any],
    known: Mask | None,
) -> NDArray[np.int64]:
    """Return for each piece (n,) the number of its person, that of one of their large pieces; 0 for a speck alone."""
    count = len(areas)
    large = np.flatnonzero(areas > MIN_PIECE_AREA * areas.max())
    reach = PIECE_REACH * stats[large, cv2.CC_STAT_HEIGHT]
    shown = labels > 0
    distances = np.full((len(large), count), np.inf)
    for row, number in enumerate(large.tolist()):
        apart = (labels != number).astype(np.uint8)
        away = cv2.distanceTransform(apart, cv2.DIST_L2, 3)
        np.minimum.at(distances[row], labels[shown], away[shown])
    joined = distances[:, large] <= np.maximum(reach[:, None], reach)
    if known is not None:
        through = (shown | ~known).astype(np.uint8)
        numbers = cv2.connectedComponents(through, connectivity=8)[1]
        parts = np.zeros(count, dtype=np.int64)
        parts[labels[shown]] = numbers[shown]
        joined |= np.equal.outer(parts[large], parts[large])
        for row, first in enumerate(large.tolist()):
            for column, second in enumerate(large[:row].tolist()):
                joined[row, column] |= _is_above(stats[first], stats[second])
    owners = np.zeros(count, dtype=np.int64)
    owners[large] = large
    for row, column in np.argwhere(joined).tolist():
        owners[owners == owners[large[row]]] = owners[large[column]]
    specks = np.setdiff1d(np.arange(1, count), large)
    nearest = distances[:, specks].argmin(axis=0)
    near = distances[nearest, specks] <= reach[nearest]
    owners[specks] = np.where(near, owners[large[nearest]], 0)
    return owners


def _is_above(first: NDArray[np.int32], second: NDArray[np.int32]) -> bool:
    left, top, wide, tall = (
        np.array([piece[k] for piece in (first, second)]) for k in range(4)
    )
    across = (left + wide).min() - left.max()
    between = top.max() - (top + tall).min()
    whole = (top + tall).max() - top.min()
    return bool(across >= 0.5 * wide.min() and 0 <= between <= ABOVE_GAP * whole)
