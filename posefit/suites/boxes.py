"""The boxes that a suite searches: joint angles as a few numbers, from `boxes.npz`.

A box is never learned from the person in the silhouette. The library has ten people.
Seven of them are for training, and for an instance of one of these the box was learned
from the six others. Three are held out, and their boxes were learned from the seven.

`docs/studies/make_boxes.py` made the file. Its numbers are rounded, and sums are
computed in a fixed order, so that a proposal is the same pose on every machine.
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
STEP = 1e-4  # radians; stored numbers are whole multiples of it
# numbers of components of the boxes of 9, 10, 16, 20, 24 and 40 dimensions
SIZES = (6, 7, 13, 17, 21, 37)
# These joint angles turn a hand about its forearm, which a silhouette does not show
# unless fingers move as well.
SHOW_NOTHING = (49, 61)
FRAMES = 8  # frames of a sequence
# Of five mixed latents, four have these numbers of values, and the fifth is continuous.
VALUES = (2, 4, 8, 16)
# the range, to either side, of joint angles that are constant in the data
CONSTANT = math.radians(10.0)
HELD_OUT_GROUP = "held out"  # the name of the box learned from all people for training


@dataclass(frozen=True, eq=False)
class Learned:
    """The statistics of the poses of one group of people.

    Attributes:
        mean: The mean joint angles (63,) in radians.
        components: The principal components (37, 63).
        spread: The standard deviation along each component (37,), radians.
        half: The half-side of the box along each component (37,), radians.
        reach: The radius of the ellipsoid of poses in spreads (6,), for each of
            `SIZES`.
        low: The lower end of each joint angle's range (63,), radians.
        high: The upper end (63,).
        order: The joint angles (63,) by their variation, the largest first.
    """

    mean: Array
    components: Array = field(repr=False)
    spread: Array
    half: Array
    reach: Array
    low: Array
    high: Array
    order: NDArray[np.int64]


@lru_cache(maxsize=1)
def _stored() -> dict[str, Learned]:
    with (
        (files("posefit.suites") / "boxes.npz").open("rb") as file,
        np.load(file) as stored,
    ):
        names = stored["names"].tolist()
        arrays = {name: stored[name] for name in Learned.__dataclass_fields__}
    groups = {}
    for k, name in enumerate(names):
        # the file has all numbers but the order in whole steps
        values = {key: STEP * value[k] for key, value in arrays.items()}
        values["order"] = arrays["order"][k]
        groups[name] = Learned(**values)
    return groups


def learned_without(subject: str) -> Learned:
    """Return the statistics of people that do not include this one of the library."""
    if subject not in TRAINING_PEOPLE:
        subject = HELD_OUT_GROUP
    return _stored()[subject]


@final
class ComponentBox(Components):
    """Latents along principal components.

    Feasible latents are in an ellipsoid that contains 98 % of the learned poses.

    Args:
        learned: The statistics of the poses.
        count: The number of components, one of `SIZES`.
        mixed: Whether most latents have only a few values, as `VALUES` says. Such a
            latent's range is divided into equal parts, and the latent counts as the
            middle of its part.
    """

    def __init__(self, learned: Learned, count: int, mixed: bool = False) -> None:
        half = learned.half[:count]
        super().__init__(learned.mean, learned.components[:count], -half, half)
        self._spread = learned.spread[:count]
        self._reach = float(learned.reach[SIZES.index(count)])
        self._stepped = np.arange(0)
        if mixed:
            self._stepped = np.flatnonzero(np.arange(count) % 5 < 4)
        # the number of parts to either side of the middle
        self._parts = 0.5 * np.resize(VALUES, len(self._stepped))

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        if len(self._stepped):
            latents = latents.copy()
            half = self.high[self._stepped]
            parts = self._parts
            part = np.floor(latents[:, self._stepped] / half * parts)  # (n, stepped)
            # the upper end of the range belongs to the last part
            part = np.minimum(part, parts - 1.0)
            latents[:, self._stepped] = (part + 0.5) / parts * half
        return super().inverse_transform(latents)

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return whether each of the latents (n, m) is in the ellipsoid (n,)."""
        return self._beyond(latents) <= 1.0

    def within_reach(self, latents: Array) -> Array:
        """Return latents (n, m) in the ellipsoid.

        Latents outside are moved onto its surface, straight towards its middle.
        """
        beyond = self._beyond(latents)
        share = np.where(beyond > 1.0, (1.0 - 1e-9) / np.maximum(beyond, 1.0), 1.0)
        return np.asarray(latents * share[:, None])

    def _beyond(self, latents: Array) -> Array:
        """Return the distance (n,) of latents (n, m), 1 at the ellipsoid's surface."""
        away = np.empty(len(latents))
        spreads_away(writeable(latents), self._spread, away)
        return away / self._reach


@final
class AngleBox(Components):
    """Latents from -1 to 1 are joint angles themselves.

    They are the angles that vary most. The others are constant at their mean.

    Args:
        learned: The statistics of the poses.
        count: The number of joint angles.
        rng: If given, the latents are rotated at random, and each moves all these
            angles.
    """

    def __init__(
        self, learned: Learned, count: int, rng: np.random.Generator | None = None
    ) -> None:
        order = learned.order
        if count < len(order):
            order = order[~np.isin(order, SHOW_NOTHING)]
        self.angles = np.sort(order[:count])
        low = learned.low[self.angles]
        high = learned.high[self.angles]
        self.reach = 0.5 * (high - low)
        # the angles that are constant in the data
        self.constant = self.angles[np.abs(self.reach - CONSTANT) < 10.0 * STEP]
        self._rotation = np.eye(count)
        if rng is not None:
            rotation, triangle = np.linalg.qr(rng.standard_normal((count, count)))
            # the signs that QR chooses differ between libraries
            rotation = rotation * np.sign(np.diag(triangle))
            self._rotation = np.round(rotation / STEP) * STEP
        mean = learned.mean.copy()
        components = np.zeros((count, len(learned.mean)))
        mean[self.angles] = 0.5 * (low + high)
        components[:, self.angles] = self._rotation * self.reach
        super().__init__(mean, components, -np.ones(count), np.ones(count))

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        scaled = (angles - self.mean)[:, self.angles] / self.reach  # (n, m)
        return np.asarray(scaled @ self._rotation.T)


@final
class SequenceBox(Components):
    """Latents are amplitudes of cosines in time along the leading components.

    They describe a motion of `FRAMES` frames. Components and cosines are numbered from
    1 on; the latents are the pairs with the smallest products of these numbers.

    Args:
        learned: The statistics of the poses.
        count: The number of latents.

    Attributes:
        frames: The prior of each frame, all with the same latents. The box itself is
            the prior of the first frame.
    """

    def __init__(self, learned: Learned, count: int) -> None:
        order = sorted(
            np.ndindex(count, FRAMES),
            key=lambda term: ((term[0] + 1) * (term[1] + 1), term),
        )
        # of each latent: its component, and the half waves of its cosine in the motion
        components, halves = np.array(order[:count]).T
        times = (np.arange(FRAMES)[:, None] + 0.5) / FRAMES
        waves = np.cos(np.pi * halves * times)  # (frames, m)
        self._waves = np.round(waves / STEP) * STEP
        self._directions = learned.components[components]
        half = learned.half[components] / ((halves + 1) * np.sqrt(halves + 1))
        rows = self._waves[:, :, None] * self._directions
        super().__init__(learned.mean, rows[0], -half, half)
        self.frames = [Components(learned.mean, row, -half, half) for row in rows]

    def transform(self, angles: Array) -> Array:
        """Return the latents (1, m) nearest to a motion's joint angles (frames, 63)."""
        latents = (angles - self.mean) @ self._directions.T  # (frames, m)
        products = (self._waves * latents).sum(axis=0)
        return np.asarray(products / (self._waves**2).sum(axis=0))[None]


SuiteBox = ComponentBox | AngleBox | SequenceBox


def is_upright(pose: Array) -> bool:
    """Return whether boxes may be learned from a wrapped pose (66,).

    The person must be upright, and no joint angle near half a turn.
    """
    tilts = np.abs(pose[1:3])
    joints = np.abs(pose[3:])
    return bool(tilts.max() < math.radians(20.0) and joints.max() < 2.6)


@jit
def spreads_away(latents, spread, away):  # type: ignore[no-untyped-def]
    """Write the distance of latents (n, m) from the middle (n,), in spreads (m,).

    The loop has the same order of additions on every machine.
    """
    for i in range(latents.shape[0]):
        total = 0.0
        for m in range(latents.shape[1]):
            scaled = latents[i, m] / spread[m]
            total += scaled * scaled
        away[i] = np.sqrt(total)
