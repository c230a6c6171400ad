"""Codes: a few numbers a pose, by which poses are compared, left out where they repeat, and put into groups."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, Skeleton

Codes = NDArray[np.float32]  # (n, D): two of them are as far apart as the joints of their poses, root mean square
Rows = NDArray[np.int64]

DIMENSIONS = 24  # of a code: what it leaves out of the joints is below 5 mm
SAME = 0.02  # metres between the codes of poses that need not both be kept


@dataclass(frozen=True, eq=False)
class Coding:
    """Principal components of the joints of bodies that are turned to yaw 0."""

    skeleton: Skeleton
    mean: Array  # (81,) metres
    axes: Array = field(repr=False)  # (81, D)

    @classmethod
    def of(cls, skeleton: Skeleton, clips: Iterable[Array]) -> Self:
        """Return the components of the poses (K, 66) of all clips, which are looked at one after the other."""
        count, total, squares = 0, np.zeros(3 * len(JOINTS)), np.zeros((3 * len(JOINTS), 3 * len(JOINTS)))
        for poses in clips:
            joints = _facing(skeleton, poses)
            count, total, squares = count + len(joints), total + joints.sum(axis=0), squares + joints.T @ joints
        mean = total / count
        _, axes = np.linalg.eigh(squares - count * np.outer(mean, mean))
        return cls(skeleton, mean, axes[:, : -DIMENSIONS - 1 : -1] / np.sqrt(len(JOINTS)))

    def coded(self, poses: Array) -> Codes:
        """Return the codes (K, D) of poses (K, 66)."""
        return np.asarray((_facing(self.skeleton, poses) - self.mean) @ self.axes, dtype=np.float32)


def _facing(skeleton: Skeleton, poses: Array) -> Array:
    facing = poses.copy()
    facing[:, 0] = 0.0
    return np.asarray(skeleton.joints(facing).reshape(len(poses), -1))


def thinned(codes: Codes) -> Rows:
    """Return which frames of a clip to keep: each two centimetres or more from the last one kept, and both ends."""
    kept = [0]
    for k in range(1, len(codes)):
        if k == len(codes) - 1 or float(((codes[k] - codes[kept[-1]]) ** 2).sum()) > SAME**2:
            kept.append(k)
    return np.array(kept)


def groups(codes: Codes, most: int) -> tuple[Rows, Rows]:
    """Return centres (G,), each as far from those before it as any pose, and the group (K,) of each pose's nearest.

    Farthest-first traversal: Gonzalez, Clustering to minimize the maximum intercluster distance, 1985.
    """
    squares = (codes**2).sum(axis=1)
    nearest = np.full(len(codes), np.inf, dtype=np.float32)
    owners, centres = np.zeros(len(codes), dtype=np.int64), [0]
    while True:
        away = squares - 2.0 * (codes @ codes[centres[-1]]) + squares[centres[-1]]
        closer = away < nearest
        nearest[closer], owners[closer] = away[closer], len(centres) - 1
        farthest = int(nearest.argmax())
        if len(centres) == most or nearest[farthest] <= SAME**2:
            return np.array(centres), owners
        centres.append(farthest)  # TOYAMA2001 (exemplars)
