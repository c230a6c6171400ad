"""Masks from elsewhere made clean: inverted ones are turned round, holes filled, one person of several is followed."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.masks import PackedMasks, empty_planes
from posefit.footage.people import Choice, Chooser, People, planes_of
from posefit.motion.clips import FPS
from posefit.silhouette.foreground import (
    MAX_HOLE_AREA,
    MIN_PIECE_AREA,
    PIECE_REACH,
    without_holes,
)
from posefit.silhouette.mask import Mask, Silhouette, touches_border

INVERSION_FRAMES = 40  # masks by which it is decided whether they are inverted
BORDER_SHARE = 0.5  # of the image's border: a person covers no more of it
# of the largest person's area: something so large may be another person
RIVAL_AREA = 0.4
# of the height of both: parts of a person that stand above each other are no farther
# apart
ABOVE_GAP = 0.3
# of the person's area: the largest hole that is filled in a mask by itself. Between an
# arm and the trunk it says where the arm is, and no other frame does
MAX_HOLE_ALONE = 0.002
# of the person's area: where the picture's edge leaves less of it, there is too little
# to search
CUT_SHOWN = 0.5


def cleaned(
    masks: PackedMasks,
    name: object,
    holes: float | None = None,
    choice: Choice | Chooser | None = None,
) -> tuple[PackedMasks, list[str]]:
    """Return the masks of one person, and warnings, in the memory of `masks`, which are overwritten.

    Of several people `choice` is followed, see `People.chosen`; the pixels of the others are unknown. Frames that show
    no person before a background are not usable, nor are those in which the picture's edge leaves only a little of the
    person. Holes of at most the share `holes` of the person are filled. Raises InputError naming the first mask where
    no frame shows a person.
    """
    warnings = []
    inverted = _is_inverted(masks)
    if inverted:
        warnings.append(
            f"{name}: most of the border is marked, so that the masks seem inverted: they are turned round"
        )

    def silhouette_of(k: int) -> Silhouette:
        silhouette = masks.silhouette(k)
        return (
            Silhouette.of(~silhouette.mask, silhouette.valid)
            if inverted
            else silhouette
        )

    usable = np.zeros(len(masks), dtype=bool)
    people = People(masks.fps or FPS)
    for k in range(len(masks)):
        silhouette = silhouette_of(k)
        mask = silhouette.mask
        usable[k] = masks.usable[k] and mask.any() and (mask != silhouette.valid).any()
        people.add(people_in(silhouette) if usable[k] else [])
    if not usable.any():
        came = (
            "one without background" if silhouette_of(0).mask.any() else "an empty one"
        )
        rest = f" first, and no other in {len(masks)}" if len(masks) > 1 else ""
        raise InputError(
            f"{masks.names[0]}: expected a mask with a person before a background, got {came}{rest}"
        )
    parts, words = people.chosen(choice, lambda frame: Path(masks.names[frame]).name)
    if words:
        warnings.append(f"{name}: {words}")
        if masks.valid is None:
            known = empty_planes(len(masks), masks.size)
            known[:] = 255
            masks = replace(masks, valid=known)
    others = people.others(parts)
    if holes is None:
        holes = MAX_HOLE_AREA if len(masks) > 1 else MAX_HOLE_ALONE
    areas = np.zeros(len(masks))
    cut = np.zeros(len(masks), dtype=bool)
    for k in range(len(masks)):
        silhouette = silhouette_of(k)
        mask = silhouette.mask
        valid = silhouette.valid
        if usable[k]:
            mask = people_in(silhouette)[0]
            if words:
                mask, valid = planes_of(parts, others, k, silhouette.valid)
            mask = without_holes(mask, holes) & valid
            usable[k], areas[k], cut[k] = mask.any(), mask.sum(), touches_border(mask)
        masks.masks[k] = np.packbits(mask)
        if words and masks.valid is not None:
            masks.valid[k] = np.packbits(valid)
    return replace(masks, usable=usable & _shows_enough(usable, areas, cut)), warnings


def _shows_enough(
    usable: NDArray[np.bool_], areas: Array, cut: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return which frames (T,) have most of the person's area in the nearest usable frame that is not cut."""
    enough = np.ones(len(areas), dtype=bool)
    whole = np.flatnonzero(usable & ~cut)
    for frame in np.flatnonzero(usable & cut) if len(whole) else ():
        enough[frame] = (
            areas[frame] >= CUT_SHOWN * areas[whole[np.abs(whole - frame).argmin()]]
        )
    return enough


def _is_inverted(masks: PackedMasks) -> bool:
    """Return whether most masks cover most of the border, which a person does not."""
    shares = []
    for k in np.unique(
        np.linspace(0, len(masks) - 1, INVERSION_FRAMES).astype(int)
    ).tolist():
        silhouette = masks.silhouette(k)
        if silhouette.mask.any() and (silhouette.mask != silhouette.valid).any():
            planes = silhouette.mask, silhouette.valid
            edges = [
                (plane[0], plane[-1], plane[:, 0], plane[:, -1]) for plane in planes
            ]
            marked, known = (np.concatenate(edge) for edge in edges)
            shares.append(marked.sum() > BORDER_SHARE * known.sum())
    return bool(shares) and bool(np.mean(shares) > 0.5)


def people_in(silhouette: Silhouette) -> list[Mask]:
    """Return the masks of the people in a silhouette, the largest first; a single person's is the whole mask.

    Pieces near each other are one person's; so are those with unknown pixels between them, and one above the other, as
    a table leaves them. A piece much smaller than the largest is no person.
    """
    mask = silhouette.mask
    count, labels, stats, _ = cv2.connectedComponentsWithStats(
        mask.astype(np.uint8), connectivity=8
    )
    areas = stats[:, cv2.CC_STAT_AREA]
    large = [k for k in range(1, count) if areas[k] >= MIN_PIECE_AREA * areas[1:].max()]
    if len(large) < 2:
        return [mask]
    through = cv2.connectedComponents(
        (mask | ~silhouette.valid).astype(np.uint8), connectivity=8
    )[1]
    # takes a tenth of a second to import
    from scipy.sparse.csgraph import connected_components

    near = np.zeros((len(large), len(large)), dtype=bool)
    for row, k in enumerate(large):
        distance = cv2.distanceTransform((labels != k).astype(np.uint8), cv2.DIST_L2, 3)
        joined = through == through[labels == k][0]
        for column, j in enumerate(large[:row]):
            other = labels == j
            near[row, column] = _is_one_person(
                stats[k], stats[j], distance[other].min(), joined[other].all()
            )
    owners = connected_components(near, directed=False)[1]
    groups = [
        [k for k, owner in zip(large, owners, strict=True) if owner == number]
        for number in np.unique(owners)
    ]
    totals = [sum(int(areas[k]) for k in group) for group in groups]
    people = [
        k
        for k in np.argsort(totals)[::-1].tolist()
        if totals[k] >= RIVAL_AREA * max(totals)
    ]
    return [mask] if len(people) == 1 else [np.isin(labels, groups[k]) for k in people]


def _is_one_person(
    first: NDArray[np.int32], second: NDArray[np.int32], distance: float, joined: bool
) -> bool:
    left, top, wide, tall = (
        np.array([piece[k] for piece in (first, second)]) for k in range(4)
    )
    if joined or distance <= PIECE_REACH * tall.max():
        return True
    across = (left + wide).min() - left.max()
    between = top.max() - (top + tall).min()
    whole = (top + tall).max() - top.min()
    return bool(across >= 0.5 * wide.min() and 0 <= between <= ABOVE_GAP * whole)
