"""How a sequence is begun whose first pose nobody knows: several starts, then the person's build."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np

from posefit.fitting.shape import Shape, fit_shape
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.scene import Scene
from posefit.listening import Listener
from posefit.motion.motion import Motion
from posefit.searching.starts import RESTARTS, STRIDE, Follow, begun, best_seen, usable
from posefit.settings import POPULATION_SIZE
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions

BODY_FRAMES = 12  # from which a build is found
COMPILING = 60.0  # seconds that a plugin's first calls may take longer than its limit
POPULATIONS = 8  # that are searched to compile what a search needs
LEAST = 5  # frames; a body is not fitted to fewer


def task_of(scene: Scene, options: TrackOptions, training: Sequence[Motion]) -> Task:
    """Return the task of tracking a scene, as far as it is known before anything is searched."""
    known = None if scene.truth is None or options.first_pose == "searched" else scene.truth.poses[0, 3:]
    return Task(
        scene.body,
        scene.cameras,
        options.budget,
        scene.yaw,
        scene.anchor,
        translation=options.translation or ("aligned" if scene.truth is None else "known"),
        fps=scene.fps,
        training=training,
        first_pose=known,
        threads=options.threads,
    )


def opened(
    scene: Scene, method: Method, task: Task, options: TrackOptions, listener: Listener
) -> tuple[Task, Shape | None]:
    """Return a task with what was found out before the first frame, and the person's build where it was fitted."""
    began = time.perf_counter()
    with _announced(listener.say):
        looks_ahead = _warm_up(method, task, scene)
    listener.say(f"ready in {time.perf_counter() - began:.1f} s; {scene.count} frames of {scene.name}")

    follow, blind = following(method), scene.truth is None
    restarts = (RESTARTS if blind and not looks_ahead else 0) if options.restarts is None else options.restarts
    body_frames = (BODY_FRAMES if blind else 0) if options.body_frames is None else options.body_frames
    if restarts:
        listener.say(f"looking for the first pose, {restarts} times")
        task = begun(task, scene.observations, follow, restarts, options.seed)
    shape = None
    if body_frames and (seen := len(usable(scene.observations, body_frames))) < LEAST:
        few = f"{seen} of them show enough of the person" if seen < body_frames else f"{seen} are too few"
        listener.say(
            f"no build is fitted to {body_frames} frames: {few}, at least {LEAST} are needed; it is the average"
        )
    elif body_frames:
        listener.say(f"fitting the person's build to {body_frames} frames")
        alone = len(scene.cameras) == 1 and task.translation == "aligned"
        height = options.height or (task.body.stature if alone else None)
        shape = built(task, scene.observations, follow, body_frames, height, options.seed)
        task = replace(task, body=shape.body)
    return task, shape


def following(method: Method) -> Follow:
    """Return a function that follows observations with a method, as a task asks."""

    def follow(task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        return method.tracker(task).track(observations, rng)

    return follow


def built(
    task: Task,
    observations: Sequence[Observation],
    follow: Follow,
    frames: int,
    height: float | None,
    seed: int,
) -> Shape:
    """Return the person's build, from the first usable frames: every third, where there are so many.

    Of several cameras as many as possible see the first of them: whoever comes in is seen by one alone for a while.
    """
    chosen, stride = usable(observations, frames, STRIDE, best_seen(observations)), STRIDE
    if len(chosen) < frames:
        chosen, stride = usable(observations, frames), 1
    task = replace(task, fps=task.fps / stride)
    return fit_shape(
        task.body,
        task.cameras,
        chosen,
        lambda body: list(follow(replace(task, body=body), chosen, np.random.default_rng(seed))),
        np.random.default_rng(seed),
        height=height,
        aligned=task.translation == "aligned",
    )


def _warm_up(method: Method, task: Task, scene: Scene) -> bool:
    """Compile what is not compiled yet: a few populations of the first frame, whatever comes of them.

    Return whether it is a tracker that looks ahead.
    """
    population_size = method.settings.get("optimiser", {}).get("population_size", POPULATION_SIZE)
    few = replace(task, evaluations=min(task.evaluations, POPULATIONS * population_size))
    first = next(iter(scene.observations))
    tracker = None
    with suppress(ValueError):  # what does not work with so few evaluations is told where it does not with all
        tracker = method.tracker(few, COMPILING)
        next(tracker.track([first], np.random.default_rng(0)))
    return getattr(tracker, "lag", None) is not None


@contextmanager
def _announced(say: Callable[[str], None]) -> Iterator[None]:
    """Say that compiling takes its time, once something is compiled that was not found in numba's cache."""
    from numba.core import event

    class Once(event.Listener):  # type: ignore[misc]
        said = False

        def on_start(self, _event: event.Event) -> None:
            if not self.said:
                self.said = True
                say("compiling the kernels, once on this machine; this takes ten seconds or more ...")

        def on_end(self, _event: event.Event) -> None:
            pass

    with event.install_listener("numba:compile", Once()):
        yield
