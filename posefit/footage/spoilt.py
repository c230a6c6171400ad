"""Observations that are spoilt on purpose."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from posefit.fitting.tracker import Observation
from posefit.silhouette.corruption import corrupted
from posefit.silhouette.mask import Silhouette

SALT = 2010  # part of every seed that spoils something


@dataclass(frozen=True, eq=False)
class Spoilt(Sequence[Observation]):
    """Observations with corruptions of some strength, and a share of the frames dropped; the same each time."""

    observations: Sequence[Observation] = field(repr=False)
    noise: dict[str, float]
    dropped: float
    seed: int

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        seen = self.observations[k]
        rng = np.random.default_rng([SALT, self.seed, k])
        lost = k > 0 and rng.random() < self.dropped
        masks = [corrupted(silhouette.mask, self.noise, rng) for silhouette in seen.silhouettes]
        return replace(seen, silhouettes=[Silhouette.of(mask) for mask in masks], usable=not lost)

    def __iter__(self) -> Iterator[Observation]:
        return (self[k] for k in range(len(self)))
