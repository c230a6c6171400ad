"""Fit one frame or follow a sequence, by names: what the command line does, as typed calls."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from threadpoolctl import threadpool_limits

import posefit
from posefit.arrays import Array
from posefit.fitting.optimiser import OptimiserFactory
from posefit.fitting.prior import Prior
from posefit.fitting.shape import NAMES, Shape
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Frame, Task, TrackerFactory
from posefit.footage.masks import Range
from posefit.footage.scenes import Source, Viewing, scene
from posefit.footage.segmentation import Extraction
from posefit.footage.source import FPS, Scene, kind_of, motion_of
from posefit.geometry.calibration import Up
from posefit.geometry.camera import Camera
from posefit.motion import library
from posefit.motion.motion import Motion
from posefit.tracking.evaluation import Evaluation
from posefit.tracking.method import Choice, prepare, training_angles
from posefit.tracking.opening import Opening, opened
from posefit.tracking.outputs import Nowhere, Output, OutputFolder

_MAY_DIFFER = ("out", "force", "resume", "rerun", "progress", "say", "threads")  # between a track and its resumption


@dataclass(frozen=True, eq=False)
class Track:
    """A followed motion and what it is worth."""

    motion: Motion  # the estimate
    truth: Motion | None = field(repr=False)
    frames: list[dict[str, float]] = field(repr=False)  # one row a frame: cost, IoU, errors
    summary: dict[str, Any] = field(repr=False)  # what `posefit track --json` prints
    found: list[Frame] = field(repr=False)  # what the tracker yielded


@dataclass(frozen=True, eq=False)
class Fit:
    """The pose found in one frame."""

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,) metres
    cost: float
    history: Array = field(repr=False)  # (populations,) best cost after each
    summary: dict[str, Any] = field(repr=False)


def track(
    source: Source | Scene | Sequence[Source] = "walk",
    *,
    asf: str | Path | None = None,
    camera: Camera | str | Path | Sequence[Camera | str | Path] | None = None,
    optimiser: str | OptimiserFactory = "sapso",
    prior: str | Prior | None = None,
    tracker: str | TrackerFactory | None = None,
    train: Sequence[Source] = (),
    view_degrees: float | Sequence[float] | None = None,
    size: tuple[int, int] = (320, 240),
    fps: float | None = None,
    frames: Range = (None, None),
    particles: int | None = None,
    iterations: int | None = None,
    evaluations: int | None = None,
    translation: Translation | None = None,
    first_pose: Literal["searched", "given"] = "searched",
    restarts: int | None = None,
    body_frames: int | None = None,
    height: float | None = None,
    extraction: Extraction | None = None,
    up: Up | None = None,
    seed: int = 0,
    threads: int = 1,
    ask_seconds: float | None = None,
    optimiser_settings: Mapping[str, Any] | None = None,
    prior_settings: Mapping[str, Any] | None = None,
    tracker_settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    rerun: str | Path | None = None,
    progress: Callable[[Iterator[Any], int], Iterator[Any]] | None = None,
    say: Callable[[str], None] | None = None,
) -> Track:
    """Return the motion followed through a source's silhouettes, with its errors where the truth is known.

    `source` is a built-in motion's name, a `Motion`, an .amc or .bvh file, a folder of mask images, an .npz of masks, a
    video, or several masks or videos that cameras took at the same time; or a `Scene` of a known motion, as it is.
    `train` names the motions a prior learns from; by default the other styles of a built-in motion, else the built-in
    walks. The method is `optimiser` with `prior`, or `tracker`. The budget of a frame is `evaluations`, by default
    particles x (iterations + 1) = 40 x 61, the same for every method. `translation` is "known" where the truth is, else
    "aligned". A `first_pose` that is "given" starts the first frame around the true one. `ask_seconds` is how long a
    plugin may take to propose a population.

    Where the truth is known the prior is `pca`. Where it is not it is `loose`, the first frame is searched `restarts`
    times (8), and the person's build is fitted to `body_frames` (30; none where an .asf is given), as tall as `height`
    says. `view_degrees` gives where the camera stands, several of them several cameras; `camera` is a camera or a
    calibration, one a view, in whose world `up` points up; `extraction` is how masks are taken from video.

    With `out`, a new folder gets poses, .amc, .bvh, .trc, tables, a video and a picture; it appears whole or not at
    all. What was found when a track ended too early is kept, and `resume` goes on from there. `rerun` is where a
    recording for the Rerun viewer goes. Raises ValueError for every mistake in the arguments or files.
    """
    arguments = {name: repr(value) for name, value in sorted(locals().items()) if name not in _MAY_DIFFER}
    say = say or _nothing
    prepared = source if isinstance(source, Scene) else None
    sources = _sources(source)
    viewing = Viewing(
        asf,
        () if camera is None else (camera,) if isinstance(camera, Camera | str | Path) else tuple(camera),
        () if view_degrees is None else np.atleast_1d(view_degrees).astype(float).tolist(),
        size,
        fps,
        frames,
        extraction or Extraction(),
        height,
        up,
    )
    choice = Choice(
        optimiser,
        prior or prior_of(sources[0]),
        tracker,
        optimiser_settings or {},
        prior_settings or {},
        tracker_settings or {},
        particles,
        iterations,
        evaluations,
        ask_seconds,
    )
    choice.budget()
    if body_frames is None and asf is not None:
        body_frames = 0
    opening = Opening(kind_of(sources[0]) != "motion", translation, first_pose, restarts, body_frames, height)
    trained = _training(sources, train, asf, FPS)  # before the work, as a name may be wrong
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    if resume and out is None:
        raise ValueError("resume must be given with out, the folder of the track that goes on, got none")
    if rerun is not None:
        from posefit.tracking.recording import check_recording

        check_recording(rerun)
    folder = (
        Nowhere()
        if out is None
        else OutputFolder(out, force, resume, {**arguments, "version": posefit.__version__}, say)
    )
    with folder as output, threadpool_limits(1):  # an optimiser's matrices are small: BLAS is slower with more threads
        seen, warnings = scene(sources if prepared is None else prepared, viewing, output.work, progress, say)
        for warning in warnings:
            say(f"warning: {warning}")
        if seen.fps != FPS:
            trained = _training(sources, train, asf, seen.fps)
        task, shape = opened(seen, choice, opening, trained, seed, threads, say)
        seen = replace(seen, body=task.body)
        method = prepare(choice, task)
        found = _followed(seen, choice, task, output, seed, progress, say)
        evaluation = Evaluation(seen, method.prior, training_angles(task), method.beta)
        for frame, observation in zip(found, seen.observations, strict=True):
            evaluation.add(frame, observation)
        rows, measured = evaluation.close()
        estimate = Motion(
            seen.name,
            seen.body.skeleton,
            np.array([frame.pose for frame in found]),
            np.array([frame.translation for frame in found]),
            seen.fps,
        )
        summary = {
            "motion": seen.name,
            "source": [one.name if isinstance(one, Motion) else str(one) for one in sources],
            "frames_chosen": list(frames),
            "method": method.name,
            "seed": seed,
            "frames": len(found),
            **measured,
            "evaluations_per_frame": task.evaluations,
            "version": posefit.__version__,
            "train": [motion.name for motion in task.training],
            "view_degrees": view_degrees,
            "translation": task.translation,
            "first_pose": first_pose,
            "views": len(seen.cameras),
            "camera": "given" if viewing.cameras else "guessed" if seen.truth is None else "placed",
            "size": [seen.cameras[0].width, seen.cameras[0].height],
            "fps": seen.fps,
            "settings": method.settings,
            "body": None if shape is None else _described(shape),
            "warnings": warnings,
        }
        output.finish(seen, estimate, found, rows, summary)
        if rerun is not None:
            from posefit.tracking.recording import record

            record(rerun, seen, estimate)
    return Track(estimate, seen.truth, rows, summary, found)


def _sources(source: Source | Scene | Sequence[Source]) -> Sequence[Source]:
    if isinstance(source, Scene):
        if source.truth is None:
            raise ValueError(f"a scene must be of a known motion, got {source.name}, whose truth nobody knows")
        return [source.truth]
    return source if isinstance(source, Sequence) and not isinstance(source, str) else [source]


def prior_of(source: Source) -> str:
    """Return the prior that a source is followed with by default."""
    return "pca" if kind_of(source) == "motion" else "loose"


def _followed(
    seen: Scene,
    choice: Choice,
    task: Task,
    output: Output,
    seed: int,
    progress: Callable[[Iterator[Any], int], Iterator[Any]] | None,
    say: Callable[[str], None],
) -> list[Frame]:
    """Return what is found in all frames, each recorded as it comes; those that were found before stay as they are."""
    found, state = output.earlier()
    rng = np.random.default_rng(seed)
    if state is not None:
        rng.bit_generator.state = state
        say(f"going on from frame {len(found)} of {seen.count}")
        last = found[-1]
        task = replace(task, yaw=float(last.pose[0]), anchor=task.anchor, first_pose=last.pose[3:], before=tuple(found))
    rest = (seen.observations[k] for k in range(len(found), seen.count))
    results = prepare(choice, task).tracker.track(rest, rng) if len(found) < seen.count else iter(())
    for frame in progress(results, seen.count - len(found)) if progress else results:
        output.record(frame, dict(rng.bit_generator.state))
        found.append(frame)
    return found


def _described(shape: Shape) -> dict[str, Any]:
    """Return a build as the summary gives it."""
    return {
        "stature": shape.body.stature,
        "cost": shape.cost,
        "factors": dict(zip(NAMES, shape.factors.tolist(), strict=True)),
        "spread": dict(zip(NAMES, shape.spread.tolist(), strict=True)),
    }


def fit(source: Source | Sequence[Source] = "walk", *, frame: int = 0, **settings: Any) -> Fit:
    """Return the pose found in one frame of a source; settings as for `track`, but for `frames`."""
    if frame < 0:
        raise ValueError(f"frame must be 0 or more, got {frame}")
    result = track(source, frames=(frame, frame + 1), **settings)
    history = np.array(result.summary.pop("history"))
    row = result.frames[0]
    return Fit(result.motion.poses[0], result.motion.translations[0], row["cost"], history, result.summary)


def _training(sources: Sequence[Source], train: Sequence[Source], asf: str | Path | None, fps: float) -> list[Motion]:
    source, chosen = sources[0], train
    if not chosen:
        known = isinstance(source, str) and source in library.names()
        chosen = library.other_styles(str(source) if known else "walk")
    for one in chosen:
        if one is source or (
            not isinstance(one, Motion) and not isinstance(source, Motion) and str(one) == str(source)
        ):
            raise ValueError(f"train must not contain the source itself, got {one}")
    return [motion_of(one, asf, fps) for one in chosen]


def _nothing(_: str) -> None:
    """Say nothing."""
