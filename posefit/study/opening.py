"""How a sequence is begun whose first pose nobody knows: several starts, then the person's build."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from posefit.fitting.shape import Shape, fit_shape
from posefit.fitting.tracker import Frame, Observation, Task

FRAMES = 10  # how many a start is judged by
STRIDE = 3  # and how far apart they are, so that it shows which way somebody walks
MOVED = 0.3  # metres; who goes so far in these frames goes where he faces
BACKWARDS = 1.1  # what multiplies the cost of a start that faces the other way
LEAST = 5  # frames; a body is not fitted to fewer

Follow = Callable[[Task, Iterable[Observation], np.random.Generator], Iterator[Frame]]


def usable(observations: Sequence[Observation], count: int, stride: int = 1) -> list[Observation]:
    """Return the first `count` observations, of every `stride`th, that show enough of the person."""
    found: list[Observation] = []
    for k in range(0, len(observations), stride):
        if len(found) == count:
            break
        if (observation := observations[k]).usable:
            found.append(observation)
    return found


def begun(task: Task, observations: Sequence[Observation], follow: Follow, restarts: int, seed: int) -> Task:
    """Return the task with the best of several starts as the frame before the first.

    Each start searches the first usable frame anew, all around where no yaw is known, and follows the person through a
    few more frames. The least mean cost wins; a start that would have somebody walk backwards pays for it.
    """
    chosen = usable(observations, FRAMES, STRIDE) or usable(observations, 1)
    best, least = None, np.inf
    for k in range(restarts):
        frames = list(follow(task, chosen, np.random.default_rng([seed, k])))
        cost = float(np.mean([frame.cost for frame in frames])) * (BACKWARDS if _backwards(frames) else 1.0)
        if cost < least:
            best, least = frames[0], cost
    if best is None:
        return task
    return replace(task, yaw=float(best.pose[0]), anchor=best.translation, first_pose=best.pose[3:], before=(best,))


def _backwards(frames: Sequence[Frame]) -> bool:
    way = frames[-1].translation - frames[0].translation
    yaws = np.array([frame.pose[0] for frame in frames])
    facing = np.array([np.sin(yaws).mean(), 0.0, np.cos(yaws).mean()])
    way[1] = 0.0
    return bool(np.linalg.norm(way) > MOVED and way @ facing < 0.0)


def built(
    task: Task,
    observations: Sequence[Observation],
    follow: Follow,
    frames: int,
    height: float | None,
    seed: int,
) -> Shape | None:
    """Return the person's build, from the first usable frames; None where there are too few."""
    chosen = usable(observations, frames)
    if len(chosen) < LEAST:
        return None
    return fit_shape(
        task.body,
        task.cameras,
        chosen,
        lambda body: list(follow(replace(task, body=body), chosen, np.random.default_rng(seed))),
        np.random.default_rng(seed),
        height=height,
        aligned=task.translation == "aligned",
    )
