"""Masks from elsewhere made clean: inverted ones are turned round, holes filled, one person of several is followed."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.masks import PackedMasks
from posefit.silhouette.foreground import HOLE, NEAR, PIECE, without_holes
from posefit.silhouette.mask import Mask, Silhouette, touches_border

INVERSION_FRAMES = 40  # masks by which it is decided whether they are inverted
BORDER_SHARE = 0.5  # of the image's border: a person covers no more of it
RIVAL_AREA = 0.4  # of the largest person's area: something so large may be another person
ABOVE_GAP = 0.3  # of the height of both: parts of a person that stand above each other are no farther apart
MERGED_AREA = 1.5  # times the typical area: two people who touch
MEMORY = 0.8  # of the last step and area that is kept with each frame
CUT_SHOWN = 0.5  # of the person's area: where the picture's edge leaves less of it, there is too little to search
LEAP = 1.0  # times the height: farther than a person goes in a frame


def cleaned(masks: PackedMasks, name: object, holes: float | None = None) -> tuple[PackedMasks, list[str]]:
    """Return the masks of one person, and warnings; the bits of `masks` are overwritten.

    The largest person of the first frame that shows one is followed, then the nearest to their last place. Frames that
    show no person before a background are not usable, nor are those in which the picture's edge leaves only a little
    of the person. Holes of at most the share `holes` of the person are filled. Raises InputError naming the first mask
    where no frame shows a person.
    """
    warnings = []
    inverted = _is_inverted(masks)
    if inverted:
        warnings.append(f"{name}: most of the border is marked, so that the masks seem inverted: they are turned round")
    usable, crowded, follower = np.zeros(len(masks), dtype=bool), 0, _Follower()
    areas, cut = np.zeros(len(masks)), np.zeros(len(masks), dtype=bool)
    for k in range(len(masks)):
        silhouette = masks.silhouette(k)
        if inverted:
            silhouette = Silhouette.of(~silhouette.mask, silhouette.valid)
        mask = silhouette.mask
        usable[k] = masks.usable[k] and mask.any() and (mask != silhouette.valid).any()
        if usable[k]:
            people = people_in(silhouette)
            crowded += len(people) > 1
            mask = people[follower.next(people, masks.names[k])]
            mask = without_holes(mask, HOLE if holes is None else holes) & silhouette.valid
            areas[k], cut[k] = mask.sum(), touches_border(mask)
        else:
            follower.skip()
        masks.masks[k] = np.packbits(mask)
    if not usable.any():
        came = "one without background" if masks.silhouette(0).mask.any() else "an empty one"
        rest = f" first, and no other in {len(masks)}" if len(masks) > 1 else ""
        raise InputError(f"{masks.names[0]}: expected a mask with a person before a background, got {came}{rest}")
    if crowded:
        leaps = f", which leaps at {follower.leap}: look there" if follower.leap else ""
        warnings.append(
            f"{name}: several people in {crowded} of {len(masks)} masks; the largest of the first is followed, then "
            f"the nearest to the last{leaps}"
        )
    whole = np.flatnonzero(usable & ~cut)
    for frame in np.flatnonzero(usable & cut) if len(whole) else ():
        usable[frame] = areas[frame] >= CUT_SHOWN * areas[whole[np.abs(whole - frame).argmin()]]
    return replace(masks, usable=usable), warnings


def _is_inverted(masks: PackedMasks) -> bool:
    """Return whether most masks cover most of the border, which a person does not."""
    shares = []
    for k in np.unique(np.linspace(0, len(masks) - 1, INVERSION_FRAMES).astype(int)).tolist():
        silhouette = masks.silhouette(k)
        if silhouette.mask.any() and (silhouette.mask != silhouette.valid).any():
            planes = silhouette.mask, silhouette.valid
            edges = [(plane[0], plane[-1], plane[:, 0], plane[:, -1]) for plane in planes]
            marked, known = (np.concatenate(edge) for edge in edges)
            shares.append(marked.sum() > BORDER_SHARE * known.sum())
    return bool(shares) and bool(np.mean(shares) > 0.5)


def people_in(silhouette: Silhouette) -> list[Mask]:
    """Return the masks of the people in a silhouette, the largest first; a single person's is the whole mask.

    Pieces near each other are one person's; so are those with unknown pixels between them, and one above the other, as
    a table leaves them. A piece much smaller than the largest is no person.
    """
    mask = silhouette.mask
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA]
    large = [k for k in range(1, count) if areas[k] >= PIECE * areas[1:].max()]
    if len(large) < 2:
        return [mask]
    through = cv2.connectedComponents((mask | ~silhouette.valid).astype(np.uint8), connectivity=8)[1]
    from scipy.sparse.csgraph import connected_components  # takes a tenth of a second to import

    near = np.zeros((len(large), len(large)), dtype=bool)
    for row, k in enumerate(large):
        distance = cv2.distanceTransform((labels != k).astype(np.uint8), cv2.DIST_L2, 3)
        joined = through == through[labels == k][0]
        for column, j in enumerate(large[:row]):
            other = labels == j
            near[row, column] = _is_one_person(stats[k], stats[j], distance[other].min(), joined[other].all())
    owners = connected_components(near, directed=False)[1]
    groups = [[k for k, owner in zip(large, owners, strict=True) if owner == number] for number in np.unique(owners)]
    totals = [sum(int(areas[k]) for k in group) for group in groups]
    people = [k for k in np.argsort(totals)[::-1].tolist() if totals[k] >= RIVAL_AREA * max(totals)]
    return [mask] if len(people) == 1 else [np.isin(labels, groups[k]) for k in people]


def _is_one_person(first: NDArray[np.int32], second: NDArray[np.int32], distance: float, joined: bool) -> bool:
    left, top, wide, tall = (np.array([piece[k] for piece in (first, second)]) for k in range(4))
    if joined or distance <= NEAR * tall.max():
        return True
    across = (left + wide).min() - left.max()
    between = top.max() - (top + tall).min()
    whole = (top + tall).max() - top.min()
    return bool(across >= 0.5 * wide.min() and 0 <= between <= ABOVE_GAP * whole)


class _Follower:
    """Follows one person by their last place and step; while two people touch, the step goes on."""

    def __init__(self) -> None:
        self.leap = ""  # the first mask in which the person is farther away than a person goes
        self._place: Array | None = None
        self._step, self._area, self._frames = np.zeros(2), 0.0, 1

    def next(self, people: Sequence[Mask], name: str) -> int:
        """Return the index of the person among the people of the next frame."""
        moments = [cv2.moments(mask.astype(np.uint8), binaryImage=True) for mask in people]
        places = np.array([(m["m01"], m["m10"]) for m in moments]) / [[m["m00"]] for m in moments]
        expected = places[0] if self._place is None else self._place + self._frames * self._step
        index = int(np.linalg.norm(places - expected, axis=1).argmin())
        area = float(moments[index]["m00"])
        if self._place is not None and area > MERGED_AREA * self._area:
            self.skip()
            self._area += 0.02 * (area - self._area)  # or the person comes nearer
            return index
        if self._place is not None:
            tall = int(np.ptp(np.flatnonzero(people[index].any(axis=1)))) + 1
            if len(people) > 1 and np.linalg.norm(places[index] - expected) > LEAP * tall:
                self.leap = self.leap or name
            step = (places[index] - self._place) / self._frames
            self._step = MEMORY * self._step + (1.0 - MEMORY) * step
            self._area = MEMORY * self._area + (1.0 - MEMORY) * area
        else:
            self._area = area
        self._place, self._frames = places[index], 1
        return index

    def skip(self) -> None:
        """Note that a frame does not show where the person is."""
        self._frames += 1
