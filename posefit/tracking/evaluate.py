"""The last step of a track: its errors or signs of trust, and its warnings."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.evaluation.errors import Table, evaluated, flagged, unseen
from posefit.evaluation.measures import Effort
from posefit.evaluation.trust import trust_of
from posefit.fitting.shape import Shape
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene
from posefit.measuring.gait import Gait, backwards_warning, gait_of, walks_backwards
from posefit.output.content import Setup, TrackingLog
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import RELOCALISED
from posefit.tracking.result import Track
from posefit.tracking.trajectory import Tracked
from posefit.uncertainty.modes import Posterior, modes_of, track_modes
from posefit.uncertainty.shared import in_footage


def evaluate(
    scene: Scene,
    frames: Sequence[Frame],
    tracked: Tracked,
    shape: Shape | None,
    method: Method,
    task: Task,
    options: TrackOptions,
    effort: Effort,
) -> Track:
    """Return the track with its errors, or with signs of trust if the truth is unknown.

    Args:
        scene: The scene, with the final build.
        frames: The frames of `tracked`, smoothed.
        tracked: The result of tracking.
        shape: The fitted build, or None.
        method: The method.
        task: The task, with the build from before smoothing.
        options: The complete options.
        effort: The evaluations and the time that the track took.

    Returns:
        The track.
    """
    skeleton = scene.body.skeleton
    height_known = options.height is not None
    finished = list[Frame]()
    for frame in frames:
        if frame.posterior is not None:
            posterior = _finished(scene, frame.posterior, height_known)
            frame = replace(frame, posterior=posterior)
        finished.append(frame)
    frames = finished
    posteriors = [frame.posterior for frame in frames]
    training = None if scene.truth is None else task.angles
    table, measures = evaluated(
        scene, frames, method.prior, training, method.audit.beta, effort
    )
    trust = None
    if scene.truth is None:
        trust = trust_of(
            scene, tracked.frames, frames, table, measures.iou, task.training
        )
    motion = scene.motion(frames)
    backwards = walks_backwards(motion, unseen(table))
    warnings = [*scene.warnings, *method.audit.warnings]
    if scene.truth is None and (warning := backwards_warning(backwards)):
        warnings.append(warning)
    modes = track_modes(skeleton, posteriors)
    kept_run = None
    if tracked.kept_run is not None:
        # counted from the scene's first frame so far, and as filmed in the log
        first, last = tracked.kept_run
        kept_run = scene.first + first, scene.first + last
    log = TrackingLog(
        hypotheses=tracked.hypotheses,
        build=None if shape is None else shape.as_dict(),
        trace=frames[0].trace.tolist() if len(frames) == 1 else None,
        modes=[round(mode.weight, 6) for mode in modes] or None,
        none_of_modes=_none_right(posteriors),
        unknown_sides=_numbers(table, "unknown_sides"),
        lost_frames=_numbers(table, "lost"),
        relocalised=_relocalised(scene, frames),
        retracked_outside=kept_run,
        backwards_share=round(float(backwards.mean()), 6),
        warnings=warnings,
        guesses=[*scene.guesses],
    )
    gait = Gait(why="one frame is not a walk")
    if len(frames) > 1:
        gait = gait_of(motion, unseen(table))
    setup = _setup(scene, method, task, options)
    return Track(motion, frames, table, measures, trust, gait, setup, log, modes, scene)


def _setup(scene: Scene, method: Method, task: Task, options: TrackOptions) -> Setup:
    """Return the arguments and the circumstances of a track."""
    assert options.evaluations is not None
    return Setup(
        motion=scene.name,
        method=method.name,
        settings=method.settings,
        seed=options.seed,
        train=[clip.name for clip in task.training],
        evaluations_per_frame=options.evaluations,
        dimensions=method.dimensions(task),
        translation=task.translation,
        first_pose=options.first_pose,
        smooth=bool(options.smooth),
        views=len(scene.cameras),
        camera=scene.placing,
        size_pixels=(scene.cameras[0].width, scene.cameras[0].height),
        fps=scene.fps,
        frames=scene.count,
    )


def _none_right(posteriors: Sequence[Posterior | None]) -> float | None:
    """Return the mean probability that none of a frame's modes is right, if known."""
    none = list[float]()
    for posterior in posteriors:
        if posterior is not None and posterior.recalibration is not None:
            none.append(posterior.recalibration.none)
    return round(float(np.mean(none)), 6) if none else None


def _relocalised(scene: Scene, frames: Sequence[Frame]) -> list[int]:
    """Return the numbers of the frames in which the person was searched again."""
    numbers = list[int]()
    for number, frame in enumerate(frames, scene.first):
        if RELOCALISED in frame.details:
            numbers.append(number)
    return numbers


def _finished(scene: Scene, posterior: Posterior, height_known: bool) -> Posterior:
    """Return a posterior with its modes.

    For footage its uncertainty includes the errors that all frames share.
    """
    model = posterior.recalibration
    if scene.truth is None and model is not None:
        model = in_footage(model, len(scene.cameras), height_known)
    return replace(
        posterior, modes=modes_of(scene.body.skeleton, posterior), recalibration=model
    )


def _numbers(table: Table, name: str) -> list[int] | None:
    """Return the numbers of the flagged frames, or None if all are unknown."""
    frames = flagged(table, name)
    return None if frames is None else table["frame"][frames.frames].tolist()
