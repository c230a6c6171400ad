"""Decide which values of masks are the person.

Values may be 0 and 1, 0 and 255, soft values in between, an alpha channel or labels.
One mask alone does not show which, so all values of a source are counted first.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.errors import InputError
from posefit.footage.images import MANY_COLOURS, Marks, flat_share
from posefit.footage.views import MOST
from posefit.reading import cut
from posefit.silhouette.mask import Mask

# different values that are counted: masks with more of them are soft
COUNTED_VALUES = 4_096
SCALES = (1.0, 255.0, 65_535.0)  # values of a pixel that is entirely the person
PERCENT = 100.0
# times a scale: resampled soft masks overshoot it a little
NEAR_SCALE = 1.25
# share of the highest value, unless that is a usual scale: resampled masks undershoot
# 0 by at most this much
RINGING = 0.1
# share of the highest value: numbers less than this below 0 are noise
NOISE = 0.03
# share of pixels: if more are negative, resampling does not explain them
NEGATIVE_SHARE = 0.25
# (height, width): grey levels, an alpha channel, palette indices, or colours 0xRRGGBB
Values = NDArray[Any]
# turns values into the mask (height, width) of the person
Classifier = Callable[[Values], Mask]


@dataclass(eq=False)
class ValueCounts:
    """Counts the values in all masks of a source, and decides which are the person."""

    # whether values say how much of a pixel is the person, as in lossy images,
    # fractions and alpha channels
    soft: bool = False
    alpha: bool = False  # whether all masks are alpha channels
    many_valued: int = 0  # masks with more than two values
    flat_masks: int = 0  # the ones among these with flat areas, like maps of labels
    fractions: bool = False  # whether some values are not whole numbers
    lowest: float = np.inf
    highest: float = 0.0
    count: int = 0  # pixels
    negative: int = 0  # the ones among these that are clearly below 0
    # pixels with each value; no longer counted once masks are soft
    pixels: Counter[int | float] = field(default_factory=Counter)
    # masks in which each value fills an area, and not only the edge between two others
    solid: Counter[int | float] = field(default_factory=Counter)

    def add(self, marks: Marks) -> None:
        """Count the next mask."""
        values = marks.values
        low = values.min()
        high = values.max()
        first = self.lowest == np.inf
        self.alpha = marks.alpha and (self.alpha or first)
        self.lowest = min(self.lowest, float(low))
        self.highest = max(self.highest, float(high))
        self.fractions |= values.dtype.kind == "f" and bool(
            (values != np.floor(values)).any()
        )
        self.count += values.size
        if low < 0:
            self.negative += int(np.count_nonzero(values < -NOISE * abs(high)))
        self.soft |= marks.soft
        if self.soft:
            return
        top = int(np.count_nonzero(values == high))
        # masks with one or two values are common, and counting is faster than sorting
        if low == high:
            unique = np.array([high])
            counts = np.array([top])
        elif top + np.count_nonzero(values == low) == values.size:
            unique = np.array([low, high])
            counts = np.array([values.size - top, top])
        else:
            unique, counts = np.unique(values, return_counts=True)
        self.pixels.update(dict(zip(unique.tolist(), counts.tolist(), strict=True)))
        self.soft = len(self.pixels) > (2 if self.fractions else COUNTED_VALUES)
        if len(unique) > 1 and not self.soft:
            self.solid.update(_solid(values, unique))
            self.many_valued += len(unique) > 2
            self.flat_masks += len(unique) > 2 and flat_share(values) >= MOST

    def classifier(
        self, label: int | None, name: object
    ) -> tuple[Classifier, list[str]]:
        """Decide which values are the person.

        Args:
            label: The person's value, if the user gave one.
            name: What messages call the source.

        Returns:
            A function that turns values into a mask, and what was guessed about them.

        Raises:
            InputError: There are several labels, or the given one does not occur.
        """
        if label is not None:
            return self._labelled(label, name), []
        values = sorted(self.pixels)
        many = len(values) > MANY_COLOURS
        if many and not self.soft and 2 * self.flat_masks > self.many_valued:
            most = [value for value, _ in self.pixels.most_common() if value]
            raise self._several(name, most)
        if self.highest > SCALES[-1] and (self.soft or many):
            raise many_colours(name)
        ends = f"{name}: masks of values from {self.lowest:.4g} to {self.highest:.4g}"
        if self.soft or many:
            half, kind = self._half
            return above(half), [f"{ends} are {kind}: the person is above {half:g}"]
        if len(values) <= 2:
            threshold, usual = _of_two(values)
            guess = f"{ends}: the person is the higher of two"
            return above(threshold), [] if usual else [guess]
        labels = [value for value, _ in self.solid.most_common() if value]
        if len(labels) > 1:
            raise self._several(name, labels)
        if labels:
            threshold = float(labels[0] // 2)
            # a value far above the only label is not its edge: in PASCAL VOC, 255 marks
            # the outlines of objects
            limit = max(labels[0], NEAR_SCALE * labels[0])
        else:
            threshold, _ = self._half
            limit = self.highest
        words = f"{ends}: the person is above {threshold:g}"
        if self.highest > limit:
            guess = f"{words}, and what is above {limit:g} is not"
            return _between(threshold, limit), [guess]
        return above(threshold), [f"{words}, and values in between are edges"]

    def _labelled(self, label: int, name: object) -> Classifier:
        """Return the classifier of a label that the user gave."""
        if self.soft:
            raise InputError(
                f"{name}: label must be left out for soft masks, got {label}: "
                "only PNG files and whole numbers have labels"
            )
        if label not in self.pixels:
            there = self._listed([value for value, _ in self.pixels.most_common()])
            raise InputError(f"{name}: label must be one of {there}, got {label}")
        return lambda values: np.asarray(values == label)

    def _several(self, name: object, labels: Sequence[float]) -> InputError:
        """Return the error for masks with several labels that could be the person."""
        if self.alpha:  # a label that is given is looked for in the colours
            return InputError(
                f"{name}: expected masks of one person, got the levels of transparency "
                f"{self._listed(labels)}; save them as grey levels, of which --label N "
                "chooses one"
            )
        return InputError(
            f"{name}: expected masks of one person, got the labels "
            f"{self._listed(labels)}; --label N chooses one"
        )

    @property
    def _half(self) -> tuple[float, str]:
        """The value of a pixel that is half person, and what kind of values these are.

        It is rounded down, because whole numbers have no middle: 127 of 255. Numbers up
        to about 100 are percentages. Negative numbers are a network's logits, whose
        middle is 0, unless they are so small and so few that resampling explains them:
        it undershoots along edges, and logits are negative in the whole background. An
        alpha channel that is nowhere half opaque is a translucent colour.
        """
        usual = any(
            0.5 * scale <= self.highest <= NEAR_SCALE * scale for scale in SCALES
        )
        # resampling undershoots 0 as far as it overshoots the scale
        below = NEAR_SCALE - 1.0 if usual else RINGING
        # values of a usual scale are often a little below 0 in the whole background
        mostly = not usual and self.negative > NEGATIVE_SHARE * self.count
        if mostly or self.lowest < -below * self.highest:
            return 0.0, "logits"
        if self.alpha and self.highest <= SCALES[1] // 2:
            return float(self.highest // 2), "translucent"
        # fractions that fit no usual scale: above 1, and far below 255
        if self.fractions and NEAR_SCALE < self.highest < SCALES[1] / 4.0:
            return self.highest / 2.0, "confidences"
        # on the scale of 255, no pixel would be more than half person
        if 0.5 * PERCENT < self.highest <= NEAR_SCALE * PERCENT:
            return 0.5 * PERCENT, "percentages"
        scales = [scale for scale in SCALES if self.highest <= NEAR_SCALE * scale]
        full = scales[0] if scales else self.highest
        return (0.5 if full == 1.0 else float(full // 2)), "confidences"

    def _listed(self, labels: Sequence[float]) -> str:
        """Return labels for a message, shortened; colours as hexadecimal numbers."""
        are_colours = self.highest > SCALES[-1]
        written = [f"0x{value:06x}" if are_colours else str(value) for value in labels]
        return cut(", ".join(written))


def _of_two(values: Sequence[float]) -> tuple[float, bool]:
    """Return the threshold of at most two values, and whether they are usual.

    The higher of two values is the person. A single value is the person unless it is 0
    or negative. Usual values are 0, 1 and 255, and need no guess.
    """
    if not values:
        return 0.0, True
    usual = min(values[0], 0) == 0 and values[-1] in (0, *SCALES[:2])
    lower = values[0] if len(values) == 2 else min(values[0], 0)
    return float(lower), usual


def above(threshold: float) -> Classifier:
    """Return the classifier for which values above a threshold are the person."""
    return lambda values: np.asarray(values > threshold)


def _between(threshold: float, most: float) -> Classifier:
    return lambda values: np.asarray((values > threshold) & (values <= most))


def many_colours(name: object) -> InputError:
    """Return the error for pictures in many colours, which are not masks."""
    return InputError(
        f"{name}: expected masks, got pictures in many colours: "
        "make masks of the person, or cut them out with an alpha channel"
    )


def _solid(values: Values, unique: NDArray[Any]) -> list[int]:
    """Return the values that fill 3 x 3 pixels somewhere, as a mere edge does not."""
    if len(unique) > MANY_COLOURS:
        return []
    numbers = np.searchsorted(unique, values).astype(np.uint8)
    kernel = np.ones((3, 3), np.uint8)
    same = cv2.erode(numbers, kernel) == cv2.dilate(numbers, kernel)
    return [int(unique[k]) for k in np.unique(numbers[same])]
