"""How the values of masks stand for a person: 0 and 1, 0 and 255, soft ones, an alpha channel, labels.

One file says too little, so all masks of a source are looked at before any of them is read.
"""

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.silhouette.mask import Mask

Values = NDArray[Any]  # (height, width): grey levels, an alpha channel, indices of a palette, or colours 0xRRGGBB

FEW = 64  # values: masks with more of them are soft
MOST = 4_096  # values that are counted
SCALES = (1.0, 255.0, 65_535.0)  # what a whole person has
NAMED = 6  # labels that a message names
WORTH = 2  # labels in a picture: from so many on, one has to be chosen


@dataclass(frozen=True)
class Reading:
    """Where a person is: above a value, or where a label is."""

    above: float = 0.0
    label: int | None = None

    def person(self, values: Values) -> Mask:
        """Return the mask (height, width) of a person."""
        return np.asarray(values > self.above if self.label is None else values == self.label)


@dataclass(eq=False)
class Palette:
    """Collects which values there are in all masks of a source, of one mask after the other."""

    soft: bool = False  # whether a value is a degree: in what is lossy, in fractions, in an alpha channel
    highest: float = 0.0
    pixels: Counter[int] = field(default_factory=Counter)  # with each value, while these are few
    solid: Counter[int] = field(default_factory=Counter)  # masks in which a value is more than an edge between others

    def add(self, values: Values, soft: bool) -> None:
        """Look at the next mask."""
        self.highest = max(self.highest, float(values.max()))
        self.soft |= soft or values.dtype.kind == "f"
        if self.soft:
            return
        found, counts = np.unique(values, return_counts=True) if self.highest > 1 else _binary(values)
        self.soft = len(found) + len(self.pixels) > MOST
        if self.soft:
            return
        self.pixels.update(dict(zip(found.tolist(), counts.tolist(), strict=True)))
        if len(found) > 1:
            self.solid.update(_solid(values, found))

    def reading(self, label: int | None, name: object) -> Reading:
        """Return how these masks are read. Raises ValueError where nobody can know which label is the person."""
        if label is not None:
            return self._labelled(label, name)
        values = sorted(self.pixels)
        if self.highest > SCALES[-1] and (self.soft or len(values) > FEW):
            raise many_colours(name)
        if self.soft or len(values) > FEW:
            return Reading(self._half)
        if len(values) <= 2:  # which ever two they are
            return Reading(float(values[0] if len(values) == 2 else min(values[0], 0)) if values else 0.0)
        labels = [value for value, _ in self.solid.most_common() if value]
        if len(labels) >= WORTH:
            raise ValueError(
                f"{name}: expected masks of one person, got the labels {self._named(labels)}; --label N chooses one"
            )
        return Reading(float(labels[0] // 2) if labels else self._half)

    @property
    def _half(self) -> float:
        """The value half way to a whole person: 127 of 255, as whole numbers have no middle."""
        full = next((scale for scale in SCALES if self.highest <= scale), self.highest)
        return 0.5 if full == 1.0 else float(full // 2)

    def _labelled(self, label: int, name: object) -> Reading:
        if self.soft:
            raise ValueError(
                f"{name}: label must be given for masks whose values are labels, PNG or whole numbers, got soft ones"
            )
        if label not in self.pixels:
            there = self._named([value for value, _ in self.pixels.most_common()])
            raise ValueError(f"{name}: label must be one of those that are there, {there}, got {label}")
        return Reading(label=label)

    def _named(self, labels: list[int]) -> str:
        """Return some labels, the commonest first; colours as hexadecimal numbers."""
        written = [str(one) if self.highest <= SCALES[-1] else f"0x{one:06x}" for one in labels[:NAMED]]
        return ", ".join(written) + (f" and {len(labels) - NAMED} others" if len(labels) > NAMED else "")


def many_colours(name: object) -> ValueError:
    """Return the error of pictures that are no masks."""
    return ValueError(f"{name}: expected masks, got pictures in many colours; a person cut out needs an alpha channel")


def _binary(values: Values) -> tuple[NDArray[Any], NDArray[Any]]:
    ones = int(np.count_nonzero(values))
    counts = np.array([values.size - ones, ones])
    return np.flatnonzero(counts), counts[counts > 0]


def _solid(values: Values, found: NDArray[Any]) -> list[int]:
    """Return those values that fill 3 x 3 pixels somewhere: what lies between two others at an edge does not."""
    if len(found) > FEW:
        return []
    numbers = np.searchsorted(found, values).astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    same = cv2.erode(numbers, kernel) == cv2.dilate(numbers, kernel)
    return [int(found[k]) for k in np.unique(numbers[same])]
