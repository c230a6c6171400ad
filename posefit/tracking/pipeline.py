"""What happens to a scene: `posefit.track`, `posefit fit` and every cell of a sweep are this pipeline.

| step | what it returns | file |
|---|---|---|
| `initialise` | the first pose and the person's build | initialise.py |
| `follow` | the frames of each hypothesis, by the method's own tracker | follow.py |
| `retrack` | the frames of the cheapest, tracked again where the body spins | follow.py, restarts.py |
| `smooth` | of footage: a smooth path, feet that stand, poses fitted to the contours | smoothing/ |
| `evaluate` | errors against the truth, or signs of trust, and the summary | summary.py |
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from threadpoolctl import threadpool_limits

from posefit.errors import InputError
from posefit.footage.scene import Scene, on_device
from posefit.motion.motion import Motion
from posefit.progress import QUIET, Progress
from posefit.tracking.follow import follow, retrack
from posefit.tracking.initialise import initialise, task_of
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.outputs import Output
from posefit.tracking.restarts import MAX_TURN_RATE
from posefit.tracking.result import Track
from posefit.tracking.smoothing.smooth import Pass, smooth
from posefit.tracking.summary import evaluate


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
    scene = on_device(scene, options.device)
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
            guess = initialise(scene, method, task, options, progress)
        method.audit.clear()  # what was tried before the first frame is in no row
        with progress.phase("follow"):
            hypotheses = follow(guess, method, options, output, progress)
            tracked = retrack(guess, method, hypotheses, options, progress)
        if tracked.start is not None:
            guess = replace(guess, task=replace(guess.task, fastest_turn=MAX_TURN_RATE))
        smoothed = Pass(guess.scene, tracked.frames, guess.shape, 1)
        if options.smooth:
            with progress.phase("smooth"):
                smoothed = smooth(guess, method, tracked.frames, options, progress)
        return evaluate(smoothed, method, guess.task, tracked, options, output, progress, source or {})
