"""The boxes that a suite searches: joint angles as few numbers, read from `boxes.npz`.

A box is never learned from the person in the silhouette. Of the ten people of the library seven are for training; for
an instance of one of them, the box was learned from the six others. The three others are held out: their boxes were
learned from the seven. `docs/studies/make_boxes.py` made the file. Its numbers are rounded, and sums are taken in one
order, so that a proposal means the same pose on every machine.
"""

import math
from dataclasses import dataclass, field
from functools import lru_cache
from importlib.resources import files
from typing import final

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, jit, writeable
from posefit.fitting.prior import Components

HELD_OUT_PEOPLE = ("16", "49", "135")
TRAINING_PEOPLE = ("02", "05", "09", "14", "17", "29", "127")
STEP = 1e-4  # radians, and what a stored component is a whole multiple of
# components of the boxes of 9, 10, 16, 20, 24 and 40 dimensions
SIZES = (6, 7, 13, 17, 21, 37)
# joint angles that turn a hand about its forearm, unless fingers move as well
SHOW_NOTHING = (49, 61)
FRAMES = 8  # of a sequence
# how many each of four mixed latents may have; each fifth one has any
VALUES = (2, 4, 8, 16)
# to either side: the range of joint angles that are constant in the data
CONSTANT = math.radians(10.0)
HELD_OUT_GROUP = "held out"  # the name of the box learned from all people for training


@dataclass(frozen=True, eq=False)
class Learned:
    """The statistics of one group of people."""

    mean: Array  # (63,) radians
    components: Array = field(repr=False)  # (37, 63)
    spread: Array  # (37,) standard deviation along each, radians
    half: Array  # (37,) of the box along each, radians
    reach: Array  # (6,) by `SIZES`: how far from the mean poses are, in spreads
    low: Array  # (63,) the range of each joint angle
    high: Array  # (63,)
    order: NDArray[np.int64]  # (63,) joint angles by their variation, the largest first


@lru_cache(maxsize=1)
def _stored() -> dict[str, Learned]:
    with (
        (files("posefit.suites") / "boxes.npz").open("rb") as file,
        np.load(file) as stored,
    ):
        names = stored["names"].tolist()
        arrays = {name: stored[name] for name in Learned.__dataclass_fields__}
    return {
        name: Learned(
            **{
                key: value[k] if key == "order" else STEP * value[k]
                for key, value in arrays.items()
            }
        )
        for k, name in enumerate(names)
    }


def learned_without(subject: str) -> Learned:
    """Return the statistics of other people than this one of the library."""
    return _stored()[subject if subject in TRAINING_PEOPLE else HELD_OUT_GROUP]


@final
class ComponentBox(Components):
    """Principal components; latents are poses within an ellipsoid that holds 98 % of the poses learned.

    Where they are mixed, most count as the middle of the part of their range that they are in: of `VALUES` equal ones.
    """

    def __init__(self, learned: Learned, count: int, mixed: bool = False) -> None:
        half = learned.half[:count]
        super().__init__(learned.mean, learned.components[:count], -half, half)
        self._spread, self._reach = (
            learned.spread[:count],
            float(learned.reach[SIZES.index(count)]),
        )
        self._stepped = (
            np.flatnonzero(np.arange(count) % 5 < 4) if mixed else np.arange(0)
        )
        # to either side of the middle
        self._parts = 0.5 * np.resize(VALUES, len(self._stepped))

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        if len(self._stepped):
            latents = latents.copy()
            half = self.high[self._stepped]
            parts = self._parts
            part = np.minimum(
                np.floor(latents[:, self._stepped] / half * parts), parts - 1.0
            )
            latents[:, self._stepped] = (part + 0.5) / parts * half
        return super().inverse_transform(latents)

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return which latents (n, m) are within the ellipsoid (n,)."""
        return self._beyond(latents) <= 1.0

    def within_reach(self, latents: Array) -> Array:
        """Return latents (n, m), those out of the ellipsoid moved onto it, straight towards its middle."""
        beyond = self._beyond(latents)
        share = np.where(beyond > 1.0, (1.0 - 1e-9) / np.maximum(beyond, 1.0), 1.0)
        return np.asarray(latents * share[:, None])

    def _beyond(self, latents: Array) -> Array:
        """Return how far latents (n, m) are from the middle (n,): 1 on the ellipsoid."""
        away = np.empty(len(latents))
        spreads_away(writeable(latents), self._spread, away)
        return away / self._reach


@final
class AngleBox(Components):
    """Latents of -1 to 1 are joint angles themselves, those that move the most; the others stay at their mean.

    With `rng` they are rotated at random, and each moves all of these joint angles.
    """

    def __init__(
        self, learned: Learned, count: int, rng: np.random.Generator | None = None
    ) -> None:
        order = (
            learned.order
            if count == len(learned.order)
            else learned.order[~np.isin(learned.order, SHOW_NOTHING)]
        )
        self.angles = np.sort(order[:count])
        low = learned.low[self.angles]
        high = learned.high[self.angles]
        self.reach = 0.5 * (high - low)
        # of the data
        self.constant = self.angles[np.abs(self.reach - CONSTANT) < 10.0 * STEP]
        self._rotation = np.eye(count)
        if rng is not None:
            rotation, signs = np.linalg.qr(rng.standard_normal((count, count)))
            self._rotation = np.round(rotation * np.sign(np.diag(signs)) / STEP) * STEP
        mean = learned.mean.copy()
        components = np.zeros((count, len(learned.mean)))
        mean[self.angles] = 0.5 * (low + high)
        components[:, self.angles] = self._rotation * self.reach
        super().__init__(mean, components, -np.ones(count), np.ones(count))

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray(
            (angles - self.mean)[:, self.angles] / self.reach @ self._rotation.T
        )


@final
class SequenceBox(Components):
    """Latents are cosines in time, of a motion of `FRAMES` frames, along the leading components.

    They are those with the least product of the component's and the cosine's number, from 1 on. Each of `frames` is the
    prior of one frame with the same latents, and the box itself that of the first.
    """

    def __init__(self, learned: Learned, count: int) -> None:
        order = sorted(
            np.ndindex(count, FRAMES),
            key=lambda term: ((term[0] + 1) * (term[1] + 1), term),
        )
        # how many half waves a cosine has in the motion
        components, halves = np.array(order[:count]).T
        times = (np.arange(FRAMES)[:, None] + 0.5) / FRAMES
        # (frames, m)
        self._waves = np.round(np.cos(np.pi * halves * times) / STEP) * STEP
        self._directions = learned.components[components]
        half = learned.half[components] / ((halves + 1) * np.sqrt(halves + 1))
        rows = self._waves[:, :, None] * self._directions
        super().__init__(learned.mean, rows[0], -half, half)
        self.frames = [Components(learned.mean, row, -half, half) for row in rows]

    def transform(self, angles: Array) -> Array:
        """Return the latents (1, m) nearest to the joint angles (frames, 63) of a motion."""
        latents = (angles - self.mean) @ self._directions.T
        return np.asarray(
            (self._waves * latents).sum(axis=0) / (self._waves**2).sum(axis=0)
        )[None]


SuiteBox = ComponentBox | AngleBox | SequenceBox


def is_upright(pose: Array) -> bool:
    """Return whether a wrapped pose (66,) is one that boxes are learned from: upright, no joint turned right round."""
    tilts = np.abs(pose[1:3])
    joints = np.abs(pose[3:])
    return bool(tilts.max() < math.radians(20.0) and joints.max() < 2.6)


@jit
def spreads_away(latents, spread, away):  # type: ignore[no-untyped-def]
    """Write the distance of latents (n, m) from the middle (n,), in spreads (m,): every machine adds in this order."""
    for i in range(latents.shape[0]):
        total = 0.0
        for m in range(latents.shape[1]):
            scaled = latents[i, m] / spread[m]
            total += scaled * scaled
        away[i] = np.sqrt(total)
