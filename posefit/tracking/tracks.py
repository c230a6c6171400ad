"""Several tracks of one clip from different beginnings, and which of them to keep: the one that costs least as a whole.

A frame does not tell a stride from its mirror image, but a clip does: what is begun wrongly fits a little worse in
most frames, or has to jump. So a track that is judged whole is right more often than each of its frames.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.space import ROOT_RANGE_DEGREES
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.alike import exchanged_limbs, facing, mirrored_poses, reflected_poses, turned_poses
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.motion.motion import Motion
from posefit.searching.spent import mean_cost

SALT = 2005  # part of every seed but the first track's
SEARCHED, ANEW = "searched", "searched anew"
PACE = 30.0  # a second: how often steps are compared, so that what a search jitters counts alike at any rate
USUAL = 1.0  # metres a second, of the joints about the root, where there is nothing to learn from: somebody who walks
LEAST = 0.25  # metres a second that it is taken for at least, where somebody stands still all the time
TURNING = 2.0  # usual speeds, which a joint's velocity changes by when it turns around on the spot
ELSEWHERE = 5.0  # usual speeds: where the velocities of all joints change by more, the body is somewhere else

# What becomes of poses (n, 66), given the yaw of somebody who faces the first camera.
Operator = Callable[[Skeleton, Array, float], Array]
ALIKE: Mapping[str, Operator] = {
    "mirrored": lambda skeleton, poses, _: mirrored_poses(skeleton, poses),
    "reflected": reflected_poses,
    "legs exchanged": lambda skeleton, poses, _: exchanged_limbs(skeleton, poses, "legs"),
    "turned": lambda _skeleton, poses, _towards: turned_poses(poses),
    "arms exchanged": lambda skeleton, poses, _: exchanged_limbs(skeleton, poses, "arms"),
}
# How the tracks after the first are begun, one after the other, and again from the front where there are more: those
# first that are mistaken for each other most often.
ORDER = ("mirrored", "reflected", ANEW, "legs exchanged", "turned", ANEW, "arms exchanged")


@dataclass(frozen=True)
class Known:
    """What is known of the first frame, which no beginning contradicts."""

    yaw: float | None  # radians: about where somebody faces
    pose: bool  # whether the joint angles are the true ones


@dataclass(frozen=True)
class Whole:
    """What a whole track costs."""

    cost: float  # mean silhouette mismatch of the frames that show enough, 0 to 100. SAPSO (4)
    motion: float  # the pull of motion: half the mean squared change of velocity, over that of turning around

    @property
    def total(self) -> float:
        """By which tracks are compared: the less the better."""
        return self.cost + self.motion


def generator(seed: int, number: int) -> np.random.Generator:
    """Return the randomness of a track; that of the first is the same however many follow."""
    return np.random.default_rng(seed if number == 0 else [seed, SALT, number])


def beginning(number: int, task: Task, known: Known, first: Frame) -> tuple[str, Task]:
    """Return how a track after the first is begun, in words and as a task; `first` is a frame that the first one found.

    It starts around a pose that looks like the one found, or searches anew as the first one did. Poses that face
    elsewhere than is known are left out; where the first pose is known, only seeds differ.
    """
    facing_camera = facing(task.cameras[0], first.translation)
    poses = {name: alike(task.body.skeleton, first.pose[None], facing_camera)[0] for name, alike in ALIKE.items()}
    order = [name for name in ORDER if name == ANEW or not _contradicts(poses[name], known)]
    name = order[(number - 1) % len(order)]
    if name == ANEW:
        return name, task
    pose = poses[name]
    return name, replace(task, yaw=float(pose[0]), anchor=first.translation, first_pose=pose[3:], before=())


def _contradicts(pose: Array, known: Known) -> bool:
    if known.pose or known.yaw is None:
        return known.pose
    return bool(abs(wrapped(pose[0] - known.yaw)) > np.radians(ROOT_RANGE_DEGREES[0]))


def first_seen(frames: Sequence[Frame], usable: Sequence[bool]) -> Frame:
    """Return the first frame of a track that shows enough of the person; where none does, the first one."""
    return next((frame for frame, seen in zip(frames, usable, strict=True) if seen), frames[0])


def usual_speed(training: Sequence[Motion]) -> float:
    """Return how fast joints move about the root in some motions, in metres a second: the root of the mean square."""
    squares = [_squared(_velocities(motion.skeleton.joints(motion.poses), motion.fps)) for motion in training]
    each = np.concatenate(squares) if squares else np.empty(0)
    return max(float(np.sqrt(each.mean())), LEAST) if len(each) else USUAL


def whole_cost(frames: Sequence[Frame], usable: Sequence[bool], skeleton: Skeleton, fps: float, usual: float) -> Whole:
    """Return what a whole track costs; frames that were held count for nothing, unless all were.

    The pull of motion is half the squared change of a joint's velocity about the root, from one thirtieth of a second
    to the next, over the square of twice the `usual` speed: a joint that turns around on the spot at that speed costs
    a half. It is the mean over joints and frames, and is added to the silhouettes' mean cost as it is. A frame counts
    for five usual speeds at most: a body that jumped has jumped, however far.
    """
    seen = np.asarray(usable, dtype=bool)
    velocities = _velocities(skeleton.joints(np.array([frame.pose for frame in frames])), fps)
    step = _step(fps)
    changes = _squared(velocities[step:] - velocities[:-step])
    followed = seen[: -2 * step] & seen[step:-step] & seen[2 * step :]  # of each change, the three frames it is of
    pull = 0.5 * np.minimum(changes[followed], (ELSEWHERE * usual) ** 2) / (TURNING * usual) ** 2
    return Whole(mean_cost(frames, seen), float(pull.mean()) if len(pull) else 0.0)


def _step(fps: float) -> int:
    """Return how many frames a thirtieth of a second is, one at least."""
    return max(round(fps / PACE), 1)


def _velocities(joints: Array, fps: float) -> Array:
    """Return the velocities (T - step, 27, 3) of joints (T, 27, 3) about the root, in metres a second."""
    step, rooted = _step(fps), joints - joints[:, :1]
    return np.asarray((rooted[step:] - rooted[:-step]) * (fps / step))


def _squared(velocities: Array) -> Array:
    """Return the mean square (T,) of velocities (T, 27, 3), over the joints."""
    return np.asarray((velocities**2).sum(axis=2).mean(axis=1))
