"""Fit one frame or follow a sequence, by names: what the command line does, as typed calls."""

import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from threadpoolctl import threadpool_limits

import posefit
from posefit.fitting.optimiser import OptimiserFactory
from posefit.fitting.prior import Prior
from posefit.fitting.space import Translation
from posefit.fitting.tracker import Frame, Observation, Task, Tracker, TrackerFactory
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.motion import library
from posefit.motion.motion import Motion
from posefit.study.evaluation import Evaluation
from posefit.study.method import Choice, prepare, training_angles
from posefit.study.source import Range, Scene, is_masks, motion_of, observed, synthetic
from posefit.study.writing import OutputFolder

Source = str | Path | Motion
PATIENCE = 1.5  # seconds of compiling before it is announced


@dataclass(frozen=True, eq=False)
class Track:
    """A followed motion and what it is worth."""

    motion: Motion  # the estimate
    truth: Motion | None = field(repr=False)
    frames: list[dict[str, float]] = field(repr=False)  # one row a frame: cost, IoU, errors
    summary: dict[str, Any] = field(repr=False)  # what `posefit track --json` prints


@dataclass(frozen=True, eq=False)
class Fit:
    """The pose found in one frame."""

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,) metres
    cost: float
    history: Array = field(repr=False)  # (populations,) best cost after each
    summary: dict[str, Any] = field(repr=False)


def track(
    source: Source = "walk",
    *,
    asf: str | Path | None = None,
    camera: Camera | str | Path | None = None,
    optimiser: str | OptimiserFactory = "sapso",
    prior: str | Prior = "pca",
    tracker: str | TrackerFactory | None = None,
    train: Sequence[Source] = (),
    view_degrees: float | None = None,
    size: tuple[int, int] = (320, 240),
    fps: float = 30.0,
    frames: Range = (None, None),
    particles: int | None = None,
    iterations: int | None = None,
    evaluations: int | None = None,
    translation: Translation | None = None,
    first_pose: Literal["searched", "given"] = "searched",
    seed: int = 0,
    threads: int = 1,
    ask_seconds: float | None = None,
    optimiser_settings: Mapping[str, Any] | None = None,
    prior_settings: Mapping[str, Any] | None = None,
    tracker_settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    progress: Callable[[Iterator[Frame], int], Iterator[Frame]] | None = None,
    say: Callable[[str], None] | None = None,
) -> Track:
    """Return the motion followed through a source's silhouettes, with its errors where the truth is known.

    `source` is a built-in motion's name, a `Motion`, an .amc or .bvh file, a folder of mask images or an .npz of masks.
    `train` names the motions a prior learns from; by default the other styles of a built-in motion, else the built-in
    walks. The method is `optimiser` with `prior`, or `tracker`. The budget of a frame is `evaluations`, by default
    particles x (iterations + 1) = 40 x 61, the same for every method. `translation` is "known" where the truth is, else
    "aligned". A `first_pose` that is "given" starts the first frame around the true one. `ask_seconds` is how long a
    plugin may take to propose a population. With `out`, a new folder gets the poses, an .amc, a table, a video and a
    picture; it appears whole or not at all. Raises ValueError for every mistake in the arguments or files.
    """
    say = say or _nothing
    choice = Choice(
        optimiser,
        prior,
        tracker,
        optimiser_settings or {},
        prior_settings or {},
        tracker_settings or {},
        particles,
        iterations,
        evaluations,
        ask_seconds,
    )
    budget = choice.budget()
    if view_degrees is not None and not np.isfinite(view_degrees):
        raise ValueError(f"view_degrees must be a finite number, got {view_degrees}")
    if not (np.isfinite(fps) and fps > 0.0):
        raise ValueError(f"fps must be a positive number, got {fps}")
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    folder = OutputFolder(out, force) if out is not None else None
    scene = _scene(source, asf, camera, view_degrees, size, fps, frames)
    trained = _training(source, train, asf, fps)
    mode: Translation = translation or ("known" if scene.truth is not None else "aligned")
    if mode == "known" and scene.truth is None:
        raise ValueError("translation must be searched or aligned where only masks are given, got known")
    if first_pose not in ("searched", "given"):
        raise ValueError(f"first_pose must be one of searched, given, got {first_pose!r}")
    task = Task(
        scene.body,
        scene.cameras,
        budget,
        scene.yaw,
        scene.anchor,
        translation=mode,
        fps=scene.fps,
        training=trained,
        first_pose=_first_pose(scene) if first_pose == "given" else None,
        threads=threads,
    )
    method = prepare(choice, task)
    evaluation = Evaluation(scene, method.prior, training_angles(task), method.beta)
    began = time.perf_counter()
    with _announced(say):
        _warm_up(method.warm_up, scene)
    say(f"ready in {time.perf_counter() - began:.1f} s; {scene.count} frames of {scene.name}")
    found: list[Frame] = []

    # the matrices of an optimiser are small: more than one thread of BLAS for them is slower than one
    with folder or nullcontext() as files, threadpool_limits(1):
        seen = _Tee(scene.observations)
        results = method.tracker.track(seen, np.random.default_rng(seed))
        for frame in progress(results, scene.count) if progress else results:
            row = evaluation.add(frame, seen.latest)
            if files is not None:
                files.picture(scene, frame, seen.latest, row)
            found.append(frame)
        estimate = Motion(
            scene.name,
            scene.body.skeleton,
            np.array([frame.pose for frame in found]),
            np.array([frame.translation for frame in found]),
            scene.fps,
        )
        rows, measured = evaluation.close()
        summary = {
            "motion": scene.name,
            "method": method.name,
            "seed": seed,
            "frames": len(found),
            **measured,
            "evaluations_per_frame": budget,
            "version": posefit.__version__,
            "train": [motion.name for motion in trained],
            "view_degrees": view_degrees,
            "translation": mode,
            "first_pose": first_pose,
            "size": [scene.cameras[0].width, scene.cameras[0].height],
            "fps": scene.fps,
            "settings": method.settings,
        }
        if files is not None:
            files.finish(estimate, found, rows, summary)
    return Track(estimate, scene.truth, rows, summary)


def fit(source: Source = "walk", *, frame: int = 0, **settings: Any) -> Fit:
    """Return the pose found in one frame of a source; settings as for `track`, but for `frames`."""
    if frame < 0:
        raise ValueError(f"frame must be 0 or more, got {frame}")
    result = track(source, frames=(frame, frame + 1), **settings)
    history = np.array(result.summary.pop("history"))
    row = result.frames[0]
    return Fit(result.motion.poses[0], result.motion.translations[0], row["cost"], history, result.summary)


def _scene(
    source: Source,
    asf: str | Path | None,
    camera: Camera | str | Path | None,
    view_degrees: float | None,
    size: tuple[int, int],
    fps: float,
    frames: Range,
) -> Scene:
    if min(size) < 1 or max(size) > 16_384:
        raise ValueError(f"size must be from 1x1 to 16384x16384 pixels, got {size[0]}x{size[1]}")
    if isinstance(camera, str | Path):
        camera = Camera.from_json(camera)
    if is_masks(source):
        from posefit.motion.asf import read_asf

        skeleton = library.average_skeleton() if asf is None else read_asf(asf)
        return observed(str(source), Body.of(skeleton), view_degrees, camera, fps, frames)
    return synthetic(motion_of(source, asf, fps), view_degrees, size, camera, frames)


def _training(source: Source, train: Sequence[Source], asf: str | Path | None, fps: float) -> list[Motion]:
    chosen: Sequence[Source] = train
    if not chosen:
        known = isinstance(source, str) and source in library.names()
        chosen = library.other_styles(str(source) if known else "walk")
    for one in chosen:
        if one is source or (
            not isinstance(one, Motion) and not isinstance(source, Motion) and str(one) == str(source)
        ):
            raise ValueError(f"train must not contain the source itself, got {one}")
    return [motion_of(one, asf, fps) for one in chosen]


def _first_pose(scene: Scene) -> Array:
    if scene.truth is None:
        raise ValueError("first_pose must be searched where only masks are given, got given")
    return scene.truth.poses[0, 3:]


def _warm_up(tracker: Tracker, scene: Scene) -> None:
    """Compile what is not compiled yet, on the first frame."""
    first = next(iter(scene.observations))
    next(tracker.track([first], np.random.default_rng(0)))


def _nothing(_: str) -> None:
    """Say nothing."""


@contextmanager
def _announced(say: Callable[[str], None]) -> Iterator[None]:
    """Say that compiling takes its time, if it does."""
    message = "compiling the kernels, once on this machine; this can take half a minute ..."
    timer = threading.Timer(PATIENCE, say, (message,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()  # it may be in the middle of saying it


class _Tee:
    """Passes observations on and remembers the latest."""

    latest: Observation

    def __init__(self, observations: Any) -> None:
        self._observations = observations

    def __iter__(self) -> Iterator[Observation]:
        for observation in self._observations:
            self.latest = observation
            yield observation
