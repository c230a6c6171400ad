"""The poses among which the niching task has its known ones: legs and trunk of walks and runs, arms of everything.

Legs and arms have coordinates of their own, so that the same legs go with any arms. Poses are learned together with
their mirror images and are worn by the average body, whose sides are alike: so a mirrored pose is in the box, too.
"""

from functools import lru_cache
from pathlib import Path
from typing import Self, final

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.alike import mirrored_poses
from posefit.geometry.limbs import LIMBS
from posefit.geometry.skeleton import ANGLES, INNER, JOINTS, Skeleton, angle_index
from posefit.motion import built_in, recorded

# walks and runs of eight people
STRIDES = ("02_01", "05_01", "49_01", "16_16", "29_01", "09_12", "16_13", "16_22", "16_31", "09_01", "16_35", "127_06")
COMPONENTS = (3, 2)  # ours: of legs and trunk, and of the arms; with more, poses that nobody lists fit as well
SPARSE = 4  # every so many poses of the library lend their arms: neighbours are alike

_ARMS = np.zeros(ANGLES, dtype=bool)
for _joint in INNER:
    if JOINTS[_joint] in (*LIMBS["left arm"], *LIMBS["right arm"]):
        _ARMS[angle_index(_joint) : angle_index(_joint) + 3] = True
ARMS = np.flatnonzero(_ARMS)  # angles of a pose (66,) that belong to its arms


@final
class LegsAndArms:
    """A prior of joint angles: principal components of legs and trunk, and of the arms by themselves."""

    mean: Array  # (63,)
    components: Array  # (m, 63), those of legs and trunk first
    low: Array  # (m,)
    high: Array  # (m,)

    def fit(
        self,
        angles: Array,
        skeleton: Skeleton | None = None,  # noqa: ARG002, as of any prior
        arms: Array | None = None,
    ) -> Self:
        """Learn from joint angles (T, 63), and the arms from others (n, 63) where there are any."""
        taught = (angles, angles if arms is None else arms)
        columns = (~_ARMS[3:], _ARMS[3:])
        self.mean, rows = np.zeros(ANGLES - 3), []
        for learned, mine, count in zip(taught, columns, COMPONENTS, strict=True):
            self.mean[mine] = learned[:, mine].mean(axis=0)
            directions = np.linalg.svd(learned[:, mine] - self.mean[mine], full_matrices=False)[2][:count]
            directions *= np.sign(directions[np.arange(count), np.abs(directions).argmax(axis=1)])[:, None]
            block = np.zeros((count, ANGLES - 3))
            block[:, mine] = directions
            rows.append(block)
        self.components = np.concatenate(rows)
        latents = [self.transform(learned) for learned in taught]
        first = COMPONENTS[0]
        ranges = [np.array([one.min(axis=0), one.max(axis=0)]) for one in latents]
        self.low, self.high = np.concatenate([ranges[0][:, :first], ranges[1][:, first:]], axis=1)
        return self

    def transform(self, angles: Array) -> Array:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return np.asarray((np.asarray(angles) - self.mean) @ self.components.T)

    def inverse_transform(self, latents: Array) -> Array:
        """Return the joint angles (n, 63) of latents (n, m)."""
        angles = np.tile(self.mean, (len(latents), 1))
        for k, direction in enumerate(self.components):  # no matrix product: its last bits hang on the other rows
            angles += latents[:, k, None] * direction
        return angles

    def feasible(self, latents: Array) -> NDArray[np.bool_]:
        """Return that all latents (n, m) are poses (n,)."""
        return np.ones(len(latents), dtype=bool)

    def save(self, path: str | Path) -> None:
        """Write what was learned."""
        np.savez(path, mean=self.mean, components=self.components, low=self.low, high=self.high)

    def held(self, poses: Array) -> Array:
        """Return the poses (n, 66) of the box that are nearest to poses (n, 66)."""
        poses = np.array(poses, dtype=np.float64)
        poses[:, 3:] = self.inverse_transform(np.clip(self.transform(poses[:, 3:]), self.low, self.high))
        return poses


@lru_cache(maxsize=1)
def stride_poses() -> Array:
    """Return the poses (n, 66) of walks and runs, and their mirror images."""
    return _both(np.concatenate([recorded.clip(name).poses for name in STRIDES]))


@lru_cache(maxsize=1)
def lent_arms() -> Array:
    """Return poses (n, 66) of the whole library, whose arms are lent to others, and their mirror images."""
    return _both(np.concatenate([clip.poses for clip in recorded.clips()])[::SPARSE])


@lru_cache(maxsize=1)
def legs_and_arms() -> LegsAndArms:
    """Return the prior of the niching task."""
    return LegsAndArms().fit(stride_poses()[:, 3:], arms=lent_arms()[:, 3:])


@lru_cache(maxsize=1)
def held_arms() -> Array:
    """Return the angles of these arms (n, 30) as the box holds them."""
    arms = legs_and_arms().held(lent_arms())[:, ARMS]
    arms.setflags(write=False)
    return arms


def _both(poses: Array) -> Array:
    both = np.concatenate([poses, mirrored_poses(built_in.average_skeleton(), poses)])
    both.setflags(write=False)
    return both
