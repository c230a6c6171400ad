"""Estimates before the first frame: its pose, by restarts, and the person's build."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.driving import clocks
from posefit.fitting.shape import NAMES, SPREAD, Shape, fit_shape
from posefit.fitting.tracker import Follow, Frame, Observation, Task
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
    guessed,
    usable_observations,
)
from posefit.tracking.smoothing.contours import fit_contours
from posefit.tracking.smoothing.path import Visibility

MIN_BODY_FRAMES = 5
# Our choice: a walker hardly turns farther in this time than a search reaches, which is
# 45 degrees.
NEAR_SECONDS = 0.5


def task_of(scene: Scene, options: TrackOptions, training: Sequence[Motion]) -> Task:
    """Return the task of tracking a scene, with what is known before any search."""
    assert options.evaluations is not None
    assert options.translation is not None
    first_pose = None
    if scene.truth is not None and options.first_pose != "searched":
        first_pose = scene.truth.poses[0, 3:]
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
        threads=options.threads or 1,
    )


class Initialised(NamedTuple):
    """The task and the build before the first frame."""

    task: Task  # with the first pose, if it was searched
    shape: Shape | None  # the person's build, or None if it was not fitted
    # (2,) see `posefit.fitting.driving.clocks`, after the rasteriser was compiled
    start_clocks: Array
    effort: dict[str, int]  # evaluations of each stage


def initialise(
    scene: Scene, method: Method, task: Task, options: TrackOptions, progress: Progress
) -> Initialised:
    """Search the first pose and fit the person's build, as far as the options ask.

    Args:
        scene: The scene.
        method: The method that tracks it.
        task: The task, from `task_of`.
        options: The options of the track.
        progress: Gets messages.
    """
    if task.yaw is None:
        task = replace(task, start=method.start)
    compile_for(scene, task)
    start = clocks()
    shape = None
    effort = dict[str, int]()
    # a single picture is one search, by the tracker itself
    if scene.count == 1:
        if method.prior is not None and task.start is not None:
            observation = next(iter(scene.observations))
            modes, used = guessed(task, observation)
            effort["first_pose"] = used
            remaining = task.evaluations - used
            task = replace(task, modes=modes, start=None, evaluations=remaining)
        return Initialised(task, None, start, effort)
    if options.restarts:
        task, tried = best_restart(
            task,
            scene.observations,
            method.follow,
            options.restarts,
            options.seed,
            log=progress.log,
        )
        effort["first_pose"] = sum(frame.evaluations for frame in tried)
    if options.body_frames and _has_enough(scene, options.body_frames, progress):
        progress.log(f"fitting the person's build to {options.body_frames} frames")
        height = options.height
        # the masks of one camera do not tell a tall person from a near one
        if height is None and len(scene.cameras) == 1 and task.translation == "aligned":
            height = task.body.stature
        rasterised = PoseCount()
        with rasterised.counting():
            shape, cameras = fitted_build(
                task,
                scene,
                method.follow,
                options.body_frames,
                height,
                options.seed,
                beta=method.audit.beta,
                restarts=options.restarts or 0,
            )
        effort["build"] = round(rasterised.poses / len(scene.cameras))
        task = replace(task, body=shape.body, cameras=cameras)
    return Initialised(task, shape, start, effort)


def _has_enough(scene: Scene, body_frames: int, progress: Progress) -> bool:
    """Return whether a scene has usable frames for a build, and log it if not.

    The build is to be fitted to `body_frames` frames, and needs `MIN_BODY_FRAMES`.
    """
    count = len(usable_observations(scene.observations, body_frames))
    if count >= MIN_BODY_FRAMES:
        return True
    few = f"{count} are too few"
    if count < body_frames:
        few = f"{count} of them show enough of the person"
    needed = f"at least {MIN_BODY_FRAMES} are needed; the average build is used"
    progress.log(f"no build is fitted to {body_frames} frames: {few}, {needed}")
    return False


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
    """Return the person's build, fitted to some usable frames, and the cameras.

    Several calibrated cameras are turned a little so that their masks agree.

    Args:
        task: The task, with the first pose.
        scene: The scene.
        follow: The tracker.
        frames: How many frames: every third, or successive ones if there are too few.
        height: The person's height in metres, or None if it is fitted.
        seed: The seed of the random numbers.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        restarts: The restarts of a new search. 0: the tracker itself searches.

    Returns:
        The build, and the cameras.
    """
    task, chosen = _build_frames(
        task, scene.observations, follow, frames, seed, restarts
    )

    def frames_of(body: Body) -> list[Frame]:
        """Return the chosen frames, tracked with a body."""
        rng = np.random.default_rng(seed)
        return list(follow(replace(task, body=body), chosen, rng))

    # before the build, which would otherwise make up for errors of the calibration
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
    rng = np.random.default_rng(seed)
    shape = fit_shape(task, chosen, frames_of, rng, height=height, beta=beta)
    return shape, task.cameras


def _build_frames(
    task: Task,
    observations: Sequence[Observation],
    follow: Follow,
    frames: int,
    seed: int,
    restarts: int,
) -> tuple[Task, list[Observation]]:
    """Return the frames to which a build is fitted, and the task of tracking them.

    The frames start from the one that shows most: a person who enters the picture is
    cut, and visible to few cameras. By then they may have turned away from the first
    pose of the task. If that frame is later than `NEAR_SECONDS`, the pose is searched
    again.

    The arguments are those of `fitted_build`.
    """
    whole = first_shown_whole(observations)
    chosen = usable_observations(observations, frames, TRIAL_STRIDE, whole)
    if len(chosen) < frames:
        return task, usable_observations(observations, frames)
    usable = (k for k, observation in enumerate(observations) if observation.usable)
    if whole - next(usable, 0) > NEAR_SECONDS * task.fps:
        task = replace(
            task, yaw=observations[whole].yaw, first_pose=None, modes=(), before=()
        )
        if restarts:
            reach = min(whole + TRIAL_FRAMES * TRIAL_STRIDE, len(observations))
            ahead = [observations[k] for k in range(whole, reach)]
            task, _ = best_restart(task, ahead, follow, restarts, seed)
    return replace(task, fps=task.fps / TRIAL_STRIDE), chosen


def compile_for(scene: Scene, task: Task) -> None:
    """Compute one cost, which compiles the rasteriser before the clocks start."""
    observation = next(iter(scene.observations))
    with uncounted():
        pose_costs(
            task.body,
            task.cameras,
            observation.silhouettes,
            np.zeros((1, ANGLES)),
            task.anchor[None],
        )
