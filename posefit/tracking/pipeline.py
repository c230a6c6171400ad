"""The pipeline of `posefit.track`, `posefit fit` and every cell of a sweep.

| step | what it returns | file |
|---|---|---|
| `initialise` | the first pose and the person's build | initialise.py |
| `track_hypotheses` | the frames of each hypothesis, by the tracker | this one |
| `cheapest` | the frames of the cheapest hypothesis | trajectory.py |
| `retrack_spins` | frames tracked again if the body spins | spins.py |
| `smooth` | footage: a smooth path, planted feet, fitted contours | smoothing/ |
| `with_straight_legs` | one camera: straighter legs | smoothing/standing.py |
| `with_cheapest_legs` | one camera: some frames' legs exchanged | smoothing/legs.py |
| `tracked_again` | several cameras: back, then onward | restarts.py |
| `evaluate` | errors against the truth, or signs of trust | evaluate.py |
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

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
from posefit.limits import trim_memory
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
    reversed_task,
    stream,
    tracked_again,
)
from posefit.tracking.result import Track
from posefit.tracking.smoothing.contours import Borders
from posefit.tracking.smoothing.legs import with_cheapest_legs
from posefit.tracking.smoothing.smooth import Smoothed, smooth
from posefit.tracking.smoothing.standing import with_straight_legs
from posefit.tracking.spins import retrack_spins
from posefit.tracking.trajectory import (
    Hypothesis,
    Tracked,
    cheapest,
    mean_cost,
    with_effort_of,
    with_total_effort,
)

PASSES = 3  # passes over a film by several cameras, at most
PASS_EVALUATIONS = 2440  # evaluations per frame in each pass, at least
SHORTEST = 3  # frames of a film, at least
MAX_NOTES = 3  # notes on training files that are shown: there may be thousands


def with_notes(scene: Scene, training: Sequence[Motion]) -> Scene:
    """Return a scene with warnings about guesses made in reading training files."""
    notes = list[str]()
    for motion in training:
        for note in motion.notes:
            if note not in scene.warnings and note not in notes:
                notes.append(note)
    if len(notes) > MAX_NOTES:
        more = len(notes) - MAX_NOTES
        notes[MAX_NOTES:] = [f"and {more} more about training files"]
    return replace(scene, warnings=[*scene.warnings, *notes])


def with_turns(scene: Scene, calibrated: Sequence[Camera]) -> Scene:
    """Return a scene with a guess that says how far its cameras were turned, if at all.

    `calibrated` are the cameras before they were turned.
    """
    cameras = list(zip(scene.cameras, calibrated, strict=True))
    if all(camera is other for camera, other in cameras):
        return scene
    degrees = [
        np.degrees(geodesic(camera.rotation, other.rotation))
        for camera, other in cameras
    ]
    angles = ", ".join(f"{angle:.2f}" for angle in degrees)
    guess = f"cameras turned by {angles} degrees, so that their masks agree"
    return replace(scene, guesses=[*scene.guesses, guess])


def track_scene(
    scene: Scene,
    training: Sequence[Motion],
    options: TrackOptions,
    *,
    recorder: Recorder | None = None,
    progress: Progress = QUIET,
) -> Track:
    """Track the person in a scene, and evaluate the track.

    Args:
        scene: The scene.
        training: The motions that the method learns from.
        options: The options, completed by `posefit.tracking.defaults.completed`.
        recorder: Gets every frame as it comes.
        progress: Gets messages and warnings.

    Returns:
        The track, with errors against the truth or signs of trust.
    """
    given = with_notes(on_device(scene, options.device), training)
    for warning in given.warnings:
        progress.warn(warning)
    first_task = task_of(given, options, training)  # without what a search adds
    if options.smooth:
        # SciPy has a BLAS too, and only a loaded BLAS can be limited
        import scipy.linalg  # noqa: F401
    # the matrices of optimisers are small, and BLAS is slower with more threads
    with threadpool_limits(1):
        method = prepare(options, first_task)
        budget = _budget(given, method, first_task.evaluations, options)
        first_task = replace(first_task, evaluations=budget.evaluations)

        with progress.phase("build"):
            started = initialise(given, method, first_task, options, progress)
        if started.shape is not None:
            trim_memory()
        task = started.task
        scene = replace(given, body=task.body, cameras=task.cameras)
        effort = started.effort

        # the audit covers the track, not the search before its first frame
        method.audit.clear()
        with progress.phase("track"):
            hypotheses = track_hypotheses(
                scene, task, method, options, recorder or Recorder(), progress
            )
            tracked = cheapest(scene, hypotheses, task.training)
            effort["frames"] = _evaluations(tracked.frames)
            tracked = _without_spins(scene, task, method, tracked, options, progress)

        result = Smoothed(scene, tracked.frames, started.shape)
        smoothing = PoseCount()  # the poses that smoothing compares with masks
        if scene.count == 1 and scene.truth is None:
            result = _of_one_picture(result, task, method, budget.polishing, progress)
            effort["frames"] = _evaluations(result.frames)
        elif options.smooth and scene.count > 1:
            trim_memory()
            with progress.phase("smooth"), smoothing.counting():
                result = _smoothed(result, task, method.audit.beta, progress)
            trim_memory()
        if budget.passes > 1:
            tracked, result = _cheapest_pass(
                task,
                method,
                tracked,
                result,
                smoothing,
                budget.passes,
                options.seed,
                progress,
            )
        # what spins, passes and smoothing added
        later = _evaluations(result.frames) - effort["frames"]
        later += round(smoothing.poses / len(result.scene.cameras))
        if later:
            effort["later_passes"] = later

        scene = with_turns(result.scene, given.cameras)
        for guess in _added(scene.guesses, given.guesses):
            progress.log(guess)
        # evaluating a track is not part of the method's effort
        with progress.phase("evaluate"), uncounted():
            taken = clocks() - started.start_clocks + scene.reading_seconds
            seconds, cpu_seconds = taken.tolist()
            track = evaluate(
                scene,
                result.frames,
                tracked,
                result.shape,
                method,
                task,
                options,
                Effort(seconds, cpu_seconds, effort),
            )
    for warning in _added(track.log.warnings, scene.warnings):
        progress.warn(warning)
    return track


def _added(messages: Sequence[str], earlier: Sequence[str]) -> list[str]:
    """Return the messages that are not among earlier ones."""
    return [message for message in messages if message not in earlier]


def _without_spins(
    scene: Scene,
    task: Task,
    method: Method,
    tracked: Tracked,
    options: TrackOptions,
    progress: Progress,
) -> Tracked:
    """Return a track of footage in which the body turns no faster than a person can.

    A known motion, and a tracker that does not look ahead, are left as they are.
    """
    if scene.truth is not None or not method.looks_ahead:
        return tracked
    tracked = retrack_spins(
        task, scene.observations, tracked, method.follow, options.seed
    )
    if tracked.kept_run is not None:
        first, last = tracked.kept_run
        progress.log(
            "the body turned faster than a person can: tracked again before frame "
            f"{first} and after frame {last}"
        )
    return tracked


def _of_one_picture(
    tracked: Smoothed, task: Task, method: Method, polishing: int, progress: Progress
) -> Smoothed:
    """Return the track of a single picture, with all poses that it may show.

    Args:
        tracked: The scene with its only frame.
        task: The task.
        method: The method that tracked it.
        polishing: Evaluations for another search around the poses found; 0 for none.
        progress: Gets a warning if the prior cannot represent the pose.
    """
    prior = method.prior
    if prior is None:
        return tracked
    scene = tracked.scene
    (frame,) = tracked.frames
    if not polishing:
        # a method without a posterior reports one pose
        one_mode = frame if frame.posterior else with_one_mode(frame)
        return tracked._replace(frames=[one_mode])
    shown = next(iter(scene.observations))
    search = replace(task, start=method.start if task.yaw is None else None)
    frame = polished(search, frame, shown, polishing, method.audit.beta)
    if warning := beyond_prior(prior, task.body.skeleton, frame.pose):
        progress.warn(warning)
        scene = replace(scene, warnings=[*scene.warnings, warning])
    return tracked._replace(scene=scene, frames=[frame])


def _smoothed(
    tracked: Smoothed, task: Task, beta: float, progress: Progress
) -> Smoothed:
    """Return a smoothed track, with legs exchanged where it then fits better.

    Legs are doubtful only in footage by a single camera, which must be long enough to
    judge them. `beta` is the weight in the cost.
    """
    borders = Borders(tracked.scene.observations)
    smoothed = smooth(*tracked, beta, borders)
    scene = smoothed.scene
    usable = sum(observation.usable for observation in scene.observations)
    if len(scene.cameras) > 1 or scene.truth is not None or usable < SHORTEST:
        return smoothed
    frames, smoothed = with_straight_legs(tracked, smoothed, beta, borders)
    smoothed, exchanged = with_cheapest_legs(
        frames, smoothed, beta, task.threads, borders
    )
    if exchanged.any():
        progress.log(
            f"legs exchanged in {exchanged.sum()} frames,"
            " where the smoothed track then fits better"
        )
    straighter = sum(
        frame is not other for frame, other in zip(frames, tracked.frames, strict=True)
    )
    if not straighter:
        return smoothed
    # the masks fit as well without, so readers of knee angles must know
    guess = f"straighter legs in {straighter} frames in which the person stands"
    scene = smoothed.scene
    scene = replace(scene, guesses=[*scene.guesses, guess])
    return smoothed._replace(scene=scene)


def track_hypotheses(
    scene: Scene,
    first: Task,
    method: Method,
    options: TrackOptions,
    recorder: Recorder,
    progress: Progress,
) -> list[Hypothesis]:
    """Return each hypothesis with all its frames.

    Each frame is recorded as it comes. Recorded frames are not tracked again.

    Args:
        scene: The scene.
        first: The task of the first hypothesis.
        method: The method that tracks it.
        options: The options of the track.
        recorder: Has the frames of an interrupted track, and gets the others.
        progress: Gets messages and warnings.
    """
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
            progress.log(f"continuing from frame {done} of {count}{of_several}")
            if _starts_over(method, frames):
                progress.warn(
                    f"{method.name} starts over at frame {done}: the frames from there"
                    " on may differ from an uninterrupted track"
                )
        elif not done and total > 1:
            progress.log(f"{which}: {hypothesis.guess}")
        if done < count:
            rng = stream(options.seed, "back", number)
            behind = list[Frame]()
            if pivot and not done:
                behind = _tracked_back(scene, hypothesis, method, pivot, rng, progress)
            ahead = (scene.observations[k] for k in range(done or pivot, count))
            steps = track_hypothesis(hypothesis, method, ahead, gap, behind)
            for frame in progress.steps(steps, count - done):
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
    """Yield the frames of one hypothesis in the order of time.

    The pivot is the first observation ahead. It is searched twice if there are frames
    behind: on the way back, and again on the way ahead. Its frame has the effort of
    both.

    Args:
        hypothesis: The hypothesis.
        method: The method that tracks it.
        ahead: The observations from the pivot on.
        gap: After this many frames without the person, all yaws are searched again.
        behind: The frames from the pivot back in time. They are yielded first.
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
    """Return the cheapest of several passes over a film, with the effort of all.

    With the track comes its smoothed version.
    """
    scene, frames, shape = smoothed
    usable = np.array([observation.usable for observation in scene.observations])

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        return progress.steps(method.follow(task, observations, rng), scene.count)

    for number in range(1, passes):
        direction = "back in time" if number % 2 else "onward"
        progress.log(f"tracking the {scene.count} frames again, {direction}")
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


class _Budget(NamedTuple):
    """How a track's evaluations per frame are divided."""

    passes: int  # how often the film is tracked
    evaluations: int  # of a frame in each pass
    polishing: int  # of a single picture after its search


def _budget(
    scene: Scene, method: Method, evaluations: int, options: TrackOptions
) -> _Budget:
    """Return how a track divides its evaluations per frame."""
    passes = _passes(scene, method, evaluations, bool(options.smooth))
    in_pass = evaluations // passes
    polishing = _polish_evaluations(scene, method, in_pass, options)
    return _Budget(passes, in_pass - polishing, polishing)


def _passes(scene: Scene, method: Method, evaluations: int, smoothed: bool) -> int:
    """Return how often a film is tracked.

    With several cameras, several passes are worthwhile: the cameras show which of two
    poses is right, but only once both are tried.
    """
    if len(scene.cameras) == 1 or scene.count < SHORTEST or scene.truth is not None:
        return 1
    if not method.looks_ahead or not smoothed:
        return 1
    return max(min(PASSES, evaluations // PASS_EVALUATIONS), 1)


def _evaluations(frames: Sequence[Frame]) -> int:
    return sum(frame.evaluations for frame in frames)


def _polish_evaluations(
    scene: Scene, method: Method, evaluations: int, options: TrackOptions
) -> int:
    """Return how many evaluations of one picture polish the result of the search."""
    alone = scene.count == 1 and scene.truth is None and options.smooth
    if not alone or method.prior is None or not next(iter(scene.observations)).usable:
        return 0
    return polish_evaluations(evaluations)


def _pivot(scene: Scene, task: Task, method: Method) -> int:
    """Return the frame that is tracked first.

    In footage, a tracker that looks ahead begins with the first frame that shows the
    whole person, unless more is known about the very first frame than its masks.
    """
    if scene.truth is not None or not method.looks_ahead:
        return 0
    usable = (observation for observation in scene.observations if observation.usable)
    first = next(usable, None)
    masks_yaw = None if first is None else first.yaw
    # any other yaw is of the very first frame: it was given, or restarts found it
    if task.yaw != masks_yaw:
        return 0
    return first_shown_whole(scene.observations)


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
    frames = method.follow(reversed_task(hypothesis.task), back, rng)
    return list(progress.steps(frames, pivot + 1))


def _hypothesis(
    number: int,
    scene: Scene,
    first: Task,
    options: TrackOptions,
    tracked: Sequence[Hypothesis],
    pivot: int,
) -> Hypothesis:
    """Return a hypothesis before its first frame.

    The guess of each hypothesis after the first one varies a frame of the first one.
    """
    if not tracked:
        return Hypothesis(SEARCHED, first, np.random.default_rng(options.seed))
    usable = (k for k in range(pivot, scene.count) if scene.observations[k].usable)
    estimate = tracked[0].frames[next(usable, 0)]
    guess, task = initial_guess(
        number, first, scene.yaw, options.first_pose == "given", estimate
    )
    return Hypothesis(guess, task, stream(options.seed, "hypothesis", number))


def _starts_over(method: Method, recorded: Sequence[Frame]) -> bool:
    """Return whether the method's state after recorded frames is lost.

    It is lost for a tracker, and for a filter with a state that cannot be recorded.
    """
    if method.prior is None:
        return True
    states = [frame.details[CARRIED] for frame in recorded if CARRIED in frame.details]
    return bool(states) and not states[-1]


def _resumed(
    hypothesis: Hypothesis, recorded: Sequence[Frame], state: dict[str, Any]
) -> Hypothesis:
    """Return a hypothesis that continues after recorded frames.

    Later frames have other sampled trajectories than the recorded ones.

    Args:
        hypothesis: The hypothesis before its first frame.
        recorded: The recorded frames.
        state: The state of the random generator after them.
    """
    hypothesis.rng.bit_generator.state = state
    frames = list[Frame]()
    for frame in recorded:
        if frame.posterior is not None:
            posterior = replace(frame.posterior, coherent=False)
            frame = replace(frame, posterior=posterior)
        frames.append(frame)
    pose = frames[-1].pose
    task = replace(
        hypothesis.task, yaw=float(pose[0]), first_pose=pose[3:], before=tuple(frames)
    )
    return replace(hypothesis, task=task, frames=frames)
