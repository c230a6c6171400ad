"""What is estimated before the first frame: its pose, by several restarts, and the person's build."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.driving import clocks
from posefit.fitting.shape import NAMES, SPREAD, Shape, fit_shape
from posefit.fitting.tracker import Follow, Frame, Observation, Task, guessed_modes
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.motion.motion import Motion
from posefit.progress import Progress
from posefit.silhouette.cost import BETA, pose_costs
from posefit.silhouette.drawn import PoseCount, uncounted
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import (
    TRIAL_FRAMES,
    TRIAL_STRIDE,
    best_restart,
    first_shown_whole,
    usable_observations,
)
from posefit.tracking.smoothing.contours import fit_contours
from posefit.tracking.smoothing.path import Visibility
from posefit.uncertainty.modes import Posterior

MIN_BODY_FRAMES = 5
# ours: within which a walker hardly turns farther than a search reaches, 45 degrees
NEAR_SECONDS = 0.5


def task_of(scene: Scene, options: TrackOptions, training: Sequence[Motion]) -> Task:
    """Return the task of tracking a scene, as far as it is known before anything is searched."""
    assert options.evaluations is not None
    assert options.translation is not None
    first_pose = (
        None
        if scene.truth is None or options.first_pose == "searched"
        else scene.truth.poses[0, 3:]
    )
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


class Initialised(NamedTuple):
    """What is known before the first frame."""

    task: Task  # with the first pose, if it was searched
    shape: Shape | None  # the person's build, if it was fitted
    # (2,) see `posefit.fitting.driving.clocks`, when what draws was compiled
    start: Array
    effort: dict[str, int]  # evaluations of each stage


def initialise(
    scene: Scene, method: Method, task: Task, options: TrackOptions, progress: Progress
) -> Initialised:
    """Return a task with its first pose, where it is searched, and the person's build, where it is fitted."""
    if task.yaw is None:
        task = replace(task, start=method.start)
    compile_for(scene, task)
    start = clocks()
    shape = None
    effort = dict[str, int]()
    if scene.count == 1:  # it is one search, by the tracker itself
        if method.prior is not None and task.start is not None:
            shown = next(iter(scene.observations))
            modes, used = guessed(task, shown)
            effort["first_pose"] = used
            left = task.evaluations - used
            task = replace(task, modes=modes, start=None, evaluations=left)
        return Initialised(task, None, start, effort)
    body_frames = options.body_frames or 0
    if options.restarts:
        searched = scene.observations, method.follow, options.restarts, options.seed
        task, tried = best_restart(task, *searched, log=progress.log)
        effort["first_pose"] = sum(frame.evaluations for frame in tried)
    count = len(usable_observations(scene.observations, body_frames))
    if body_frames and count < MIN_BODY_FRAMES:
        few = (
            f"{count} of them show enough of the person"
            if count < body_frames
            else f"{count} are too few"
        )
        needed = f"at least {MIN_BODY_FRAMES} are needed; it is the average"
        progress.log(f"no build is fitted to {body_frames} frames: {few}, {needed}")
    elif body_frames:
        progress.log(f"fitting the person's build to {body_frames} frames")
        alone = len(scene.cameras) == 1 and task.translation == "aligned"
        height = options.height or (task.body.stature if alone else None)
        fitted = scene, method.follow, body_frames, height, options.seed
        drawn = PoseCount()
        with drawn.counting():
            shape, cameras = fitted_build(
                task, *fitted, beta=method.audit.beta, restarts=options.restarts or 0
            )
        effort["build"] = round(drawn.poses / len(scene.cameras))
        task = replace(task, body=shape.body, cameras=cameras)
    return Initialised(task, shape, start, effort)


def guessed(
    task: Task, observation: Observation
) -> tuple[Sequence[tuple[float, Posterior]], int]:
    """Return modes of what one picture may show, and the evaluations that these took."""
    drawn = PoseCount()
    with drawn.counting():
        modes = guessed_modes(task, observation)
    return modes, math.ceil(drawn.poses / len(task.cameras))


def fitted_build(
    task: Task,
    scene: Scene,
    follow: Follow,
    frames: int,
    height: float | None,
    seed: int,
    *,
    beta: float = BETA,
    restarts: int = 0,
) -> tuple[Shape, Sequence[Camera]]:
    """Return the person's build, from the first usable frames, every third, where there are so many; and the cameras.

    Several calibrated ones are turned a little so that their masks agree.

    It begins with the first frame that shows most: a person who comes in is cut, and visible to few cameras. By then
    they may have turned from the pose that the task begins with. Where that is longer ago than `NEAR_SECONDS`, the pose
    is searched again, with so many `restarts`, or by the tracker itself.
    """
    observations = scene.observations
    stride = TRIAL_STRIDE
    whole = first_shown_whole(scene.observations)
    first = next(
        (k for k, observation in enumerate(observations) if observation.usable), 0
    )
    chosen = usable_observations(observations, frames, stride, whole)
    if len(chosen) < frames:
        chosen = usable_observations(observations, frames)
        stride = 1
    elif whole - first > NEAR_SECONDS * task.fps:
        task = replace(
            task, yaw=observations[whole].yaw, first_pose=None, modes=(), before=()
        )
        if restarts:
            reach = min(whole + TRIAL_FRAMES * TRIAL_STRIDE, len(observations))
            ahead = [observations[k] for k in range(whole, reach)]
            task, _ = best_restart(task, ahead, follow, restarts, seed)
    task = replace(task, fps=task.fps / stride)

    def frames_of(body: Body) -> list[Frame]:
        return list(
            follow(replace(task, body=body), chosen, np.random.default_rng(seed))
        )

    if scene.cameras_turn:
        filmed = replace(
            scene, body=task.body, observations=chosen, count=len(chosen), fps=task.fps
        )
        average = Shape(task.body, np.ones(len(NAMES)), SPREAD, np.inf, height)
        fitted = fit_contours(
            filmed,
            filmed.motion(frames_of(task.body)),
            Visibility.of(filmed),
            average,
            beta,
        )
        task = replace(task, cameras=fitted[0].cameras)
    aligned = task.translation == "aligned"
    rng = np.random.default_rng(seed)
    shape = fit_shape(
        task.body,
        task.cameras,
        chosen,
        frames_of,
        rng,
        height=height,
        aligned=aligned,
        beta=beta,
        threads=task.threads,
    )
    return shape, task.cameras


def compile_for(scene: Scene, task: Task) -> None:
    """Compute the cost of one pose, so that what draws is compiled before the clocks start."""
    observation = next(iter(scene.observations))
    with uncounted():
        pose_costs(
            task.body,
            task.cameras,
            observation.silhouettes,
            np.zeros((1, ANGLES)),
            task.anchor[None],
        )
