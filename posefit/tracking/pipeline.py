"""What happens to a scene: `posefit.track`, `posefit fit` and every cell of a sweep are this pipeline.

| step | what it returns | file |
|---|---|---|
| `initialise` | the first pose and the person's build | initialise.py |
| `follow` | the frames of each hypothesis, by the method's own tracker | pipeline.py |
| `cheapest`, `retrack_spins` | those of the cheapest, tracked again where the body spins | trajectory.py, restarts.py |
| `smooth` | of footage: a smooth path, feet that stand, poses fitted to the contours | smoothing/ |
| `evaluate` | errors against the truth, or signs of trust, and the summary | summary.py |
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.errors import InputError
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene, on_device
from posefit.motion.motion import Motion
from posefit.progress import QUIET, Progress
from posefit.tracking.initialise import initialise, task_of
from posefit.tracking.method import Method, prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.outputs import Output
from posefit.tracking.restarts import (
    MAX_TURN_RATE,
    SEARCHED,
    after,
    backwards,
    first_shown_whole,
    initial_guess,
    joined,
    retrack_spins,
    stream,
)
from posefit.tracking.result import Track
from posefit.tracking.smoothing.smooth import Pass, smooth
from posefit.tracking.summary import evaluate
from posefit.tracking.trajectory import Hypothesis, cheapest

MAX_NOTES = 3  # of the files that a method learns from, which may be thousands


def track_scene(
    scene: Scene,
    training: Sequence[Motion],
    options: TrackOptions | None = None,
    *,
    output: Output | None = None,
    progress: Progress = QUIET,
    source: Mapping[str, Any] | None = None,
) -> Track:
    """Return a scene's motion tracked by a method that learns from `training`, with its errors or signs of trust.

    `output` gets every frame as it comes and everything at the end; `source` is what the summary holds of where the
    scene is from. Raises InputError where something does not fit.
    """
    options = options or TrackOptions()
    output = output or Output()
    options = options.changed(smooth=scene.truth is None if options.smooth is None else options.smooth)
    notes = dict.fromkeys(note for motion in training for note in motion.notes if note not in scene.warnings)
    if len(notes) > MAX_NOTES:
        notes = dict.fromkeys([*islice(notes, MAX_NOTES), f"and {len(notes) - MAX_NOTES} more of files to learn from"])
    scene = replace(on_device(scene, options.device), warnings=[*scene.warnings, *notes])
    task = task_of(scene, options, training)
    if options.smooth and task.translation == "known":
        raise InputError("smooth must be given where the translation is searched or aligned, got known")
    if options.passes > 1 and not options.smooth:
        raise InputError(f"passes must be 1 where a track is not smooth, got {options.passes}")
    with threadpool_limits(1):  # an optimiser's matrices are small: BLAS is slower with more threads
        for warning in scene.warnings:
            progress.warn(warning)
        method = prepare(options, task)
        with progress.phase("build"):
            task, shape = initialise(scene, method, task, options, progress)
            scene = replace(scene, body=task.body)
        method.audit.clear()  # what was tried before the first frame is in no row
        with progress.phase("follow"):
            hypotheses = follow(scene, task, method, options, output, progress)
            tracked = cheapest(scene, hypotheses, task.training)
            if scene.truth is None and method.looks_ahead(task):
                frames, stay = retrack_spins(task, scene.observations, tracked.frames, method.follow, options.seed)
                tracked = tracked._replace(frames=frames, stay=stay)
                if stay is not None:
                    outside = "tracked again before frame {} and after frame {}".format(*stay)
                    progress.log(f"the body turned faster than a person can: {outside}")
                    task = replace(task, fastest_turn=MAX_TURN_RATE)
        smoothed = Pass(scene, tracked.frames, shape, 1)
        if options.smooth:
            with progress.phase("smooth"):
                smoothed = smooth(smoothed, task, method, options, progress)
        return evaluate(smoothed, method, task, tracked, options, output, progress, source or {})


def follow(
    scene: Scene, first: Task, method: Method, options: TrackOptions, output: Output, progress: Progress
) -> list[Hypothesis]:
    """Return the frames of each hypothesis. Each is recorded as it comes; recorded ones are not tracked again.

    In footage, a tracker that looks ahead begins with the first frame that shows the whole person, and goes back first;
    unless more is known of the very first one than its masks show.
    """
    earlier, state = output.earlier()
    start, shown = 0, next((one.yaw for one in scene.observations if one.usable), None)
    if scene.truth is None and first.yaw == shown and method.looks_ahead(first):
        start = first_shown_whole(scene.observations)
    count, total = scene.count, options.hypotheses
    hypotheses: list[Hypothesis] = []
    for number in range(total):
        name, task = SEARCHED, first
        if number:
            usable = (k for k in range(start, count) if scene.observations[k].usable)
            sure = hypotheses[0][1][next(usable, 0)]
            name, task = initial_guess(number, task, scene.yaw, options.first_pose == "given", sure)
        frames = list(earlier[number * count : (number + 1) * count])
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
        behind: list[Frame] = []
        if start and not frames:
            back = method.tracker(backwards(task))
            seen = (scene.observations[k] for k in range(start, -1, -1))
            behind = list(progress.steps(back.track(seen, stream(options.seed, "back", number)), start + 1))
            for frame in behind[:0:-1]:
                output.record(frame, dict(rng.bit_generator.state))
                frames.append(frame)
            task = after(task, behind[0])
        if len(frames) < count:
            rest = (scene.observations[k] for k in range(len(frames), count))
            tracker = method.relocalising(task, scene.truth is None)
            for frame in progress.steps(tracker.track(rest, rng), count - len(frames)):
                output.record(frame, dict(rng.bit_generator.state))
                frames.append(frame)
        if behind:
            frames[:start] = joined(scene.body.skeleton, behind, frames[start])[:0:-1]
    return hypotheses
