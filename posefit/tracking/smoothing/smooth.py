"""A track smoothed and fitted to the contours of the masks; and tracked again along its path, in several passes.

In the first pass a body of another build is aligned to each mask alone, so that it comes nearer and goes away without a
cause, and a tracker cannot tell from that which way the person walks. In the second pass it can.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from posefit.fitting.shape import Shape
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene
from posefit.geometry.rotation import wrapped
from posefit.motion.motion import Motion
from posefit.progress import Progress
from posefit.silhouette.cost import pose_costs
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import stream
from posefit.tracking.smoothing.contours import fit_contours
from posefit.tracking.smoothing.path import Visibility, smooth_path
from posefit.tracking.trajectory import mean_cost, motion_of, with_total_effort

# metres, on each axis, that a joint may be off the root because a fitted build is: seeds 3 to 5 of composites.py
BUILD_DEVIATION = 0.008
STEADY_SECONDS = 1.0 / 30.0  # standard deviation of the filter of angles that a single camera sees
PASS_TOLERANCE = 1.125  # times what the pass before costs: a pass that costs more is not kept


@dataclass(frozen=True, eq=False)
class Pass:
    """The result of tracking all frames once."""

    scene: Scene = field(repr=False)  # with the build that fits it
    frames: list[Frame] = field(repr=False)
    shape: Shape | None  # the build, where it was fitted
    number: int  # from 1


def smooth(first: Pass, task: Task, method: Method, options: TrackOptions, progress: Progress) -> Pass:
    """Return a track smoothed; of several passes the last that costs not much more than the one kept before it.

    Each pass has the full budget, and follows the path of the one that was kept before it. The frames have the effort
    of all passes.
    """
    passes, kept = [smoothed(first.scene, first.frames, first.shape, method.beta)], 0
    usable = np.array([observation.usable for observation in first.scene.observations])
    for number in range(1, options.passes):
        before = passes[kept]
        scene, path = before.scene, [frame.translation for frame in before.frames]
        again = replace(task, body=scene.body, translation="known", anchor=path[0], before=())
        known = (replace(seen, translation=place) for seen, place in zip(scene.observations, path, strict=True))
        progress.log(f"tracking again along its path, pass {number + 1} of {options.passes}")
        rng = stream(options.seed, "pass", number)
        tracker = method.relocalising(again, scene.truth is None)
        tracked = list(progress.steps(tracker.track(known, rng), scene.count))
        passes.append(smoothed(scene, tracked, before.shape, method.beta, number + 1))
        if mean_cost(passes[-1].frames, usable) < PASS_TOLERANCE * mean_cost(before.frames, usable):
            kept = number
    return replace(passes[kept], frames=with_total_effort([done.frames for done in passes], kept))


def smoothed(scene: Scene, frames: Sequence[Frame], shape: Shape | None, beta: float, number: int = 1) -> Pass:
    """Return a pass whose frames are smoothed, and with them the build fitted, where it was before: else it is known.

    Costs and areas are those of the smoothed frames, and their posteriors move as far as the pose and the root did.
    """
    visibility = Visibility.of(scene)
    motion = smooth_path(steadied(motion_of(scene, frames), visibility), visibility)
    motion, shape = fit_contours(scene, motion, visibility, shape, beta)
    motion = smooth_path(motion, visibility)  # contours pull at standing feet
    scene = scene if shape is None else replace(scene, body=shape.body)
    smooth = [_moved(scene, k, frame, motion, beta, shape is not None) for k, frame in enumerate(frames)]
    if shape is not None:
        shape = replace(shape, cost=mean_cost(smooth, visibility.usable))
    return Pass(scene, smooth, shape, number)


def steadied(motion: Motion, visibility: Visibility) -> Motion:
    """Return a motion whose angles are filtered over time, by a Gaussian, in the frames that a single camera sees.

    Its silhouettes leave most open, and angles shake from one frame to the next.
    """
    from scipy.ndimage import gaussian_filter1d

    angles = gaussian_filter1d(np.unwrap(motion.poses, axis=0), STEADY_SECONDS * motion.fps, axis=0, mode="nearest")
    return replace(motion, poses=np.where(np.isfinite(visibility.viewpoints[:, :1]), angles, motion.poses))


def _moved(scene: Scene, k: int, frame: Frame, motion: Motion, beta: float, fitted: bool) -> Frame:
    """Return a frame at the pose that a motion has in frame k, less sure where the build was `fitted`."""
    pose, place, silhouettes = motion.poses[k], motion.translations[k], scene.observations[k].silhouettes
    costs, counts = pose_costs(scene.body, scene.cameras, silhouettes, pose[None], place[None], beta)
    posterior = frame.posterior
    if posterior is not None:
        poses = posterior.poses + wrapped(pose - frame.pose)
        model = posterior.recalibration
        if fitted and model is not None:
            spreads = np.hypot(model.joint_spreads, BUILD_DEVIATION)
            model = replace(model, joint_spreads=np.append(0.0, spreads[1:]))
        places = posterior.translations + (place - frame.translation)
        posterior = replace(posterior, poses=poses, translations=places, recalibration=model)
    moved = replace(frame, pose=pose, translation=place, cost=float(costs[0]), areas=counts[:, 0])
    return replace(moved, coordinates=None, posterior=posterior)
