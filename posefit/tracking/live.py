"""Tracks a person in frames as they arrive: `posefit track --live`."""

import json
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from itertools import islice
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.errors import InputError
from posefit.files import check_free
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.live import Stream, live_views
from posefit.footage.observations import Observations
from posefit.footage.pairing import calibrated
from posefit.footage.scene import Scene
from posefit.footage.source import FilmedBody, log_guesses
from posefit.footage.straightening import straightening
from posefit.footage.uses import check_used
from posefit.footage.views import View, concatenated
from posefit.motion.clips import training_clips, training_motions
from posefit.options import declared
from posefit.progress import QUIET, Progress
from posefit.tracking.defaults import completed
from posefit.tracking.initialise import initialise, task_of
from posefit.tracking.keywords import TrackKeywords
from posefit.tracking.method import method_names, prepare
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_hypothesis, with_notes
from posefit.tracking.restarts import SEARCHED, TRIAL_FRAMES, TRIAL_STRIDE
from posefit.tracking.trajectory import Hypothesis

# The default method. `exemplars` takes longer than a frame lasts, and looks ahead.
LIVE_METHOD = "sapso@pca"
FRAMES_FILE = "frames.jsonl"
POSES_FILE = "poses.npz"


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """A tracked frame of a stream."""

    number: int  # in the stream, skipped frames counted
    seconds: float  # from the first frame to this one
    latency: float  # seconds from the frame to its pose
    usable: bool  # whether it shows enough of the person; else its pose is held
    frame: Frame

    @property
    def row(self) -> dict[str, Any]:
        """The line of the frame in frames.jsonl."""
        return {
            "frame": self.number,
            "seconds": round(self.seconds, 4),
            "latency_ms": round(1e3 * self.latency, 2),
            "usable": self.usable,
            "cost": round(self.frame.cost, 4),
            "activity": self.frame.activity,
            "translation_m": np.round(self.frame.translation, 5).tolist(),
            "pose_degrees": np.round(np.degrees(self.frame.pose), 4).tolist(),
        }


def track_live(
    source: str = "-", *, progress: Progress = QUIET, **options: Unpack[TrackKeywords]
) -> Iterator[LiveFrame]:
    """Yield the tracked frames of a stream.

    If several frames arrive while one is tracked, all but the newest are skipped. The
    first second is buffered, to search the first pose.

    Args:
        source: The stream, as for `posefit.footage.live.Stream`.
        progress: Gets messages and warnings.
        **options: The options of `posefit.track`. The default method is `sapso@pca`.

    Yields:
        Each tracked frame, as soon as it is tracked.

    Raises:
        InputError: If an option is invalid or needs all frames, or the stream breaks
            off.

    Example:
        >>> import io
        >>> import sys
        >>> import posefit
        >>> from posefit.testing.tracker_rules import scene
        >>> _, _, observations = scene()
        >>> stream = b""
        >>> for observation in observations:
        ...     mask = observation.silhouettes[0].mask
        ...     header = b"P5 %d %d 255 " % (mask.shape[1], mask.shape[0])
        ...     stream += header + (255 * mask).astype("uint8").tobytes()
        >>> sys.stdin = io.TextIOWrapper(io.BytesIO(stream))  # as from a pipe
        >>> next(posefit.track_live("-", evaluations=200)).frame.pose.shape
        (66,)
        >>> sys.stdin = sys.__stdin__
    """
    chosen = TrackOptions(**options)
    for each in fields(chosen):
        value = getattr(chosen, each.name)
        if not declared(each).live and value != each.default:
            raise InputError(f"{each.name} must be left out with live, got {value}")
    # an extraction may choose a person too, and people are not distinguished live
    if chosen.extraction is not None and chosen.extraction.person is not None:
        person = chosen.extraction.person
        raise InputError(f"person must be left out with live, got {person}")
    if chosen.method is None or isinstance(chosen.method, str):
        chosen = chosen.changed(method=str(method_names(chosen.method or LIVE_METHOD)))
    chosen = completed(chosen.changed(body_frames=0, smooth=False), None)
    clips = training_clips(chosen.train, chosen.of_files)
    stream = Stream(source)
    views = live_views(stream, chosen.extraction, progress.log)
    first = list(islice(views, TRIAL_FRAMES * TRIAL_STRIDE))
    if chosen.fps is None:
        chosen = chosen.changed(fps=stream.rate)
    scene, observed = _scene_of(first, source, chosen)
    training = training_motions(clips, scene.fps)
    log_guesses(scene, progress)
    scene = with_notes(scene, training)
    for warning in scene.warnings:
        progress.warn(warning)
    waiting: deque[View] = deque()

    def coming() -> Iterator[Observation]:
        for live, observation in zip(first, scene.observations, strict=True):
            waiting.append(live)
            yield observation
        for live in views:
            waiting.append(live)
            yield observed(live)

    with threadpool_limits(1):
        task = task_of(scene, chosen, training)
        method = prepare(chosen, task)
        task = initialise(scene, method, task, chosen, progress).task
        hypothesis = Hypothesis(SEARCHED, task, np.random.default_rng(chosen.seed))
        for frame in track_hypothesis(
            hypothesis, method, coming(), method.relocalise_gap
        ):
            live = waiting.popleft()
            arrived = float(live.times[0])
            yield LiveFrame(
                int(live.numbers[0]),
                arrived - float(first[0].times[0]),
                time.perf_counter() - arrived,
                bool(live.usable[0]),
                frame,
            )


def _scene_of(
    first: Sequence[View], name: str, options: TrackOptions
) -> tuple[Scene, Callable[[View], Observation]]:
    """Return the scene of the first frames, and a function that observes later ones."""
    masks = not first or first[0].pictures is None
    check_used("masks" if masks else "pictures", options)
    if not any(view.usable[0] for view in first):
        raise InputError(
            f"{name}: expected a person in the first {len(first)} frames, got none"
        )
    given = calibrated(options.cameras, [None])
    view = concatenated(first)
    scene = replace(FilmedBody.of(options).seen([view], given, options), name=name)
    _, correction, _ = (
        straightening(given[0], view.size) if given else (None, None, None)
    )

    def observed(live: View) -> Observation:
        straight = live if correction is None else correction.of(live)
        return Observations([straight])[0]  # type: ignore[no-any-return]

    return scene, observed


def write_live(
    frames: Iterator[LiveFrame],
    out: str | Path | None = None,
    on_frame: Callable[[LiveFrame], None] | None = None,
) -> dict[str, Any]:
    """Follow a live track until its stream ends or Ctrl-C, and return a summary.

    Args:
        frames: The frames of the track.
        out: A new folder. It gets frames.jsonl, one line per frame as it comes, and at
            the end poses.npz. If the stream breaks off both are still written; before
            the first pose, the folder is removed again. None: nothing is written.
        on_frame: Called with each frame.

    Returns:
        The numbers of tracked and skipped frames, and quantiles of the latency in
        milliseconds, NaN without frames.

    Raises:
        InputError: If the folder exists, or the stream breaks off.
    """
    folder = None if out is None else Path(out)
    latencies = list[float]()
    last = -1
    check_free(folder)
    if folder is not None:
        folder.mkdir()
    path = Path(os.devnull) if folder is None else folder / FRAMES_FILE
    try:
        with path.open("w", encoding="utf-8") as lines:
            for live in frames:
                latencies.append(live.latency)
                last = live.number
                print(json.dumps(live.row), file=lines, flush=True)
                if on_frame is not None:
                    on_frame(live)
    except KeyboardInterrupt:
        pass
    finally:
        if folder is not None and not latencies:
            # without a pose nothing is left behind, so that the same command can be
            # repeated
            (folder / FRAMES_FILE).unlink(missing_ok=True)
            folder.rmdir()
        elif folder is not None:
            _write_poses(folder)
    median = slow = np.nan
    if latencies:
        median, slow = np.quantile(latencies, (0.5, 0.99)).tolist()
    return {
        "frames": len(latencies),
        "skipped": last + 1 - len(latencies),
        "latency_ms": {"p50": round(1e3 * median, 1), "p99": round(1e3 * slow, 1)},
    }


def _write_poses(folder: Path) -> None:
    """Write poses.npz from the lines of frames.jsonl."""
    text = (folder / FRAMES_FILE).read_text("utf-8")
    rows = [json.loads(line) for line in text.splitlines()]
    poses = np.radians([row["pose_degrees"] for row in rows])
    translations = np.array([row["translation_m"] for row in rows])
    # reshaped, because without rows both have a single axis
    np.savez_compressed(
        folder / POSES_FILE,
        frames=np.array([row["frame"] for row in rows], dtype=np.int64),
        seconds=np.array([row["seconds"] for row in rows]),
        poses=poses.reshape(-1, 66),
        translations=translations.reshape(-1, 3),
        usable=np.array([row["usable"] for row in rows], dtype=bool),
    )
