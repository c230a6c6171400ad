"""Which pieces of a mask are one person, in given masks and from segmenters."""

from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.silhouette.mask import Mask, padded_box

# share of the taller piece's height: pieces within this distance are one person
PIECE_REACH = 0.06
# share of the height of both pieces: the largest gap between two parts of a person, one
# above the other
ABOVE_GAP = 0.3
MIN_PIECE_AREA = 0.05  # share of the largest piece's area: smaller pieces are noise
# share of the largest person's area: anything smaller is not a person
RIVAL_AREA = 0.25


class Pieces(NamedTuple):
    """One person in a mask."""

    mask: Mask  # (height, width)
    # pieces large enough to be part of a person, in the mask without larger people
    pieces: int
    # area of the largest other piece in that mask, as a share of the person's area
    rival: float


def people_in(mask: Mask, known: Mask | None = None) -> list[Pieces]:
    """Return the people in a mask, the largest first.

    Pieces near each other are one person; a speck belongs to the person next to it.
    With `known`, pieces separated by unknown pixels are one person too, and so are two
    pieces one above the other, as when a table hides the middle. Masks from a segmenter
    come without `known`: segmenters miss clothes and shadows, and a piece above another
    one is often a second person.

    Args:
        mask: (height, width).
        known: (height, width) the known pixels of a given mask; None for a mask from a
            segmenter.

    Returns:
        The people; an empty list for an empty mask.
    """
    box = padded_box(mask, 0)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask[box].astype(np.uint8), connectivity=8
    )
    areas = stats[:, cv2.CC_STAT_AREA].copy()
    areas[0] = 0
    if count == 1:
        return []
    if known is not None:
        known = known[box]
    owners = np.arange(count)
    if count > 2:
        owners = _owners(labels, stats, areas, known)
    totals = np.bincount(owners, areas, count)
    totals[0] = 0.0  # specks near nobody, and the background
    result = list[Pieces]()
    others = areas.copy()
    for owner in np.argsort(-totals, kind="stable").tolist():
        if totals[owner] < RIVAL_AREA * totals.max():
            break
        person = np.zeros_like(mask)
        person[box] = (owners == owner)[labels]
        large = int(np.count_nonzero(others > MIN_PIECE_AREA * others.max()))
        others[owners == owner] = 0  # the next people do not count this one's pieces
        result.append(Pieces(person, large, float(others.max() / totals[owner])))
    return result


def _owners(
    labels: NDArray[Any],
    stats: NDArray[Any],
    areas: NDArray[Any],
    known: Mask | None,
) -> NDArray[np.int64]:
    """Return the number (n,) of each piece's person; 0 for a speck near nobody.

    A person has the number of one of their large pieces.
    """
    count = len(areas)
    large = np.flatnonzero(areas > MIN_PIECE_AREA * areas.max())
    reach = PIECE_REACH * stats[large, cv2.CC_STAT_HEIGHT]
    distances = _distances(labels, large, count)
    joined = distances[:, large] <= np.maximum(reach[:, None], reach)
    if known is not None:
        joined |= _joined_by_unknown(labels, large, count, known)
        for row, first in enumerate(large.tolist()):
            for column, second in enumerate(large[:row].tolist()):
                joined[row, column] |= _is_above(stats[first], stats[second])
    owners = np.zeros(count, dtype=np.int64)
    owners[large] = large
    # joining two pieces joins everything that is already joined to either
    for row, column in np.argwhere(joined).tolist():
        owners[owners == owners[large[row]]] = owners[large[column]]
    specks = np.setdiff1d(np.arange(1, count), large)
    nearest = distances[:, specks].argmin(axis=0)
    near = distances[nearest, specks] <= reach[nearest]
    owners[specks] = np.where(near, owners[large[nearest]], 0)
    return owners


def _distances(labels: NDArray[Any], large: NDArray[np.intp], count: int) -> Array:
    """Return the pixels (m, count) from each of m large pieces to every piece.

    The first column, the background's, is inf.
    """
    # the pixels of the pieces, one piece after the other, and where each begins; short
    # numbers are sorted in a tenth of the time
    pixels = np.flatnonzero(labels > 0)
    numbers = labels.ravel()[pixels].astype(np.min_scalar_type(count))
    pixels = pixels[np.argsort(numbers, kind="stable")]
    starts = np.cumsum(np.bincount(numbers, minlength=count))[:-1]
    distances = np.full((len(large), count), np.inf)
    for row, number in enumerate(large.tolist()):
        apart = (labels != number).astype(np.uint8)
        away = cv2.distanceTransform(apart, cv2.DIST_L2, 3)
        distances[row, 1:] = np.minimum.reduceat(away.ravel()[pixels], starts)
    return distances


def _joined_by_unknown(
    labels: NDArray[Any], large: NDArray[np.intp], count: int, known: Mask
) -> NDArray[np.bool_]:
    """Return which of m large pieces (m, m) unknown pixels join to one component."""
    shown = labels > 0
    through = (shown | ~known).astype(np.uint8)
    components = cv2.connectedComponents(through, connectivity=8)[1]
    component_of = np.zeros(count, dtype=np.int64)
    component_of[labels[shown]] = components[shown]
    joined = np.equal.outer(component_of[large], component_of[large])
    return np.asarray(joined, dtype=bool)


def _is_above(first: NDArray[np.int32], second: NDArray[np.int32]) -> bool:
    """Return whether one piece is right above the other, by their statistics."""
    left, top, width, height = np.stack([first[:4], second[:4]], axis=1)
    overlap = (left + width).min() - left.max()
    gap = top.max() - (top + height).min()
    whole = (top + height).max() - top.min()
    return bool(overlap >= 0.5 * width.min() and 0 <= gap <= ABOVE_GAP * whole)
