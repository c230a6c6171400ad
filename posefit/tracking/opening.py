"""How a sequence is begun whose first pose nobody knows: several starts, then the person's build."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from posefit.fitting.shape import Shape, fit_shape
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Frame, Observation, Task, Tracker
from posefit.footage.source import Scene
from posefit.motion.motion import Motion
from posefit.tracking.method import Choice, prepare

RESTARTS = 8  # searches of the first frame
BODY_FRAMES = 30  # from which a build is found
PATIENCE = 1.5  # seconds of compiling before it is announced
FRAMES = 10  # how many a start is judged by
STRIDE = 3  # and how far apart they are, so that it shows which way somebody walks
MOVED = 0.3  # metres; who goes so far in these frames goes where he faces
BACKWARDS = 1.1  # what multiplies the cost of a start that faces the other way
LEAST = 5  # frames; a body is not fitted to fewer

Follow = Callable[[Task, Iterable[Observation], np.random.Generator], Iterator[Frame]]


@dataclass(frozen=True)
class Opening:
    """What is to be found out before the first frame; None leaves it to whether nobody knows the truth, `blind`."""

    blind: bool
    translation: Translation | None = None
    first_pose: Literal["searched", "given"] = "searched"
    restarts: int | None = None
    body_frames: int | None = None
    height: float | None = None  # metres

    def __post_init__(self) -> None:
        if self.first_pose not in ("searched", "given"):
            raise ValueError(f"first_pose must be one of searched, given, got {self.first_pose!r}")
        if self.blind and self.translation == "known":
            raise ValueError("translation must be searched or aligned where only masks are given, got known")
        if self.blind and self.first_pose == "given":
            raise ValueError("first_pose must be searched where only masks are given, got given")
        for name in ("restarts", "body_frames"):
            value = getattr(self, name)
            if value is not None and value < 0:
                raise ValueError(f"{name} must be 0 or more, got {value}")


def opened(
    seen: Scene,
    choice: Choice,
    how: Opening,
    trained: Sequence[Motion],
    seed: int,
    threads: int,
    say: Callable[[str], None],
) -> tuple[Task, Shape | None]:
    """Return the task of following a scene, and the person's build where it was fitted."""
    mode: Translation = how.translation or ("aligned" if how.blind else "known")
    known = None if seen.truth is None or how.first_pose == "searched" else seen.truth.poses[0, 3:]
    task = Task(
        seen.body,
        seen.cameras,
        choice.budget(),
        seen.yaw,
        seen.anchor,
        translation=mode,
        fps=seen.fps,
        training=trained,
        first_pose=known,
        threads=threads,
    )
    began = time.perf_counter()
    with _announced(say):
        _warm_up(prepare(choice, task).warm_up, seen)
    say(f"ready in {time.perf_counter() - began:.1f} s; {seen.count} frames of {seen.name}")

    follow = following(choice)
    restarts = (RESTARTS if how.blind else 0) if how.restarts is None else how.restarts
    body_frames = (BODY_FRAMES if how.blind else 0) if how.body_frames is None else how.body_frames
    if restarts:
        say(f"looking for the first pose, {restarts} times")
        task = begun(task, seen.observations, follow, restarts, seed)
    shape = None
    if body_frames:
        say(f"fitting the person's build to {body_frames} frames")
        alone = len(seen.cameras) == 1 and mode == "aligned"
        height = how.height or (task.body.stature if alone else None)
        shape = built(task, seen.observations, follow, body_frames, height, seed)
        if shape is not None:
            task = replace(task, body=shape.body)
    return task, shape


def following(choice: Choice) -> Follow:
    """Return a function that follows observations with a method, as a task asks."""

    def follow(task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        return prepare(choice, task).tracker.track(observations, rng)

    return follow


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


def _warm_up(tracker: Tracker, scene: Scene) -> None:
    """Compile what is not compiled yet, on the first frame."""
    first = next(iter(scene.observations))
    next(tracker.track([first], np.random.default_rng(0)))


@contextmanager
def _announced(say: Callable[[str], None]) -> Iterator[None]:
    """Say that compiling takes its time, if it does."""
    message = "compiling the kernels, once on this machine; this can take half a minute ..."
    timer = threading.Timer(PATIENCE, say, (message,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # it may be in the middle of saying it
