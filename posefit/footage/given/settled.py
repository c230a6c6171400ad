"""Masks from elsewhere, settled: empty frames are held, inverted masks turned, holes filled, and one person followed.

All masks are gone through once, and little is kept of each: a mask itself is read again when its turn comes.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.footage.masks import Masks
from posefit.silhouette.foreground import HOLE, NEAR, PIECE, without_holes
from posefit.silhouette.mask import Mask, Silhouette

LOOKED = 40  # masks by which it is seen whether they are inverted
BORDER = 0.5  # the share of the border that a person covers at most
RIVAL = 0.4  # something else that is so large, as a share of the largest, may be another person
ABOVE = 0.3  # of the height of both: parts of a person that stand above each other are no farther apart
MERGED = 1.5  # times the usual area: two people who touch
STEADY = 0.8  # of the last step that is kept when the next is seen
LEAP = 1.0  # times the height: nobody goes so far in a frame


@dataclass(frozen=True, eq=False)
class Settled:
    """The masks of one person."""

    masks: Masks
    usable: NDArray[np.bool_] = field(repr=False)  # (T,)
    inverted: bool
    seeds: Mapping[int, tuple[int, int]]  # row and column of the person in masks of several people, by frame
    holes: float  # the largest that is filled, as a share of the person's area
    warnings: Sequence[str] = ()

    def __len__(self) -> int:
        return len(self.masks)

    def is_usable(self, k: int) -> bool:
        """Return whether frame k shows a person before a background."""
        return bool(self.usable[k])

    def label(self, k: int) -> str:
        """Return what to call frame k."""
        return self.masks.label(k)

    def silhouette(self, k: int) -> Silhouette:
        """Return the silhouette of the person in frame k."""
        seen = _turned(self.masks.silhouette(k), self.inverted)
        if not self.usable[k]:
            return seen
        mask = seen.mask
        if k in self.seeds:
            mask = next(one for one in people_in(seen) if one[self.seeds[k]])
        return Silhouette.of(without_holes(mask, self.holes), seen.valid)


def settled(masks: Masks, name: object, holes: float | None = None) -> Settled:
    """Return the masks of one person: the largest of the first frame that shows anybody, then the nearest to the last.

    Raises ValueError naming the first mask where none shows a person before a background.
    """
    share = HOLE if holes is None else holes
    inverted, warnings = _inverted(masks), []
    if inverted:
        warnings.append(f"{name}: most of the border is marked, so that the masks seem inverted: they are turned round")
    usable, seeds, followed = np.zeros(len(masks), dtype=bool), {}, _Followed()
    for k in range(len(masks)):
        seen = _turned(masks.silhouette(k), inverted)
        usable[k] = masks.is_usable(k) and seen.mask.any() and (seen.mask != seen.valid).any()
        if usable[k]:
            people = people_in(seen)
            one = followed.next(people, masks.label(k))
            if len(people) > 1:
                row = int(people[one].any(axis=1).argmax())
                seeds[k] = row, int(people[one][row].argmax())
        else:
            followed.missed()
    if not usable.any():
        came = "one without background" if _turned(masks.silhouette(0), inverted).mask.any() else "an empty one"
        rest = f" first, and no other in {len(masks)}" if len(masks) > 1 else ""
        raise ValueError(f"{masks.label(0)}: expected a mask with a person before a background, got {came}{rest}")
    if seeds:
        leaps = f", which leaps at {followed.leap}: look there" if followed.leap else ""
        warnings.append(
            f"{name}: several people in {len(seeds)} of {len(masks)} masks; the largest of the first is followed, then "
            f"the nearest to the last{leaps}"
        )
    return Settled(masks, usable, inverted, seeds, share, warnings)


def _inverted(masks: Masks) -> bool:
    """Return whether most masks cover most of the border, which a person does not."""
    shares = []
    for k in np.unique(np.linspace(0, len(masks) - 1, LOOKED).astype(int)).tolist():
        seen = masks.silhouette(k)
        if seen.mask.any() and (seen.mask != seen.valid).any():
            edges = [(plane[0], plane[-1], plane[:, 0], plane[:, -1]) for plane in (seen.mask, seen.valid)]
            marked, known = (np.concatenate(edge) for edge in edges)
            shares.append(marked.sum() > BORDER * known.sum())
    return bool(shares) and bool(np.mean(shares) > 0.5)


def _turned(seen: Silhouette, inverted: bool) -> Silhouette:
    return Silhouette.of(~seen.mask, seen.valid) if inverted else seen


def people_in(seen: Silhouette) -> list[Mask]:
    """Return the masks of the people in a silhouette, the largest first; one who is alone with all that is seen.

    Pieces near each other are one person's; so are those with what is unknown between them, and one above the other, as
    a table leaves them. What is much smaller than the largest is nobody.
    """
    count, labels, stats, _ = cv2.connectedComponentsWithStats(seen.mask.astype(np.uint8), connectivity=8)
    areas = stats[:, cv2.CC_STAT_AREA]
    large = [k for k in range(1, count) if areas[k] >= PIECE * areas[1:].max()]
    if len(large) < 2:
        return [seen.mask]
    through = cv2.connectedComponents((seen.mask | ~seen.valid).astype(np.uint8), connectivity=8)[1]
    groups: list[list[int]] = []
    for k in large:
        beside = cv2.distanceTransform((labels != k).astype(np.uint8), cv2.DIST_L2, 3)
        same = through == through[labels == k][0]
        mine = [k]
        for group in [*groups]:
            if any(_one_person(stats[k], stats[j], beside[labels == j].min(), same[labels == j].all()) for j in group):
                groups.remove(group)
                mine += group
        groups.append(mine)
    whole = [sum(int(areas[k]) for k in group) for group in groups]
    people = [k for k in np.argsort(whole)[::-1].tolist() if whole[k] >= RIVAL * max(whole)]
    return [seen.mask] if len(people) == 1 else [np.isin(labels, groups[k]) for k in people]


def _one_person(first: NDArray[np.int32], second: NDArray[np.int32], apart: float, joined: bool) -> bool:
    """Return whether two pieces belong to one person."""
    left, top, wide, tall = (np.array([one[k] for one in (first, second)]) for k in range(4))
    if joined or apart <= NEAR * tall.max():
        return True
    across = (left + wide).min() - left.max()
    between = top.max() - (top + tall).min()
    whole = (top + tall).max() - top.min()
    return bool(across >= 0.5 * wide.min() and 0 <= between <= ABOVE * whole)


class _Followed:
    """Where somebody was last, and where he goes; somebody who touches another is where he would have gone."""

    def __init__(self) -> None:
        self.leap = ""  # the first mask in which he is farther away than anybody goes
        self._place: Array | None = None
        self._step, self._usual, self._since = np.zeros(2), 0.0, 1

    def next(self, people: Sequence[Mask], label: str) -> int:
        """Return which of the people it is."""
        moments = [cv2.moments(one.astype(np.uint8), binaryImage=True) for one in people]
        places = np.array([(one["m01"], one["m10"]) for one in moments]) / [[one["m00"]] for one in moments]
        expected = places[0] if self._place is None else self._place + self._since * self._step
        one = int(np.linalg.norm(places - expected, axis=1).argmin())
        area = float(moments[one]["m00"])
        if self._place is not None and area > MERGED * self._usual:
            self.missed()
            self._usual += 0.02 * (area - self._usual)  # or he only comes nearer
            return one
        if self._place is not None:
            tall = int(np.ptp(np.flatnonzero(people[one].any(axis=1)))) + 1
            if len(people) > 1 and np.linalg.norm(places[one] - expected) > LEAP * tall:
                self.leap = self.leap or label
            step = (places[one] - self._place) / self._since
            self._step = STEADY * self._step + (1.0 - STEADY) * step
            self._usual = STEADY * self._usual + (1.0 - STEADY) * area
        else:
            self._usual = area
        self._place, self._since = places[one], 1
        return one

    def missed(self) -> None:
        """Look a frame farther on."""
        self._since += 1
