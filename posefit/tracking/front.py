"""`posefit.track` and `posefit.fit`: a source becomes a scene, the options are completed, and the scene is tracked."""

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import whole
from posefit.footage.scene import Scene
from posefit.footage.source import Source, check_used, kind_of, scene_of
from posefit.footage.training import training_clips, training_motions
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.progress import QUIET, Progress
from posefit.reading import quoted
from posefit.tracking.identity import ArgumentDigest
from posefit.tracking.method import resolved
from posefit.tracking.options import VIEW, TrackOptions, declared
from posefit.tracking.outputs import Output, OutputFolder
from posefit.tracking.pipeline import track_scene
from posefit.tracking.summary import Track
from posefit.version import __version__

_FILES = ("source", "train", "asf", "camera", "extraction")  # options that may name files, whose content counts


@dataclass(frozen=True, eq=False)
class Fit:
    """The estimated pose of one frame."""

    pose: Array = field(repr=False)  # (66,)
    translation: Array  # (3,) metres
    cost: float
    history: Array = field(repr=False)  # (populations,) best cost after each
    summary: dict[str, Any] = field(repr=False)


def track(
    source: Source | Scene | Sequence[Source] = "walk",
    *,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    rerun: str | Path | None = None,
    progress: Callable[[Iterator[Any], int], Iterator[Any]] | None = None,
    say: Callable[[str], None] | None = None,
    **options: Any,
) -> Track:
    """Return the motion tracked through a source's silhouettes, with its errors where the truth is known.

    `source` is a built-in motion's name, a recorded one's, a `Motion`, an .amc or .bvh file, a folder of mask images,
    an .npz of masks, a video, or several masks or videos that cameras took at the same time; or a `Scene` of a known
    motion, as it is. All other options are listed below, with the defaults that depend on the source in
    `posefit.tracking.method.resolved`.

    With `out`, a new folder gets poses, .amc, .bvh, .trc, .c3d, tables, a video and a picture; it appears whole or
    not at all. The frames of a track that ended too early are kept, and `resume` goes on from there. `rerun` is where a
    recording for the Rerun viewer goes. Raises InputError for every mistake in the arguments or files.
    """
    chosen = TrackOptions(**options)
    scene = source if isinstance(source, Scene) else None
    sources = _sources(source)
    if scene is not None and (given := [name for name in VIEW if getattr(chosen, name) != getattr(TrackOptions, name)]):
        raise InputError(f"a scene must be tracked as it is, got {', '.join(given)}")
    kind = kind_of(sources[0])
    check_used(kind, chosen.view)
    _check_truth(chosen, kind == "motion", [*sources, *chosen.train])
    if chosen.asf is not None and chosen.body_frames is None:
        chosen = chosen.changed(body_frames=0)
    chosen = resolved(sources[0], chosen)
    clips = training_clips(chosen.train, chosen.asf, followed=sources[0])  # before the work, as a name may be wrong
    if resume and out is None:
        raise InputError("resume must be given with out, the folder of the track that goes on, got none")
    if rerun is not None:
        from posefit.tracking.recording import check_recording

        check_recording(rerun)
    reporting = Progress(say or QUIET.log, progress or QUIET.steps)
    folder = Output()
    if out is not None:
        folder = OutputFolder(out, force, resume, _identity(sources, chosen, options.get("train", ())), reporting.log)
    with folder as output:
        scene = scene or scene_of(sources, reporting, **chosen.view)
        names = {
            "source": [each.name if isinstance(each, Motion) else str(each) for each in sources],
            "frames_chosen": list(chosen.frames),
            "view_degrees": options.get("view_degrees"),
        }
        training = training_motions(clips, scene.fps)
        result = track_scene(scene, training, chosen, output=output, progress=reporting, source=names)
        if rerun is not None:
            from posefit.tracking.recording import record

            record(rerun, scene, result.motion, result.estimates)
    return result


def fit(source: Source | Sequence[Source] = "walk", *, frame: int = 0, **options: Any) -> Fit:
    """Return the estimated pose of one frame of a source; options as for `track`, but for `frames`."""
    frame = whole("frame", frame, 0)
    result = track(source, frames=(frame, frame + 1), **options)
    history = np.array(result.summary.pop("history"))
    return Fit(result.motion.poses[0], result.motion.translations[0], result.measures.cost, history, result.summary)


def _sources(source: Source | Scene | Sequence[Source]) -> Sequence[Source]:
    if isinstance(source, Scene):
        if source.truth is None:
            raise InputError(f"a scene must be of a known motion, got {source.name}, whose truth is unknown")
        return [source.truth]
    return source if isinstance(source, Sequence) and not isinstance(source, str) else [source]


def _check_truth(options: TrackOptions, known: bool, motions: Sequence[Source]) -> None:
    """Return nothing. Raises InputError for options that do not fit a source whose truth is known, or unknown."""
    if not known:
        if options.translation == "known":
            raise InputError("translation must be searched or aligned where only masks are given, got known")
        if options.first_pose == "given":
            raise InputError("first_pose must be searched where only masks are given, got given")
        return
    captured = any(str(motion).lower().endswith(".amc") for motion in motions if isinstance(motion, str | Path))
    if options.asf is not None and not captured:
        raise InputError(f"asf must be given for .amc files and footage only, got {quoted(str(options.asf))}")
    if options.restarts == 0:
        raise InputError("restarts must be at least 1 for a motion, which is searched once where it is left out, got 0")


def _identity(sources: Sequence[Source], options: TrackOptions, train: Sequence[Source]) -> dict[str, ArgumentDigest]:
    """Return what a track must have in common with one that it goes on with."""
    values = {option.name: getattr(options, option.name) for option in fields(options) if declared(option).identifies}
    values |= {"source": sources, "train": train, "version": __version__}
    named = kind_of(sources[0]) == "motion" and sources[0] in built_in.names()  # a folder of that name is not read
    return {
        name: ArgumentDigest.of(value, files=name in _FILES and not (named and name == "source"))
        for name, value in values.items()
    }


def _documented(function: Callable[..., Any]) -> None:
    """Show the options of a track in a function's signature and docstring, as if it declared them itself."""
    own = [each for each in inspect.signature(function).parameters.values() if each.kind is not each.VAR_KEYWORD]
    listed = [option for option in fields(TrackOptions) if function is track or option.name != "frames"]
    more = [inspect.Parameter(option.name, inspect.Parameter.KEYWORD_ONLY, default=option.default) for option in listed]
    function.__signature__ = inspect.Signature([*own, *more])  # type: ignore[attr-defined]
    lines = "\n".join(f"    {option.name}: {declared(option).help}" for option in listed)
    function.__doc__ = f"{(function.__doc__ or '').rstrip()}\n\n    Options:\n{lines}\n"


_documented(track)
_documented(fit)
