"""What is estimated before the first frame: its pose, by several restarts, and the person's build."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.driving import clocks
from posefit.fitting.shape import Shape, fit_shape
from posefit.fitting.tracker import Frame, Observation, Task, guessed_modes
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.motion.motion import Motion
from posefit.progress import Progress
from posefit.reading import counted
from posefit.settings import POPULATION_SIZE
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import TRIAL_STRIDE, Follow, best_restart, first_shown_whole, usable_observations

MIN_BODY_FRAMES = 5
WARM_UP_POPULATIONS = 8


def task_of(scene: Scene, options: TrackOptions, training: Sequence[Motion]) -> Task:
    """Return the task of tracking a scene, as far as it is known before anything is searched."""
    assert options.evaluations is not None
    assert options.translation is not None
    first_pose = None if scene.truth is None or options.first_pose == "searched" else scene.truth.poses[0, 3:]
    return Task(
        scene.body,
        scene.cameras,
        options.evaluations,
        scene.yaw,
        scene.anchor,
        translation=options.translation,
        fps=scene.fps,
        training=training,
        first_pose=first_pose,
        threads=options.threads,
    )


def initialise(
    scene: Scene, method: Method, task: Task, options: TrackOptions, progress: Progress
) -> tuple[Task, Shape | None, Array]:
    """Return a task with its first pose, where it is searched, and the person's build, where it is fitted.

    Also the clocks (2,), see `posefit.fitting.driving.clocks`, at the moment when everything was compiled.
    """
    if task.yaw is None:
        task = replace(task, start=method.start)
    _warm_up(method, task, scene)
    start, shape, body_frames = clocks(), None, options.body_frames
    if options.restarts:
        first = usable_observations(scene.observations, 1)
        modes = guessed_modes(task, first[0]) if first else []
        tried = counted(min(len(modes), options.restarts), "pose")
        where = f"around at most {tried} with such a silhouette" if modes else "anywhere"
        progress.log(f"looking for the first pose {where}")
        task, _ = best_restart(task, scene.observations, method.follow, options.restarts, options.seed)
    if body_frames and (count := len(usable_observations(scene.observations, body_frames))) < MIN_BODY_FRAMES:
        few = f"{count} of them show enough of the person" if count < body_frames else f"{count} are too few"
        needed = f"at least {MIN_BODY_FRAMES} are needed; it is the average"
        progress.log(f"no build is fitted to {body_frames} frames: {few}, {needed}")
    elif body_frames:
        progress.log(f"fitting the person's build to {body_frames} frames")
        alone = len(scene.cameras) == 1 and task.translation == "aligned"
        height = options.height or (task.body.stature if alone else None)
        shape = fitted_build(task, scene.observations, method.follow, body_frames, height, options.seed)
        task = replace(task, body=shape.body)
    return task, shape, start


def fitted_build(
    task: Task, observations: Sequence[Observation], follow: Follow, frames: int, height: float | None, seed: int
) -> Shape:
    """Return the person's build, from the first usable frames: every third, where there are so many.

    It begins with the first frame that shows most: a person who comes in is cut, and visible to few cameras.
    """
    stride = TRIAL_STRIDE
    chosen = usable_observations(observations, frames, stride, first_shown_whole(observations))
    if len(chosen) < frames:
        chosen, stride = usable_observations(observations, frames), 1
    task = replace(task, fps=task.fps / stride)

    def frames_of(body: Body) -> list[Frame]:
        return list(follow(replace(task, body=body), chosen, np.random.default_rng(seed)))

    aligned, rng = task.translation == "aligned", np.random.default_rng(seed)
    return fit_shape(task.body, task.cameras, chosen, frames_of, rng, height=height, aligned=aligned)


def _warm_up(method: Method, task: Task, scene: Scene) -> None:
    """Search a few populations of the first frame, so that everything is compiled."""
    population_size = method.settings.get("optimiser", {}).get("population_size", POPULATION_SIZE)
    few = replace(task, evaluations=min(task.evaluations, WARM_UP_POPULATIONS * population_size))
    with suppress(ValueError):  # what fails for want of evaluations is reported where it fails with all of them
        next(method.follow(few, [next(iter(scene.observations))], np.random.default_rng(0)))
