"""The frames of every hypothesis, by the method's own tracker; and the cheapest of them, tracked again if it spins."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from posefit.fitting.tracker import Frame, Task, Tracker
from posefit.footage.scene import Scene
from posefit.progress import Progress
from posefit.tracking.initialise import Guess
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions
from posefit.tracking.outputs import Output
from posefit.tracking.restarts import GAP, SEARCHED, RelocalisingTracker, initial_guess, retrack_spins, stream
from posefit.tracking.trajectory import trajectory_cost, typical_speed, with_total_effort

Hypothesis = tuple[str, list[Frame]]  # a track from one initial guess, and what that is called


@dataclass(frozen=True, eq=False)
class Tracked:
    """The track that is kept of several, with the effort of all."""

    frames: list[Frame] = field(repr=False)
    hypotheses: list[dict[str, Any]]  # of each of several: its initial guess, cost and motion term, and whether kept
    start: int | None  # the frame from which it was tracked again because it spun


def follow(guess: Guess, method: Method, options: TrackOptions, output: Output, progress: Progress) -> list[Hypothesis]:
    """Return the frames of each hypothesis. Each is recorded as it comes; recorded ones are not tracked again."""
    earlier, state = output.earlier()
    scene, count, total = guess.scene, guess.scene.count, options.hypotheses
    hypotheses: list[Hypothesis] = []
    for number in range(total):
        name, task = SEARCHED, guess.task
        if number:
            first = _first_usable(scene, hypotheses[0][1])
            name, task = initial_guess(number, task, scene.yaw, options.first_pose == "given", first)
        frames = list(earlier[number * count : (number + 1) * count])
        rng = stream(options.seed, "hypothesis", number) if number else np.random.default_rng(options.seed)
        which = f" of track {number + 1} of {total}, {name}" if total > 1 else ""
        if state is not None and 0 < len(frames) < count:
            rng.bit_generator.state = state
            frames = [_without_trajectory(frame) for frame in frames]
            progress.log(f"going on from frame {len(frames)} of {count}{which}")
            last = frames[-1]
            task = replace(task, yaw=float(last.pose[0]), first_pose=last.pose[3:], before=tuple(frames))
        elif which and not frames:
            progress.log(f"track {number + 1} of {total}: {name}")
        hypotheses.append((name, frames))
        if len(frames) < count:
            rest = (scene.observations[k] for k in range(len(frames), count))
            for frame in progress.steps(tracker_of(method, scene, task).track(rest, rng), count - len(frames)):
                output.record(frame, dict(rng.bit_generator.state))
                frames.append(frame)
    return hypotheses


def tracker_of(method: Method, scene: Scene, task: Task) -> Tracker:
    """Return the method's tracker; in footage it relocalises after gaps, unless it looks ahead."""
    tracker, gap = method.tracker(task), method.relocalise_gap
    if gap is None:
        gap = GAP if scene.truth is None and getattr(tracker, "lag", None) is None else 0
    return RelocalisingTracker(task, method.follow, gap) if gap else tracker


def retrack(
    guess: Guess, method: Method, hypotheses: Sequence[Hypothesis], options: TrackOptions, progress: Progress
) -> Tracked:
    """Return the cheapest hypothesis, tracked again where footage spins under a method that looks ahead."""
    scene, task = guess.scene, guess.task
    frames, table = _cheapest(scene, hypotheses, task)
    if scene.truth is not None or getattr(method.tracker(task), "lag", None) is None:
        return Tracked(frames, table, None)
    frames, start = retrack_spins(task, scene.observations, frames, method.follow, options.seed)
    if start is not None:
        progress.log(f"the body turned faster than a person can: tracked again, both ways from frame {start}")
    return Tracked(frames, table, start)


def _cheapest(scene: Scene, hypotheses: Sequence[Hypothesis], task: Task) -> tuple[list[Frame], list[dict[str, Any]]]:
    """Return the frames of the hypothesis whose trajectory costs least, and of several what the summary holds."""
    if len(hypotheses) == 1:
        return hypotheses[0][1], []
    usable, speed = [observation.usable for observation in scene.observations], typical_speed(task.training)
    tracks = [frames for _, frames in hypotheses]
    costs = [trajectory_cost(frames, usable, scene.body.skeleton, scene.fps, speed) for frames in tracks]
    kept = min(range(len(costs)), key=lambda k: costs[k].total)
    table = [
        {"guess": guess, "cost": cost.cost, "motion": cost.motion, "kept": k == kept}
        for k, ((guess, _), cost) in enumerate(zip(hypotheses, costs, strict=True))
    ]
    return with_total_effort(tracks, kept), table


def _first_usable(scene: Scene, frames: Sequence[Frame]) -> Frame:
    """Return the first frame of a track that shows enough of the person; where none does, the first one."""
    shown = (frame for frame, observation in zip(frames, scene.observations, strict=True) if observation.usable)
    return next(shown, frames[0])


def _without_trajectory(frame: Frame) -> Frame:
    """Return a frame whose posterior is its own: a track that goes on has other trajectories than the earlier one."""
    posterior = frame.posterior
    return frame if posterior is None else replace(frame, posterior=replace(posterior, coherent=False))
