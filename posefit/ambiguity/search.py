"""Every pose of the library at every yaw whose silhouette is nearly as good as the best one's.

Five million combinations are looked at from coarse to fine: every third yaw in a small picture, the neighbours of what
is good there, and at full size what is good in the small picture. What is left out at a step is so much worse than the
best that the next step does not make up for it; `MARGIN` and `BLUR` say how much that is, and the tests hold the
result against all combinations at full size.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from posefit.ambiguity.library import Rows
from posefit.arrays import Array
from posefit.fitting.alignment import align
from posefit.fitting.problem import over_views
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import areas
from posefit.silhouette.mask import Silhouette
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette

YAWS = 72  # of a full turn: five degrees apart
EVERY = 3  # of them are looked at first
MARGIN = 12.0  # units of cost that a pose may be worse, at the next of these yaws, in a small picture
BLUR = 4.0  # units of cost that a pose may be worse in a small picture, beside the best one there
FACTORS = (8, 4, 2)  # of small pictures
PIXELS = 400  # of a person in a small picture, at least
PART = 4096  # poses that are made at a time
MOST = 20_000  # poses and yaws that can be compared with each other


@dataclass(frozen=True, eq=False)
class Moment:
    """What one camera or several saw of a person in one frame."""

    body: Body
    cameras: Sequence[Camera]
    silhouettes: Sequence[Silhouette] = field(repr=False)
    anchor: Array  # (3,) metres: where the root is, or about where it is
    known: bool  # whether the root is known to be there; else poses are aligned to the silhouettes' borders
    threads: int = 1

    @property
    def factor(self) -> int:
        """Which small picture is enough: one with every so many pixels of every so many rows."""
        fewest = min(silhouette.pixels for silhouette in self.silhouettes if silhouette.known)
        return next((factor for factor in FACTORS if fewest >= factor**2 * PIXELS), 1)

    def coarser(self, factor: int) -> Self:
        """Return the same in a smaller picture."""
        cameras = [coarser_camera(camera, factor) for camera in self.cameras]
        return replace(self, cameras=cameras, silhouettes=[coarser_silhouette(one, factor) for one in self.silhouettes])

    def only(self, views: Sequence[int]) -> Self:
        """Return what some of the cameras saw."""
        return replace(self, cameras=[self.cameras[v] for v in views], silhouettes=[self.silhouettes[v] for v in views])

    def placed(self, poses: Array) -> Array:
        """Return where poses (n, 66) stand (n, 3)."""
        anchors = np.repeat(self.anchor[None], len(poses), axis=0)
        return anchors if self.known else align(self.body, self.cameras, self.silhouettes, poses, anchors)

    def costs(self, poses: Array, translations: Array) -> Array:
        """Return the cost (n,) of poses (n, 66) at translations (n, 3): the mean over the cameras."""
        views = zip(self.cameras, self.silhouettes, strict=True)
        counts = [areas(self.body, *view, poses, translations, self.threads) for view in views]
        return over_views(counts, self.silhouettes)


@dataclass(frozen=True, eq=False)
class States:
    """Poses and yaws that a silhouette does not tell apart."""

    rows: Rows = field(repr=False)  # (n,) of the library
    poses: Array = field(repr=False)  # (n, 66) turned to their yaws
    translations: Array = field(repr=False)  # (n, 3) metres
    costs: Array = field(repr=False)  # (n,)

    def __len__(self) -> int:
        return len(self.rows)

    def weights(self, temperature: float) -> Array:
        """Return how likely each is (n,), if all were equally likely before: exp(-cost / temperature). Sum 1."""
        weights = np.exp((self.costs.min() - self.costs) / temperature)
        return np.asarray(weights / weights.sum())


def states_within(moment: Moment, poses: Array, within: float) -> States:
    """Return all of poses (K, 66), at any of 72 yaws, whose cost is at most so much above the least.

    Raises ValueError where they are too many to be compared with each other.
    """
    small = moment.coarser(moment.factor)
    rows, yaws = np.tile(np.arange(len(poses)), YAWS // EVERY), np.repeat(np.arange(0, YAWS, EVERY), len(poses))
    rows, yaws, _ = _best(small, poses, rows, yaws, within + MARGIN)
    beside = [np.mod(yaws + step, YAWS) for step in range(-(EVERY // 2), EVERY // 2 + 1)]
    rows, yaws, _ = _best(small, poses, np.tile(rows, EVERY), np.concatenate(beside), within + BLUR)
    rows, yaws, costs = _best(moment, poses, rows, yaws, within)
    if len(rows) > MOST:
        raise ValueError(
            f"within must be so little that at most {MOST:,} poses and yaws are left, got {within:g}, "
            f"which leaves {len(rows):,}"
        )
    turned = turned_to(poses[rows], yaws)
    return States(rows, turned, moment.placed(turned), costs)


def turned_to(poses: Array, yaws: Rows) -> Array:
    """Return copies of poses (n, 66), each turned to one of the 72 yaws (n,)."""
    turned = np.array(poses)
    turned[:, 0] = 2.0 * np.pi / YAWS * yaws
    turned[turned[:, 0] > np.pi, 0] -= 2.0 * np.pi
    return turned


def _best(moment: Moment, poses: Array, rows: Rows, yaws: Rows, within: float) -> tuple[Rows, Rows, Array]:
    """Return those of some rows (n,) and yaws (n,) whose cost is at most so much above the least, and their costs."""
    costs = np.empty(len(rows))
    for start in range(0, len(rows), PART):
        part = slice(start, start + PART)
        turned = turned_to(poses[rows[part]], yaws[part])
        costs[part] = moment.costs(turned, moment.placed(turned))
    best = costs <= costs.min() + within
    return rows[best], yaws[best], costs[best]
