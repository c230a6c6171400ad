"""What happens to a scene: `posefit.track`, `posefit fit` and every cell of a sweep are this pipeline.

| step | what it returns | file |
|---|---|---|
| `initialise` | the first pose and the person's build | initialise.py |
| `track_hypotheses`, `track_hypothesis` | the frames of each, and of one, by the method's tracker | this one |
| `cheapest`, `retrack_spins` | those of the cheapest, tracked again where the body spins | trajectory.py, restarts.py |
| `smooth` | of footage: a smooth path, planted feet, poses fitted to the contours | smoothing/ |
| `with_cheapest_legs` | of footage by one camera: the same with legs exchanged in some frames | smoothing/legs.py |
| `tracked_again` | of footage by several cameras: back, then onward, from what is smooth | restarts.py |
| `evaluate` | errors against the truth, or signs of trust | evaluate.py |
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.evaluation.measures import Effort
from posefit.fitting.carried import CARRIED, with_carried
from posefit.fitting.driving import clocks
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.footage.device import on_device
from posefit.footage.scene import Scene
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import geodesic
from posefit.motion.motion import Motion
from posefit.output.folder import Recorder
from posefit.progress import QUIET, Progress
from posefit.silhouette.drawn import PoseCount, uncounted
from posefit.tracking.evaluate import evaluate
from posefit.tracking.initialise import initialise, task_of
from posefit.tracking.method import Method, prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.polish import (
    beyond_prior,
    polish_evaluations,
    polished,
    with_one_mode,
)
from posefit.tracking.restarts import (
    SEARCHED,
    after,
    first_shown_whole,
    initial_guess,
    joined,
    relocalised,
    retrack_spins,
    reversed_task,
    stream,
    tracked_again,
)
from posefit.tracking.result import Track
from posefit.tracking.smoothing.legs import with_cheapest_legs
from posefit.tracking.smoothing.smooth import Smoothed, smooth
from posefit.tracking.trajectory import (
    Hypothesis,
    Tracked,
    cheapest,
    mean_cost,
    with_effort_of,
    with_total_effort,
)

# of a film by several cameras, at most, and of a frame in each, at least
PASSES = 3
PASS_EVALUATIONS = 2440
SHORTEST = 3  # frames that are more than single pictures
MAX_NOTES = 3  # of the files that a method learns from, which may be thousands


def with_notes(scene: Scene, training: Sequence[Motion]) -> Scene:
    """Return a scene whose warnings say, too, what was guessed where the files to learn from were read."""
    notes = list(
        dict.fromkeys(
            note
            for motion in training
            for note in motion.notes
            if note not in scene.warnings
        )
    )
    if len(notes) > MAX_NOTES:
        notes[MAX_NOTES:] = [
            f"and {len(notes) - MAX_NOTES} more of files to learn from"
        ]
    return replace(scene, warnings=[*scene.warnings, *notes])


def with_turns(scene: Scene, calibrated: Sequence[Camera]) -> Scene:
    """Return a scene whose guesses say by how much its cameras were turned from calibrated ones, where they were."""
    cameras = list(zip(scene.cameras, calibrated, strict=True))
    if all(camera is other for camera, other in cameras):
        return scene
    degrees = [
        np.degrees(geodesic(camera.rotation, other.rotation))
        for camera, other in cameras
    ]
    said = ", ".join(f"{each:.2f}" for each in degrees)
    return replace(
        scene,
        guesses=[
            *scene.guesses,
            f"cameras turned by {said} degrees, so that their masks agree",
        ],
    )


def track_scene(
    scene: Scene,
    training: Sequence[Motion],
    options: TrackOptions,
    *,
    recorder: Recorder | None = None,
    progress: Progress = QUIET,
) -> Track:
    """Return a scene's motion tracked by a method that learns from `training`, with its errors or signs of trust.

    The options are those that `posefit.tracking.defaults.completed` returns. `recorder` gets every frame as it comes.
    """
    scene = given = with_notes(on_device(scene, options.device), training)
    for warning in scene.warnings:
        progress.warn(warning)
    task = task_of(scene, options, training)
    if options.smooth:
        # it brings a BLAS of its own, and only one that is loaded can be limited
        import scipy.linalg  # noqa: F401
    # an optimiser's matrices are small: BLAS is slower with more threads
    with threadpool_limits(1):
        method = prepare(options, task)
        passes = _passes(scene, method, task.evaluations, bool(options.smooth))
        task = replace(task, evaluations=task.evaluations // passes)
        alone = scene.count == 1 and scene.truth is None
        polishing = _polish_evaluations(scene, method, task.evaluations, options)
        task = replace(task, evaluations=task.evaluations - polishing)
        with progress.phase("build"):
            task, shape, start_clocks, effort = initialise(
                scene, method, task, options, progress
            )
            scene = replace(scene, body=task.body, cameras=task.cameras)
        method.audit.clear()  # what was tried before the first frame is in no row
        with progress.phase("track"):
            hypotheses = track_hypotheses(
                scene, task, method, options, recorder or Recorder(), progress
            )
            tracked = cheapest(scene, hypotheses, task.training)
            effort["frames"] = _evaluations(tracked.frames)
            if scene.truth is None and method.looks_ahead:
                tracked = retrack_spins(
                    task, scene.observations, tracked, method.follow, options.seed
                )
                if tracked.stay is not None:
                    outside = "tracked again before frame {} and after frame {}".format(
                        *tracked.stay
                    )
                    progress.log(f"the body turned faster than a person can: {outside}")
        frames = tracked.frames
        if polishing:
            shown = next(iter(scene.observations))
            assert method.prior is not None
            search = replace(task, start=method.start if task.yaw is None else None)
            known = shown, polishing, method.audit.beta
            frames = [polished(search, frames[0], *known)]
            effort["frames"] = _evaluations(frames)
            left = beyond_prior(method.prior, task.body.skeleton, frames[0].pose)
            if left:
                progress.warn(left)
                scene = replace(scene, warnings=[*scene.warnings, left])
        elif alone and method.prior is not None and frames[0].posterior is None:
            frames = [with_one_mode(frames[0])]
        smoothed = Smoothed(scene, frames, shape)
        smoothing = PoseCount()
        if options.smooth and scene.count > 1:
            with progress.phase("smooth"), smoothing.counting():
                smoothed = smooth(*smoothed, method.audit.beta)
                usable = sum(observation.usable for observation in scene.observations)
                if (
                    len(scene.cameras) == 1
                    and usable >= SHORTEST
                    and scene.truth is None
                ):
                    smoothed, exchanged = with_cheapest_legs(
                        frames, smoothed, method.audit.beta
                    )
                    if exchanged.any():
                        progress.log(
                            f"legs exchanged in {exchanged.sum()} frames, where smooth ones then fit better"
                        )
        if passes > 1:
            again = passes, options.seed, progress
            tracked, smoothed = _cheapest_pass(
                task, method, tracked, smoothed, smoothing, *again
            )
        scene, frames, shape = smoothed
        later = _evaluations(frames) - effort["frames"]
        later += round(smoothing.poses / len(scene.cameras))
        if later:
            effort["later_passes"] = later
        scene = with_turns(scene, given.cameras)
        for guess in scene.guesses[len(given.guesses) :]:
            progress.log(guess)
        # what a track is compared with is no effort of the method
        with progress.phase("evaluate"), uncounted():
            taken = clocks() - start_clocks + scene.reading_seconds
            seconds, cpu_seconds = taken.tolist()
            track = evaluate(
                scene,
                frames,
                tracked,
                shape,
                method,
                task,
                options,
                Effort(seconds, cpu_seconds, effort),
            )
    for warning in track.log.warnings[len(scene.warnings) :]:
        progress.warn(warning)
    return track


def track_hypotheses(
    scene: Scene,
    first: Task,
    method: Method,
    options: TrackOptions,
    recorder: Recorder,
    progress: Progress,
) -> list[Hypothesis]:
    """Return each hypothesis with all its frames. Each is recorded as it comes; recorded ones are not tracked again."""
    recorded, state = recorder.earlier()
    gap = method.relocalise_gap if scene.truth is None else 0
    count = scene.count
    total = options.hypotheses
    pivot = _pivot(scene, first, method)
    tracked: list[Hypothesis] = []
    for number in range(total):
        hypothesis = _hypothesis(number, scene, first, options, tracked, pivot)
        frames = recorded[number * count : (number + 1) * count]
        done = len(frames)
        which = f"track {number + 1} of {total}"
        if 0 < done < count and state is not None:
            hypothesis = _resumed(hypothesis, frames, state)
            frames = list(hypothesis.frames)
            of_several = f" of {which}, {hypothesis.guess}" if total > 1 else ""
            progress.log(f"going on from frame {done} of {count}{of_several}")
            if _starts_anew(method, frames):
                progress.warn(
                    f"{method.name} starts anew at frame {done}: the frames from there on may be "
                    "others than those of a track that was not interrupted"
                )
        elif not done and total > 1:
            progress.log(f"{which}: {hypothesis.guess}")
        if done < count:
            rng = stream(options.seed, "back", number)
            behind = (
                _tracked_back(scene, hypothesis, method, pivot, rng, progress)
                if pivot and not done
                else []
            )
            ahead = (scene.observations[k] for k in range(done or pivot, count))
            for frame in progress.steps(
                track_hypothesis(hypothesis, method, ahead, gap, behind), count - done
            ):
                recorder.record(frame, dict(hypothesis.rng.bit_generator.state))
                frames.append(with_carried(frame, None))
        tracked.append(replace(hypothesis, frames=frames))
    return tracked


def track_hypothesis(
    hypothesis: Hypothesis,
    method: Method,
    ahead: Iterable[Observation],
    gap: int,
    behind: Sequence[Frame] = (),
) -> Iterator[Frame]:
    """Yield the frames of one hypothesis in the order of time, one for each observation that is `ahead`.

    After a `gap` of so many frames without the person they are searched again. Frames `behind` were tracked back in
    time from the first observation ahead, the pivot, and are yielded before it. The pivot is searched twice, on the way
    back and again from there; its frame has the effort of both.
    """
    task = after(hypothesis.task, behind[0]) if behind else hypothesis.task
    task = replace(task, resumable=True)
    frames = relocalised(task, method.follow, ahead, hypothesis.rng, gap)
    if behind:
        pivot = next(frames)
        yield from reversed(joined(task.body.skeleton, behind, pivot)[1:])
        yield with_effort_of(pivot, [behind[0], pivot])
    yield from frames


def _cheapest_pass(
    task: Task,
    method: Method,
    tracked: Tracked,
    smoothed: Smoothed,
    smoothing: PoseCount,
    passes: int,
    seed: int,
    progress: Progress,
) -> tuple[Tracked, Smoothed]:
    """Return the cheapest of so many passes of a film, and what is smoothed of it, with the effort of all."""
    scene, frames, shape = smoothed
    usable = np.array([observation.usable for observation in scene.observations])

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        return progress.steps(method.follow(task, observations, rng), scene.count)

    for number in range(1, passes):
        progress.log(
            f"tracking the {scene.count} frames again, {'back in time' if number % 2 else 'onward'}"
        )
        with progress.phase("track"):
            latest = replace(task, body=scene.body, cameras=scene.cameras)
            again = tracked_again(
                latest, scene.observations, frames, follow, number, seed
            )
        with progress.phase("smooth"), smoothing.counting():
            other, others, build = smooth(scene, again, shape, method.audit.beta)
        better = mean_cost(others, usable) < mean_cost(frames, usable)
        frames = with_total_effort([frames, others], int(better))
        if better:
            scene = other
            shape = build
            tracked = tracked._replace(frames=again)
    return tracked, Smoothed(scene, frames, shape)


def _passes(scene: Scene, method: Method, evaluations: int, smoothed: bool) -> int:
    """Return how often a film is tracked: several cameras show which of two poses is right, once it is tried."""
    if len(scene.cameras) == 1 or scene.count < SHORTEST or scene.truth is not None:
        return 1
    return (
        max(min(PASSES, evaluations // PASS_EVALUATIONS), 1)
        if method.looks_ahead and smoothed
        else 1
    )


def _evaluations(frames: Sequence[Frame]) -> int:
    return sum(frame.evaluations for frame in frames)


def _polish_evaluations(
    scene: Scene, method: Method, evaluations: int, options: TrackOptions
) -> int:
    """Return how many of the evaluations of one picture are for polishing what a search by an optimiser leaves open."""
    alone = scene.count == 1 and scene.truth is None and options.smooth
    if not alone or method.prior is None or not next(iter(scene.observations)).usable:
        return 0
    return polish_evaluations(evaluations)


def _pivot(scene: Scene, task: Task, method: Method) -> int:
    """Return the frame that is tracked first.

    In footage, a tracker that looks ahead begins with the first frame that shows the whole person; unless more is known
    of the very first one than its masks show.
    """
    if scene.truth is not None or not method.looks_ahead:
        return 0
    first_yaw = next(
        (observation.yaw for observation in scene.observations if observation.usable),
        None,
    )
    return first_shown_whole(scene.observations) if task.yaw == first_yaw else 0


def _tracked_back(
    scene: Scene,
    hypothesis: Hypothesis,
    method: Method,
    pivot: int,
    rng: np.random.Generator,
    progress: Progress,
) -> list[Frame]:
    """Return the frames from the pivot back to the first of the scene."""
    back = (scene.observations[k] for k in range(pivot, -1, -1))
    return list(
        progress.steps(
            method.follow(reversed_task(hypothesis.task), back, rng), pivot + 1
        )
    )


def _hypothesis(
    number: int,
    scene: Scene,
    first: Task,
    options: TrackOptions,
    tracked: Sequence[Hypothesis],
    pivot: int,
) -> Hypothesis:
    """Return a hypothesis before its first frame; unless it is the first, its guess varies a frame of the first one."""
    if not tracked:
        return Hypothesis(SEARCHED, first, np.random.default_rng(options.seed))
    usable = (k for k in range(pivot, scene.count) if scene.observations[k].usable)
    estimate = tracked[0].frames[next(usable, 0)]
    guess, task = initial_guess(
        number, first, scene.yaw, options.first_pose == "given", estimate
    )
    return Hypothesis(guess, task, stream(options.seed, "hypothesis", number))


def _starts_anew(method: Method, recorded: Sequence[Frame]) -> bool:
    """Return whether what a method knew after recorded frames is lost: it is a tracker, or a filter of other values."""
    kept = [frame.details[CARRIED] for frame in recorded if CARRIED in frame.details]
    return method.prior is None or (bool(kept) and not kept[-1])


def _resumed(
    hypothesis: Hypothesis, recorded: Sequence[Frame], state: dict[str, Any]
) -> Hypothesis:
    """Return a hypothesis that goes on from recorded frames, after which the random generator had some state.

    What follows has other trajectories than the earlier frames.
    """
    hypothesis.rng.bit_generator.state = state
    posteriors = [
        frame.posterior and replace(frame.posterior, coherent=False)
        for frame in recorded
    ]
    frames = [
        replace(frame, posterior=posterior)
        for frame, posterior in zip(recorded, posteriors, strict=True)
    ]
    pose = frames[-1].pose
    task = replace(
        hypothesis.task, yaw=float(pose[0]), first_pose=pose[3:], before=tuple(frames)
    )
    return replace(hypothesis, task=task, frames=frames)
