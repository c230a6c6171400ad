"""A sum of squares over frames, in which a frame meets only the two next to it on either side."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from posefit.arrays import Array

REACH = 2  # frames to either side that a frame meets
BEND = np.array([1.0, -2.0, 1.0])


@dataclass(frozen=True, eq=False)
class Squares:
    """Half the second derivative and half the gradient of a sum of squares, in T frames of n numbers each."""

    curves: Array  # (REACH + 1, T, n, n): a frame with itself, with the next one, and with the one after that
    slopes: Array  # (T, n)

    @classmethod
    def of(cls, frames: int, numbers: int) -> Self:
        """Return the sum of nothing."""
        return cls(np.zeros((REACH + 1, frames, numbers, numbers)), np.zeros((frames, numbers)))

    def add(self, which: slice, precise: Array, slopes: Array) -> None:
        """Add squares of some numbers of each frame: their precision (m, m) or (T, m, m), and its product (T, m)."""
        self.curves[0, :, which, which] += precise
        self.slopes[:, which] += slopes

    def add_bends(self, which: slice, series: Array, weight: float) -> None:
        """Add the squares of `weight` times the second differences of some numbers, which are now `series` (T, m)."""
        bends = weight**2 * np.diff(series, 2, axis=0)
        count, some = len(series), np.arange(which.start, which.stop)
        for first in range(3):
            frames = slice(first, count - 2 + first)
            self.slopes[frames, which] += BEND[first] * bends
            for second in range(first, 3):
                self.curves[second - first, frames, some, some] += weight**2 * BEND[first] * BEND[second]

    def add_steps(self, frames: NDArray[np.int64], series: Array, derivatives: Array, weight: float) -> None:
        """Add the squares of `weight` times what `series` (T, m) goes from some frames to the next ones.

        `derivatives` (T, m, n) are those of the series, by the numbers of its own frame.
        """
        if not len(frames):
            return
        steps = weight**2 * (series[frames + 1] - series[frames])
        here, there = derivatives[frames], derivatives[frames + 1]
        self.slopes[frames] -= np.einsum("kmn,km->kn", here, steps)
        self.slopes[frames + 1] += np.einsum("kmn,km->kn", there, steps)
        self.curves[0, frames] += weight**2 * np.einsum("kmi,kmj->kij", here, here)
        self.curves[0, frames + 1] += weight**2 * np.einsum("kmi,kmj->kij", there, there)
        self.curves[1, frames] -= weight**2 * np.einsum("kmi,kmj->kij", here, there)

    def least(self) -> Array:
        """Return the step (T, n) that is to be taken away from the numbers, so that the sum is least."""
        return self.steps_for(self.slopes[..., None])[..., 0]

    def steps_for(self, slopes: Array) -> Array:
        """Return the steps (T, n, m) that would be the least ones, were the slopes each of m others (T, n, m)."""
        _, count, numbers, _ = self.curves.shape
        band = (REACH + 1) * numbers
        lines = np.zeros((band, count * numbers))  # scipy's upper form: lines[band - 1 + row - column, column]
        for apart in range(REACH + 1):
            for row in range(numbers):
                for column in range(numbers):
                    off = apart * numbers + column - row
                    if off >= 0:
                        values = self.curves[apart, : count - apart, row, column]
                        lines[band - 1 - off, apart * numbers + column :: numbers] = values
        found = solveh_banded(lines, slopes.reshape(count * numbers, -1), check_finite=False)
        return np.asarray(found).reshape(slopes.shape)
