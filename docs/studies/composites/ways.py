"""How people of the library move through a scene: walks that go on as long as it takes, placed and turned.

The ground is y = 0. Whoever goes through goes along the x axis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.rotation import wrapped
from posefit.motion import recorded
from posefit.motion.motion import Motion

CYCLE = (20, 50)  # frames that a walking cycle may last
ALONG = 0.5 * np.pi  # the way +x, about the vertical, where 0 is +z


@dataclass(frozen=True, eq=False)
class Actor:
    """Somebody in a scene: his body, how he moves, when he is there at all, and which clothes he wears."""

    body: Body
    motion: Motion = field(repr=False)  # of the whole scene; where he is not there, it means nothing
    present: NDArray[np.bool_] = field(repr=False)  # (T,)
    outfit: int


def frames_of(name: str, start: int = 0, stop: int | None = None) -> Motion:
    """Return frames of a recorded clip."""
    motion = recorded.clip(name).motion()
    return motion.frames(start, len(motion) if stop is None else min(stop, len(motion)))


def walked_on(motion: Motion, metres: float) -> Motion:
    """Return a walk that goes on for so many metres: the cycle of a clip, again and again.

    What the cycle's last pose differs from its first by is spread over all of it, so that nothing jumps.
    """
    start, stop = cycle(motion)
    count = stop - start
    poses, places = motion.poses[start : stop + 1].copy(), motion.translations[start : stop + 1].copy()
    share = np.arange(count + 1)[:, None] / count
    poses -= share * np.concatenate([wrapped(poses[-1, :3] - poses[0, :3]), poses[-1, 3:] - poses[0, 3:]])
    places[:, 1] -= share[:, 0] * (places[-1, 1] - places[0, 1])
    step = places[-1] - places[0]
    times = int(np.ceil(metres / np.linalg.norm(step)))
    far = np.concatenate([places[:-1] + k * step for k in range(times)])
    kept = int(np.searchsorted(np.linalg.norm(far - far[0], axis=1), metres))
    return Motion(motion.name, motion.skeleton, np.tile(poses[:-1], (times, 1))[:kept], far[:kept], motion.fps)


def cycle(motion: Motion) -> tuple[int, int]:
    """Return the first frame of a clip's best cycle, and the frame after it: the one that is most like the first."""
    joints = motion.skeleton.joints(motion.poses)
    feature = np.concatenate([joints[:-1], 5.0 * np.diff(joints, axis=0)], axis=1)
    best = (np.inf, 0, 0)
    for length in range(*CYCLE):
        away = np.linalg.norm(feature[length:] - feature[:-length], axis=2).mean(axis=1)
        if len(away):
            k = int(away.argmin())
            best = min(best, (float(away[k]), k, k + length))
    return best[1], best[2]


def facing_elsewhere(motion: Motion, angle: float) -> Motion:
    """Return a motion turned about the vertical."""
    poses, (x, y, z) = motion.poses.copy(), motion.translations.T
    poses[:, 0] += angle
    sine, cosine = np.sin(angle), np.cos(angle)
    places = np.column_stack([cosine * x + sine * z, y, cosine * z - sine * x])
    return Motion(motion.name, motion.skeleton, poses, places, motion.fps)


def on_ground(motion: Motion, body: Body) -> Motion:
    """Return a motion whose lowest point touches the ground."""
    joints = motion.skeleton.joints(motion.poses, motion.translations)
    low = float((joints[..., 1] - body.joint_radii()).min(axis=1).min())
    return moved(motion, np.array([0.0, -low, 0.0]))


def moved(motion: Motion, by: Array) -> Motion:
    """Return a motion elsewhere."""
    return Motion(motion.name, motion.skeleton, motion.poses, motion.translations + by, motion.fps)


def heading(motion: Motion) -> float:
    """Return the way that a motion goes as a whole, about the vertical."""
    way = motion.translations[-1] - motion.translations[0]
    return float(np.arctan2(way[0], way[2]))


def middle_of(motion: Motion) -> Array:
    """Return the middle of the ground that a motion covers, a point (3,) with y = 0."""
    low, high = motion.translations.min(axis=0), motion.translations.max(axis=0)
    return np.asarray(0.5 * (low + high) * [1.0, 0.0, 1.0])


def longest(motion: Motion) -> float:
    """Return the way along which a motion covers most ground, about the vertical."""
    flat = motion.translations[:, [0, 2]]
    _, _, axes = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    return float(np.arctan2(axes[0, 0], axes[0, 1]))


def through(motion: Motion, body: Body, reach: float, *, back: bool = False, aside: float = 0.0) -> Motion:
    """Return a walk from x = -reach to x = reach, or back, `aside` metres nearer to z."""
    long = walked_on(motion, 2.0 * reach)
    ahead = on_ground(facing_elsewhere(long, (-ALONG if back else ALONG) - heading(long)), body)
    return moved(ahead, [0.0, 0.0, aside] - middle_of(ahead))


def one_after_other(parts: Sequence[Motion | int]) -> tuple[Motion, NDArray[np.bool_]]:
    """Return motions one after the other, and in which frames somebody is there; a number is frames without anybody."""
    first = next(part for part in parts if isinstance(part, Motion))
    poses, places, present = [], [], []
    for part in parts:
        if isinstance(part, Motion):
            poses.append(part.poses)
            places.append(part.translations)
            present += [True] * len(part)
        else:
            poses.append(np.repeat(poses[-1][-1:] if poses else first.poses[:1], part, axis=0))
            places.append(np.repeat(places[-1][-1:] if places else first.translations[:1], part, axis=0))
            present += [False] * part
    motion = Motion(first.name, first.skeleton, np.concatenate(poses), np.concatenate(places), first.fps)
    return motion, np.array(present)
