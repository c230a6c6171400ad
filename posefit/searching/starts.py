"""Several starts of a track, all around or about where somebody is said to face, and which of them to go on with."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from posefit.fitting.tracker import Frame, Observation, Task
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette

RESTARTS = 8  # searches of the first frame
FRAMES = 10  # how many a start is judged by
STRIDE = 3  # how far apart these are, so that it shows which way somebody walks
MOVED = 0.3  # metres; who goes so far in these frames goes where he faces
ROWS = 240  # that the pictures have at least in which starts are compared
BACKWARDS = 1.1  # what multiplies the cost of a start that faces the other way

Follow = Callable[[Task, Iterable[Observation], np.random.Generator], Iterator[Frame]]


def usable(observations: Sequence[Observation], count: int, stride: int = 1, start: int = 0) -> list[Observation]:
    """Return the first `count` observations from `start` on, of every `stride`th, that show enough of the person."""
    found: list[Observation] = []
    for k in range(start, len(observations), stride):
        if len(found) == count:
            break
        if (observation := observations[k]).usable:
            found.append(observation)
    return found


def best_seen(observations: Sequence[Observation]) -> int:
    """Return the first frame in which no fewer cameras see the person than in any other; 0 for one camera."""
    best, most = 0, 0
    for k in range(len(observations)):
        seen = observations[k].silhouettes
        if len(seen) == 1:
            return 0
        if (seeing := sum(silhouette.known for silhouette in seen)) > most:
            best, most = k, seeing
        if most == len(seen):
            break
    return best


def begun(
    task: Task,
    observations: Sequence[Observation],
    follow: Follow,
    restarts: int,
    seed: int | Sequence[int],
    going_on: Task | None = None,
) -> Task:
    """Return the task with the best of several starts as the frame before the first.

    Each start searches the first usable frame anew, all around where no yaw is known, and follows the person through a
    few more frames. The least mean cost wins; a start that would have somebody walk backwards pays for it. Large
    pictures are looked at smaller, and the first frame is then searched once more in the whole one, around the best.
    A tracker that looks ahead over the clip has no need of it. A task that is `going_on` is followed beside the
    starts, and is what comes back where none of them is better.
    """
    chosen = usable(observations, FRAMES, STRIDE) or usable(observations, 1)
    factor = max(min(camera.height for camera in task.cameras) // ROWS, 1)
    apart = replace(task, fps=task.fps / STRIDE)  # as a model of motion has to know
    looked, seen = _smaller(apart, chosen, factor) if factor > 1 else (apart, chosen)
    salt = [seed] if isinstance(seed, int) else [*seed]
    best, least = None, np.inf
    if going_on is not None:
        on = replace(going_on, fps=apart.fps, cameras=looked.cameras)
        least = _judged(list(follow(on, seen, np.random.default_rng([*salt, restarts + 1]))))
    for k in range(restarts):
        frames = list(follow(looked, seen, np.random.default_rng([*salt, k])))
        if (cost := _judged(frames)) < least:
            best, least = frames[0], cost
    if best is None:
        return going_on or task
    if factor == 1:
        return _begun_with(task, best)
    rng = np.random.default_rng([*salt, restarts])
    return _begun_with(task, next(follow(_begun_with(task, best), chosen[:1], rng)))


def _judged(frames: Sequence[Frame]) -> float:
    """Return the mean cost of frames, more where they would have somebody walk backwards."""
    return float(np.mean([frame.cost for frame in frames])) * (BACKWARDS if _backwards(frames) else 1.0)


def _begun_with(task: Task, best: Frame) -> Task:
    """Return the task that goes on from a frame."""
    return replace(task, yaw=float(best.pose[0]), anchor=best.translation, first_pose=best.pose[3:], before=(best,))


def _smaller(task: Task, observations: Sequence[Observation], factor: int) -> tuple[Task, list[Observation]]:
    """Return a task and what is seen in it, through every `factor`th pixel of every `factor`th row."""
    small = [
        replace(one, silhouettes=[coarser_silhouette(silhouette, factor) for silhouette in one.silhouettes])
        for one in observations
    ]
    return replace(task, cameras=[coarser_camera(camera, factor) for camera in task.cameras]), small


def _backwards(frames: Sequence[Frame]) -> bool:
    way = frames[-1].translation - frames[0].translation
    yaws = np.array([frame.pose[0] for frame in frames])
    facing = np.array([np.sin(yaws).mean(), 0.0, np.cos(yaws).mean()])
    way[1] = 0.0
    return bool(np.linalg.norm(way) > MOVED and way @ facing < 0.0)
