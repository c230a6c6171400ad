"""Silhouettes as a camera's masks are: a rim too many or too few, bites, bulges, missing ends, a little shadow.

What is wrong with a mask stays for a while, as clothes and what is behind them do: frames err together. The sizes are
those of the masks of the demonstration video, in which somebody is 153 pixels tall.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from posefit.fitting.tracker import Observation
from posefit.silhouette.corruption import shadow, wandering
from posefit.silhouette.mask import Mask, Silhouette

SALT = 2026  # part of every seed
HELD = 10  # frames for which the same is wrong: a third of a second, as all clips of the experiment have 30 a second
RIM = 0.006  # of the person's height: the standard deviation of how far all borders of a track are outside
EDGE = 0.004  # and of how far a border wanders besides, in each frame anew
SMOOTH = 0.02  # over which length it does
BITES, BULGES = 0.8, 0.8  # how many there are, the mean of a Poisson distribution
SIZES = (0.02, 0.06)  # radii of these and of missing ends, as shares of the person's height
MISSING, SHADOW = 0.3, 0.3  # how likely an end is missing, and a shadow there
SHADOWS = (0.1, 0.25)  # strengths of shadows


def worn(mask: Mask, rim: float, held: np.random.Generator, fresh: np.random.Generator) -> Mask:
    """Return a mask (height, width) as a camera's is; one of which little would be left stays as it was.

    What stays for a while is drawn from `held`, in the same order whatever the mask; the rest from `fresh`.
    """
    if not mask.any():
        return mask
    rows, columns = np.nonzero(mask)
    top, tall = int(rows.min()), int(np.ptp(rows)) + 1
    left, wide = int(columns.min()), int(np.ptp(columns)) + 1
    spoilt = mask.copy()
    if held.random() < SHADOW:
        spoilt = shadow(spoilt, held.uniform(*SHADOWS), held)
    for count, value in ((held.poisson(BULGES), True), (held.poisson(BITES), False)):
        for across, down, size in held.random((count, 3)):
            near = np.hypot(columns - left - across * wide, rows - top - down * tall).argmin()
            _disc(spoilt, columns[near], rows[near], _radius(size, tall), value)
    gone, end, size = held.random(3)
    if gone < MISSING:
        ends = (columns.argmin(), columns.argmax(), rows.argmax())
        where = ends[int(end * len(ends))]
        _disc(spoilt, columns[where], rows[where], _radius(size, tall), False)
    spoilt = wandering(spoilt, rim * tall, EDGE * tall, SMOOTH * tall, fresh)
    return spoilt if spoilt.sum() > 0.5 * mask.sum() else mask


def _radius(share: float, tall: int) -> int:
    return max(1, round((SIZES[0] + share * (SIZES[1] - SIZES[0])) * tall))


def _disc(mask: Mask, x: int, y: int, radius: int, value: bool) -> None:
    drawn = np.zeros(mask.shape, dtype=np.uint8)
    cv2.circle(drawn, (int(x), int(y)), radius, 1, -1)
    mask[drawn.astype(bool)] = value


@dataclass(frozen=True, eq=False)
class Worn(Sequence[Observation]):
    """Observations whose silhouettes are as a camera's masks are, each camera's on its own; the same each time."""

    observations: Sequence[Observation] = field(repr=False)
    seed: Sequence[int]

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        seen = self.observations[k]
        masks = [self._worn(silhouette.mask, k, camera) for camera, silhouette in enumerate(seen.silhouettes)]
        return replace(seen, silhouettes=[Silhouette.of(mask) for mask in masks])

    def __iter__(self) -> Iterator[Observation]:
        return (self[k] for k in range(len(self)))

    def _worn(self, mask: Mask, k: int, camera: int) -> Mask:
        whole = np.random.default_rng([SALT, *self.seed, camera])
        begins = int(whole.integers(HELD))
        held = np.random.default_rng([SALT, *self.seed, camera, 1, (k + begins) // HELD])
        fresh = np.random.default_rng([SALT, *self.seed, camera, 2, k])
        return worn(mask, RIM * whole.standard_normal(), held, fresh)
