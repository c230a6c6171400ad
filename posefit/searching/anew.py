"""A track followed again from the frame that is surest, onward and backwards, as nobody turns faster than people do."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.skeleton import Skeleton
from posefit.motion.motion import Motion
from posefit.searching.spent import mean_cost, spent_by_all
from posefit.searching.starts import Follow
from posefit.searching.whirls import FASTEST, agreeing, surest, whirling

SALT = 450  # part of the seeds of what is followed again
DEARER = 1.5  # times what the usable frames cost: who is followed again at more does turn so fast


@dataclass(frozen=True, eq=False)
class Anew:
    """What became of a track that whirled."""

    frames: list[Frame] = field(repr=False)  # with what both tracks took
    start: int | None  # the frame from which it was followed again; None where it is as it was


def followed_anew(
    task: Task, observations: Sequence[Observation], frames: Sequence[Frame], follow: Follow, seed: int
) -> Anew:
    """Return a track without whirls: where there are some, all frames are followed again from the one that is surest.

    Which way the person faces is what most frames say, see `whirls.agreeing`. From that frame he is followed onward,
    and backwards by training motions that go backwards. The old track is kept where the new one whirls as often, or
    costs half as much again.
    """
    usable = np.array([observation.usable for observation in observations])
    before = _whirls(task, frames, usable)
    start = surest(frames, agreeing(frames, task.cameras, usable, task.fps)) if before else None
    if start is None:
        return Anew(list(frames), None)
    pose, place = frames[start].pose, frames[start].translation
    sure = replace(task, yaw=float(pose[0]), anchor=place, first_pose=pose[3:], before=(), fastest_turn=FASTEST)
    back = replace(sure, training=[in_reverse(motion) for motion in task.training], backwards=True)
    onward = (observations[k] for k in range(start, len(frames)))
    ahead = list(follow(sure, onward, np.random.default_rng([seed, SALT, 0])))
    until = (observations[k] for k in range(start, -1, -1))
    behind = list(follow(back, until, np.random.default_rng([seed, SALT, 1])))
    told = [*_joined(task.body.skeleton, behind, ahead[0])[:0:-1], *ahead]
    better = _whirls(task, told, usable) < before and mean_cost(told, usable) <= DEARER * mean_cost(frames, usable)
    return Anew(spent_by_all([frames, told], int(better)), start if better else None)


def in_reverse(motion: Motion) -> Motion:
    """Return a motion that goes backwards in time."""
    return replace(motion, poses=motion.poses[::-1], translations=motion.translations[::-1])


def _whirls(task: Task, frames: Sequence[Frame], usable: NDArray[np.bool_]) -> int:
    """Return in how many frames a track whirls."""
    return int(whirling(np.array([frame.pose[0] for frame in frames]), usable, task.fps).sum())


def _joined(skeleton: Skeleton, behind: Sequence[Frame], ahead: Frame) -> list[Frame]:
    """Return frames whose drawn tracks go on as those of the frame from which both ways were followed.

    Each of its tracks goes on as the one that is nearest there.
    """
    mine, others = ahead.posterior, behind[0].posterior
    if mine is None or others is None:
        return list(behind)
    joints, near = skeleton.joints(mine.poses), skeleton.joints(others.poses)
    rows = np.array([int(((near - one) ** 2).sum(axis=(1, 2)).argmin()) for one in joints])
    return [
        frame
        if frame.posterior is None
        else replace(
            frame,
            posterior=replace(
                frame.posterior,
                poses=frame.posterior.poses[rows],
                translations=frame.posterior.translations[rows],
                weights=np.ones(len(rows)),
            ),
        )
        for frame in behind
    ]
