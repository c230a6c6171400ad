"""How near the library has anything: the pose that is closest to the true one, given the true root."""

from collections.abc import Iterable
from functools import lru_cache, partial

import numpy as np
from numpy.typing import NDArray

from people.clips import Piece
from posefit.arrays import Array
from posefit.footage.instance import motion_of_instance
from posefit.footage.masks import FPS
from posefit.footage.training import training_clips
from posefit.geometry.skeleton import ANGLES, Skeleton
from posefit.motion import recorded
from posefit_reproduce.grid import Progress, each

LOOKED_AT = 64  # poses closest in the sense of squares, of which one is closest in that of means


def closest_mm(clips: Iterable[Piece], workers: int | None, progress: Progress | None = None) -> dict[Piece, float]:
    """Return for each clip how far, in the sense of MPJPE, the closest poses of everybody else's are from the true."""
    return each({clip: partial(_distance_mm, clip) for clip in dict.fromkeys(clips)}, workers, progress)


def _distance_mm(clip: Piece) -> float:
    truth = motion_of_instance(clip.name, clip.instance, frames=clip.frames, fps=FPS)
    return float(np.mean(distances_mm(_joints(truth.skeleton, truth.poses[:, 3:]), _library(clip.subject))))


def distances_mm(truth: NDArray[np.float32], poses: NDArray[np.float32]) -> Array:
    """Return how far from each of the true joints (T, 81) the closest of others (n, 81) are, in millimetres (T,)."""
    squares = (poses**2).sum(axis=1) - 2.0 * truth @ poses.T  # but for what is the same for all others
    count = min(LOOKED_AT, len(poses))
    near = np.argpartition(squares, count - 1, axis=1)[:, :count]
    off = (poses[near] - truth[:, None]).reshape(len(truth), count, -1, 3)
    return np.asarray(1e3 * np.linalg.norm(off, axis=-1).mean(axis=-1).min(axis=1), dtype=np.float64)


@lru_cache(maxsize=1)
def _library(subject: str) -> NDArray[np.float32]:
    """Return the joints of everybody else's poses, in the body of a person of the library."""
    (mine, *_) = recorded.clips(only=(subject,))
    angles = np.concatenate([clip(FPS).poses[:, 3:] for clip in training_clips([f"library:-{subject}"])])
    return _joints(mine.skeleton, angles)


def _joints(skeleton: Skeleton, angles: Array) -> NDArray[np.float32]:
    """Return the joints (n, 81) of angles (n, 63), the root upright at the origin."""
    poses = np.column_stack([np.zeros((len(angles), ANGLES - angles.shape[1])), angles])
    return skeleton.joints(poses).reshape(len(poses), -1).astype(np.float32)
