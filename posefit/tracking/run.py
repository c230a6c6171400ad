"""A scene is followed with a method: what `posefit.track`, `posefit fit` and every cell of a sweep come to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.errors import InputError
from posefit.fitting.shape import NAMES, Shape
from posefit.fitting.tracker import Frame, Task, Tracker
from posefit.footage.scene import Scene, on_device
from posefit.geometry.skeleton import Skeleton
from posefit.listening import QUIET, Listener
from posefit.measuring.gait import gait_of
from posefit.measuring.heading import backwards, warned
from posefit.motion.motion import Motion
from posefit.searching.again import GAP, LOOKED, LookingTracker
from posefit.searching.anew import Anew, followed_anew
from posefit.searching.spent import spent_by_all
from posefit.searching.whirls import FASTEST
from posefit.steadying.passes import Pass, followed_again
from posefit.tracking.evaluation import LOST, Evaluation, unseen
from posefit.tracking.measures import Measures
from posefit.tracking.method import Method, prepare
from posefit.tracking.opening import following, opened, task_of
from posefit.tracking.options import TrackOptions
from posefit.tracking.outputs import Nowhere, Output
from posefit.tracking.tracks import (
    SEARCHED,
    Known,
    beginning,
    first_seen,
    generator,
    usual_speed,
    whole_cost,
)
from posefit.tracking.trust.evidence import trust_of
from posefit.uncertainty.modes import TrackMode, modes_of, track_modes
from posefit.version import __version__


@dataclass(frozen=True, eq=False)
class Track:
    """A followed motion and what it is worth."""

    motion: Motion  # the estimate
    truth: Motion | None = field(repr=False)
    measures: Measures
    frames: list[dict[str, float]] = field(repr=False)  # one row a frame: see posefit.tracking.measures.FRAME
    summary: dict[str, Any] = field(repr=False)  # what `posefit track --json` prints
    found: list[Frame] = field(repr=False)  # what the tracker yielded
    modes: list[TrackMode] = field(default_factory=list, repr=False)  # what the whole track may be, the likeliest first


def follow(
    scene: Scene,
    training: Sequence[Motion],
    options: TrackOptions | None = None,
    *,
    output: Output | None = None,
    listener: Listener = QUIET,
    source: Mapping[str, Any] | None = None,
) -> Track:
    """Return a scene's motion tracked by a method that learns from `training`, with its errors or signs of trust.

    `output` gets every frame as it comes and everything at the end; `source` is what the summary holds of where the
    scene is from. Raises InputError where something does not fit.
    """
    options = options or TrackOptions()
    seed, tracks, passes = options.seed, options.hypotheses, options.passes
    scene = on_device(scene, options.device)
    with threadpool_limits(1):  # an optimiser's matrices are small: BLAS is slower with more threads
        for warning in scene.warnings:
            listener.say(f"warning: {warning}")
        task = task_of(scene, options, training)
        smooth = scene.truth is None if options.smooth is None else options.smooth
        if smooth and task.translation == "known":
            raise InputError("smooth must be given where the translation is searched or aligned, got known")
        if passes > 1 and not smooth:
            raise InputError(f"passes must be 1 where a track is not smooth, got {passes}")
        method = prepare(options, task)
        task, shape = opened(scene, method, task, options, listener)
        scene = replace(scene, body=task.body)
        method.audit.clear()  # what was tried before the first frame is in no row
        output = output or Nowhere()
        known = Known(scene.yaw, options.first_pose == "given")
        usable = [observation.usable for observation in scene.observations] if tracks > 1 else []
        each = _found(scene, method, task, known, output, seed, tracks, usable, listener)
        found, told = _kept(scene, each, usable, training)
        anew = _without_whirls(scene, method, task, found, seed, listener)
        raw, found, kept_pass = anew.frames, anew.frames, 1
        task = replace(task, fastest_turn=None if anew.start is None else FASTEST)
        if smooth:
            begun = Pass.of(scene, found, shape, method.beta)
            make = partial(_tracker, method)
            passed, kept = followed_again(begun, task, make, passes, seed, method.beta, listener)
            scene, shape, kept_pass = passed[kept].scene, passed[kept].shape, kept + 1
            found = spent_by_all([one.told for one in passed], kept)
        found = [_moded(frame, scene.body.skeleton) for frame in found]
        modes = _whole(scene.body.skeleton, found)
        evaluation = Evaluation(scene, method.prior, task.angles, method.beta)
        for warning in method.audit.warnings:
            listener.say(f"warning: {warning}")
        for frame, observation in zip(found, scene.observations, strict=True):
            evaluation.add(frame, observation)
        rows, measures = evaluation.close()
        estimate = Motion(
            scene.name,
            scene.body.skeleton,
            np.array([frame.pose for frame in found]),
            np.array([frame.translation for frame in found]),
            scene.fps,
        )
        back = backwards(estimate, unseen(rows))
        warnings = [*scene.warnings, *method.audit.warnings]
        if scene.truth is None and (warning := warned(back)):
            listener.say(f"warning: {warning}")
            warnings.append(warning)
        summary = {
            "motion": scene.name,
            **(source or {}),
            "method": method.name,
            "seed": seed,
            "frames": len(found),
            **measures.as_dict(),
            **({"history": found[0].history.tolist()} if len(found) == 1 else {}),
            "evaluations_per_frame": task.evaluations,
            "dimensions": method.dimensions(task),
            "hypotheses": told,
            "version": __version__,
            "train": [motion.name for motion in training],
            "translation": task.translation,
            "first_pose": options.first_pose,
            "smooth": smooth,
            "passes": passes,
            "kept_pass": kept_pass,
            "views": len(scene.cameras),
            "camera": scene.placing,
            "size": [scene.cameras[0].width, scene.cameras[0].height],
            "fps": scene.fps,
            "settings": method.settings,
            "body": None if shape is None else _described(shape),
            "modes": [round(mode.weight, 6) for mode in modes] or None,
            "none_of_modes": _none_right(found),
            "unknown_sides": _numbers(rows, "unknown_sides", 1.0),
            "lost_frames": _numbers(rows, "lost", LOST),
            "looked_again": [k for k, frame in enumerate(found) if LOOKED in frame.details],
            "followed_anew": anew.start,
            "backwards_share": round(float(back.mean()), 6),
            "trust": None if scene.truth is not None else trust_of(scene, raw, found, rows, measures.iou),
            "gait": gait_of(estimate, unseen(rows)).as_dict(),
            "warnings": warnings,
        }
        output.finish(scene, estimate, found, rows, summary)
    return Track(estimate, scene.truth, measures, rows, summary, found, modes)


def _moded(frame: Frame, skeleton: Skeleton) -> Frame:
    """Return a frame with the modes of its posterior, where it has one."""
    return frame if frame.posterior is None else replace(frame, modes=modes_of(skeleton, frame.posterior))


def _alone(frame: Frame) -> Frame:
    """Return a frame whose posterior is its own: a track that goes on has no rows of the one that was interrupted."""
    posterior = frame.posterior
    return frame if posterior is None else replace(frame, posterior=replace(posterior, coherent=False))


def _whole(skeleton: Skeleton, found: Sequence[Frame]) -> list[TrackMode]:
    """Return the modes of a whole track; none where its frames' posteriors are no tracks."""
    each = [frame.posterior for frame in found if frame.posterior is not None and frame.posterior.coherent]
    alike = len(each) == len(found) and len({len(one) for one in each}) == 1
    return track_modes(skeleton, each) if alike else []


def _none_right(found: Sequence[Frame]) -> float | None:
    """Return how likely no mode of a frame is right, the mean over frames; None where nobody says."""
    learned = [frame.posterior.recalibration for frame in found if frame.posterior is not None]
    said = [one.none for one in learned if one is not None]
    return round(float(np.mean(said)), 6) if said else None


def _numbers(rows: Sequence[Mapping[str, float]], name: str, least: float) -> list[int] | None:
    """Return the frames that have so much in a column; None where it is blank in all."""
    if np.isnan([row[name] for row in rows]).all():
        return None
    return [int(row["frame"]) for row in rows if row[name] >= least]


def _found(
    scene: Scene,
    method: Method,
    task: Task,
    known: Known,
    output: Output,
    seed: int,
    tracks: int,
    usable: Sequence[bool],
    listener: Listener,
) -> list[tuple[str, list[Frame]]]:
    """Return how each track was begun, and what it found in all frames.

    Every frame is recorded as it comes, track after track; those that were found before stay as they are.
    """
    earlier, state = output.earlier()
    found: list[tuple[str, list[Frame]]] = []
    for number in range(tracks):
        begun, mine = SEARCHED, task
        if number:
            begun, mine = beginning(number, task, known, first_seen(found[0][1], usable))
        frames = list(earlier[number * scene.count : (number + 1) * scene.count])
        rng = generator(seed, number)
        which = f" of track {number + 1} of {tracks}, {begun}" if tracks > 1 else ""
        if state is not None and 0 < len(frames) < scene.count:
            rng.bit_generator.state = state
            frames = [_alone(frame) for frame in frames]
            listener.say(f"going on from frame {len(frames)} of {scene.count}{which}")
            last = frames[-1]
            mine = replace(mine, yaw=float(last.pose[0]), first_pose=last.pose[3:], before=tuple(frames))
        elif which and not frames:
            listener.say(f"track {number + 1} of {tracks}: {begun}")
        found.append((begun, frames))
        if len(frames) < scene.count:
            rest = (scene.observations[k] for k in range(len(frames), scene.count))
            for frame in listener.progress(_tracker(method, scene, mine).track(rest, rng), scene.count - len(frames)):
                output.record(frame, dict(rng.bit_generator.state))
                frames.append(frame)
    return found


def _tracker(method: Method, scene: Scene, task: Task) -> Tracker:
    """Return the method's tracker, which in footage looks all around again after gaps; not one that looks ahead."""
    tracker, gap = method.tracker(task), method.look_again
    if gap is None:
        gap = GAP if scene.truth is None and getattr(tracker, "lag", None) is None else 0
    return LookingTracker(task, following(method), gap) if gap else tracker


def _without_whirls(
    scene: Scene, method: Method, task: Task, found: list[Frame], seed: int, listener: Listener
) -> Anew:
    """Return a track of footage that was followed again where the body whirled, by a method that looks ahead."""
    if scene.truth is not None or getattr(method.tracker(task), "lag", None) is None:
        return Anew(found, None)
    told = followed_anew(task, scene.observations, found, following(method), seed)
    if told.start is not None:
        said = f"it was followed again, onward and backwards from frame {told.start}"
        listener.say(f"the body turned faster than anybody does: {said}")
    return told


def _kept(
    scene: Scene, found: Sequence[tuple[str, list[Frame]]], usable: Sequence[bool], training: Sequence[Motion]
) -> tuple[list[Frame], list[dict[str, Any]]]:
    """Return the frames of the track whose whole cost is least, and of several tracks what the summary says of each."""
    if len(found) == 1:
        return found[0][1], []
    usual = usual_speed(training)
    costs = [whole_cost(frames, usable, scene.body.skeleton, scene.fps, usual) for _, frames in found]
    kept = min(range(len(costs)), key=lambda k: costs[k].total)
    told = [
        {"beginning": begun, "cost": whole.cost, "motion": whole.motion, "kept": k == kept}
        for k, ((begun, _), whole) in enumerate(zip(found, costs, strict=True))
    ]
    return spent_by_all([frames for _, frames in found], kept), told


def _described(shape: Shape) -> dict[str, Any]:
    """Return a build as the summary gives it."""
    return {
        "stature": shape.body.stature,
        "cost": shape.cost,
        "factors": dict(zip(NAMES, shape.factors.tolist(), strict=True)),
        "spread": dict(zip(NAMES, shape.spread.tolist(), strict=True)),
    }
