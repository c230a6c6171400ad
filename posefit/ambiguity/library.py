"""The poses that a silhouette is compared with: those that clips go through, and their mirror images."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.alike import mirrored_poses
from posefit.geometry.skeleton import JOINTS, Skeleton
from posefit.motion.motion import Motion

SAME = 0.02  # metres between joints, root mean square: a nearer pose of the same clip need not be kept as well

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LibraryPoses:
    """Poses (K, 66), in the order of their clips, and where each is from. The mirror images are the second half."""

    poses: Array = field(repr=False)
    names: tuple[str, ...]  # of the clips
    clips: Rows = field(repr=False)  # (K,) number of the clip
    frames: Rows = field(repr=False)  # (K,) frame of the clip

    @classmethod
    def of(cls, motions: Sequence[Motion], skeleton: Skeleton) -> Self:
        """Return the poses of motions, and their mirror images; `skeleton` is the person's who is looked for.

        A frame nearer than two centimetres to the last one kept of its clip is left out.
        """
        kept = [spaced_frames(skeleton, motion.poses) for motion in motions]
        poses = [motion.poses[rows] for motion, rows in zip(motions, kept, strict=True)]
        images = [mirrored_poses(motion.skeleton, one) for motion, one in zip(motions, poses, strict=True)]
        clips = np.repeat(np.arange(len(motions)), [len(rows) for rows in kept])
        names = tuple(motion.name for motion in motions)
        return cls(np.concatenate(poses + images), names, np.tile(clips, 2), np.tile(np.concatenate(kept), 2))

    def __len__(self) -> int:
        return len(self.poses)

    def is_mirrored(self, row: int) -> bool:
        """Return whether a pose is the mirror image of one that was recorded."""
        return row >= len(self) // 2


def spaced_frames(skeleton: Skeleton, poses: Array) -> Rows:
    """Return which poses (n, 66) of a clip to keep: each two centimetres or more from the last one kept."""
    facing = poses.copy()
    facing[:, 0] = 0.0  # as the yaw of every pose is searched
    joints = skeleton.joints(facing).reshape(len(poses), -1)
    kept = [0]
    for k in range(1, len(joints)):
        step = joints[k] - joints[kept[-1]]
        if float(step @ step) > len(JOINTS) * SAME**2:
            kept.append(k)
    return np.array(kept)
