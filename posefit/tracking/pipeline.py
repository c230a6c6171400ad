"""What happens to a scene: `posefit.track`, `posefit fit` and every cell of a sweep are this pipeline.

| step | what it returns | file |
|---|---|---|
| `initialise` | the first pose and the person's build | initialise.py |
| `follow` | the frames of each hypothesis, by the method's own tracker | this one |
| `cheapest`, `retrack_spins` | those of the cheapest, tracked again where the body spins | trajectory.py, restarts.py |
| `smooth` | of footage: a smooth path, feet that stand, poses fitted to the contours | smoothing/ |
| `evaluate` | errors against the truth, or signs of trust | evaluate.py |
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.errors import InputError
from posefit.fitting.driving import clocks
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene, on_device
from posefit.motion.motion import Motion
from posefit.output.folder import Recorder
from posefit.progress import QUIET, Progress
from posefit.tracking.evaluate import evaluate
from posefit.tracking.initialise import initialise, task_of
from posefit.tracking.method import Method, prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.restarts import (
    GAP,
    SEARCHED,
    after,
    backwards,
    first_shown_whole,
    initial_guess,
    joined,
    relocalised,
    retrack_spins,
    stream,
)
from posefit.tracking.result import Track
from posefit.tracking.smoothing.smooth import smooth
from posefit.tracking.trajectory import Hypothesis, cheapest

MAX_NOTES = 3  # of the files that a method learns from, which may be thousands


def with_notes(scene: Scene, training: Sequence[Motion]) -> Scene:
    """Return a scene whose warnings say, too, what was guessed where the files to learn from were read."""
    notes = list(dict.fromkeys(note for motion in training for note in motion.notes if note not in scene.warnings))
    if len(notes) > MAX_NOTES:
        notes[MAX_NOTES:] = [f"and {len(notes) - MAX_NOTES} more of files to learn from"]
    return replace(scene, warnings=[*scene.warnings, *notes])


def track_scene(
    scene: Scene,
    training: Sequence[Motion],
    options: TrackOptions | None = None,
    *,
    recorder: Recorder | None = None,
    progress: Progress = QUIET,
) -> Track:
    """Return a scene's motion tracked by a method that learns from `training`, with its errors or signs of trust.

    `recorder` gets every frame as it comes. Raises InputError where something does not fit.
    """
    options = options or TrackOptions()
    options = options.changed(smooth=scene.truth is None if options.smooth is None else options.smooth)
    scene = with_notes(on_device(scene, options.device), training)
    task = task_of(scene, options, training)
    if options.smooth and task.translation == "known":
        raise InputError("smooth must be given where the translation is searched or aligned, got known")
    with threadpool_limits(1):  # an optimiser's matrices are small: BLAS is slower with more threads
        for warning in scene.warnings:
            progress.warn(warning)
        method = prepare(options, task)
        with progress.phase("build"):
            task, shape, start = initialise(scene, method, task, options, progress)
            scene = replace(scene, body=task.body)
        method.audit.clear()  # what was tried before the first frame is in no row
        with progress.phase("follow"):
            hypotheses = follow(scene, task, method, options, recorder or Recorder(), progress)
            tracked = cheapest(scene, hypotheses, task.training)
            if scene.truth is None and method.looks_ahead:
                tracked = retrack_spins(task, scene.observations, tracked, method.follow, options.seed)
                if tracked.stay is not None:
                    outside = "tracked again before frame {} and after frame {}".format(*tracked.stay)
                    progress.log(f"the body turned faster than a person can: {outside}")
        frames = tracked.frames
        if options.smooth:
            with progress.phase("smooth"):
                scene, frames, shape = smooth(scene, frames, shape, method.audit.beta)
        with progress.phase("evaluate"):
            track = evaluate(
                scene, frames, tracked, shape, method, task, options, clocks() - start + scene.reading_seconds
            )
    for warning in track.course.warnings[len(scene.warnings) :]:
        progress.warn(warning)
    return track


def follow(
    scene: Scene, first: Task, method: Method, options: TrackOptions, recorder: Recorder, progress: Progress
) -> list[Hypothesis]:
    """Return the frames of each hypothesis. Each is recorded as it comes; recorded ones are not tracked again.

    In footage, a tracker that looks ahead begins with the first frame that shows the whole person, and goes back first;
    unless more is known of the very first one than its masks show.
    """
    recorded, state = recorder.earlier()
    start, first_yaw = 0, next((each.yaw for each in scene.observations if each.usable), None)
    if scene.truth is None and first.yaw == first_yaw and method.looks_ahead:
        start = first_shown_whole(scene.observations)
    gap = (GAP if scene.truth is None else 0) if method.relocalise_gap is None else method.relocalise_gap
    count, total = scene.count, options.hypotheses
    hypotheses: list[Hypothesis] = []
    for number in range(total):
        name, task = SEARCHED, first
        if number:
            usable = (k for k in range(start, count) if scene.observations[k].usable)
            reference = hypotheses[0][1][next(usable, 0)]
            name, task = initial_guess(number, task, scene.yaw, options.first_pose == "given", reference)
        frames = list(recorded[number * count : (number + 1) * count])
        rng = stream(options.seed, "hypothesis", number) if number else np.random.default_rng(options.seed)
        which = f" of track {number + 1} of {total}, {name}" if total > 1 else ""
        if state is not None and 0 < len(frames) < count:
            rng.bit_generator.state = state
            frames = [  # this track has other trajectories than the earlier one
                frame if (own := frame.posterior) is None else replace(frame, posterior=replace(own, coherent=False))
                for frame in frames
            ]
            progress.log(f"going on from frame {len(frames)} of {count}{which}")
            last = frames[-1]
            task = replace(task, yaw=float(last.pose[0]), first_pose=last.pose[3:], before=tuple(frames))
        elif which and not frames:
            progress.log(f"track {number + 1} of {total}: {name}")
        hypotheses.append((name, frames))
        back: list[Frame] = []
        if start and not frames:
            reversed_observations = (scene.observations[k] for k in range(start, -1, -1))
            going_back = method.follow(backwards(task), reversed_observations, stream(options.seed, "back", number))
            back = list(progress.steps(going_back, start + 1))
            for frame in back[:0:-1]:
                recorder.record(frame, dict(rng.bit_generator.state))
                frames.append(frame)
            task = after(task, back[0])
        if len(frames) < count:
            rest = (scene.observations[k] for k in range(len(frames), count))
            ahead: Iterator[Frame] = relocalised(task, method.follow, rest, rng, gap)
            for frame in progress.steps(ahead, count - len(frames)):
                recorder.record(frame, dict(rng.bit_generator.state))
                frames.append(frame)
        if back:
            frames[:start] = joined(scene.body.skeleton, back, frames[start])[:0:-1]
    return hypotheses
