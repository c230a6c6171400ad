"""What the SAPSO paper's experiments found, from which tables, figures and claims are made."""

from dataclasses import dataclass, field
from itertools import product
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.geometry.rotation import wrapped
from posefit.tracking.measures import BASELINES
from posefit_reproduce.sapso.design import Scale
from posefit_reproduce.sapso.motions import PaperMotion


class TrackKey(NamedTuple):
    """Names a track."""

    motion: str
    method: str
    view: float
    seed: int


@dataclass(frozen=True, eq=False)
class PaperTrack:
    """What a track found."""

    poses: Array = field(repr=False)  # (T, 66)
    seconds: float  # a frame
    evaluations: float  # a frame
    swapped: float  # share of frames
    lost: float


@dataclass(frozen=True, eq=False)
class PaperResults:
    """Everything that was found, from which tables and figures are made."""

    motions: dict[str, PaperMotion]
    scale: Scale
    seeds: int
    tracks: dict[TrackKey, PaperTrack] = field(repr=False)
    baselines: dict[tuple[str, float], dict[str, Array]] = field(repr=False)  # poses (T, 66) of each baseline
    histories: dict[tuple[str, float, int], Array] = field(repr=False)  # (swarms, iterations + 1) lowest cost

    def of(self, motion: str, method: str) -> list[PaperTrack]:
        """Return the tracks of a method, view by view and seed by seed."""
        return [self.tracks[TrackKey(motion, method, view, seed)] for view, seed in self._pairs]

    @property
    def _pairs(self) -> list[tuple[float, int]]:
        return list(product(self.scale.views, range(self.seeds)))

    def poses(self, motion: str, name: str) -> Array:
        """Return what a method or a baseline makes of a motion, (views, seeds, T, 66)."""
        found = [
            self.baselines[motion, view][name]
            if name in BASELINES
            else self.tracks[TrackKey(motion, name, view, seed)].poses
            for view, seed in self._pairs
        ]
        return np.array(found).reshape(len(self.scale.views), self.seeds, *found[0].shape)

    def errors(self, motion: str, name: str) -> Array:
        """Return the errors (8) in degrees of a method or a baseline, (views, seeds, T)."""
        poses, truth = self.poses(motion, name), self.motions[motion].test.poses
        return np.array([[metrics.pose_error_degrees(truth, one) for one in view] for view in poses])

    def angle_errors(self, motion: str, name: str) -> Array:
        """Return the mean absolute error (66,) of each angle in degrees, over views, seeds and frames."""
        away = wrapped(self.poses(motion, name) - self.motions[motion].test.poses)
        return np.asarray(np.degrees(np.abs(away)).mean(axis=(0, 1, 2)))
