"""`posefit.track` and `posefit.fit`: a source becomes a scene, the options are completed, and the scene is tracked."""

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeGuard

from posefit.errors import InputError
from posefit.fitting.check import whole
from posefit.fitting.driving import clocks
from posefit.footage.scene import Scene
from posefit.footage.source import (
    Footage,
    Resolved,
    check_used,
    first_of,
    resolve,
    scene_of,
)
from posefit.motion import built_in
from posefit.motion.clips import (
    Source,
    skeleton_file,
    training_clips,
    training_motions,
)
from posefit.motion.motion import Motion
from posefit.output.files import chosen_kinds
from posefit.output.folder import OutputFolder, Recorder
from posefit.output.identity import Digest, digest_of
from posefit.progress import Progress, interactive
from posefit.reading import quoted, suggestion
from posefit.tracking.defaults import completed
from posefit.tracking.options import VIEW, TrackOptions, declared
from posefit.tracking.pipeline import track_scene
from posefit.tracking.result import Fit, Track
from posefit.version import __version__

_ARGUMENTS = (
    "out",
    "force",
    "resume",
    "write",
    "progress",
)  # of a track, besides its options
# options that may name files, whose content counts
_FILES = ("source", "train", "asf", "camera", "extraction")


def track(
    source: Footage | Scene | Resolved | Sequence[Any] = "walk",
    *,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    write: str | Sequence[str] = (),
    progress: Progress | None = None,
    **options: Any,
) -> Track:
    """Return the motion tracked through a source's silhouettes, with its errors where the truth is known.

    `source` is masks, an array (T, H, W), a list of image files, a folder of them, or an .npz or .npy file; a video; a
    list of any of these, that several cameras took at the same time, such as two lists of image files; a built-in
    motion's name, a recorded one's, a `Motion`, an .amc or .bvh file; or a `Scene` of a known motion, as it is.
    Other options are listed below; `posefit.tracking.defaults.completed` has the defaults that depend on the source.

    With `out`, a new folder gets poses, .amc, .bvh, .trc, .c3d, tables, a video and a picture; it appears whole or
    not at all. `write` chooses some of these files, such as "bvh,trc" or ["bvh", "trc"]. The frames of a track that
    ended too early are kept, and `resume` goes on from there. Messages and bars go to `progress`, by default a terminal
    or a notebook. Raises InputError for any mistake in the arguments or files.
    """
    _check_names("track", options, [option.name for option in fields(TrackOptions)])
    chosen = TrackOptions(**options)
    scene = source if isinstance(source, Scene) else None
    resolved = _resolved(source)
    changed = [
        name for name in VIEW if getattr(chosen, name) != getattr(TrackOptions, name)
    ]
    if scene is not None and changed:
        raise InputError(f"a scene must be tracked as it is, got {', '.join(changed)}")
    check_used(resolved.medium, chosen.view)
    known = resolved.medium == "motion"
    _check_for_kind(chosen, known, [*resolved.named, *chosen.train])
    named = resolved.named[0]
    followed = named if isinstance(named, str | Path | Motion) else None
    chosen = completed(chosen, followed if known else None)
    # before the work, as a name may be wrong
    clips = training_clips(chosen.train, chosen.of_files, followed=followed)
    kinds = chosen_kinds(write)
    for name, value in (("resume", resume), ("force", force), ("write", len(write))):
        if value and out is None:
            raise InputError(
                f"{name} must be given with out, the folder of the track, got none"
            )
    progress = progress or interactive()
    recorder = Recorder()
    if out is not None:
        recorder = OutputFolder(
            out,
            force,
            resume,
            _identity(resolved, chosen, options.get("train", ())),
            progress.log,
            kinds,
        )
    with recorder:
        with progress.phase("masks"):
            start = clocks()
            scene = scene or scene_of(resolved, progress, **chosen.view)
            # a known motion is drawn frame by frame, as it is tracked
            if scene.truth is None:
                seconds, cpu_seconds = (clocks() - start).tolist()
                scene = replace(scene, reading_seconds=(seconds, cpu_seconds))
        recorder.begin(scene)
        training = training_motions(clips, scene.fps)
        track = track_scene(
            scene, training, chosen, recorder=recorder, progress=progress
        )
        # numbers of Python, whatever kind they were given as
        view_degrees = list(chosen.view_degrees) or None  # type: ignore[arg-type]
        setup = replace(
            track.setup,
            source=list(resolved.names),
            frames_chosen=list(chosen.frames),
            view_degrees=view_degrees,
        )
        track = replace(track, setup=setup)
        with progress.phase("write"):
            recorder.finish(track.content)
        return track


def fit(
    source: Footage | Sequence[Any] = "walk",
    *,
    frame: int | None = None,
    **options: Any,
) -> Fit:
    """Return the estimated pose of one frame of a source, or of a mask (H, W); options as for `track`, but `frames`.

    The frame has its number as filmed, of a motion that after resampling; by default it is the first.
    """
    known = [option.name for option in fields(TrackOptions) if option.name != "frames"]
    _check_names("fit", options, [*_ARGUMENTS, *known])
    if frame is None:
        frame = first_of(_resolved(source))
    frame = whole("frame", frame, 0)
    return track(source, frames=(frame, frame + 1), **options).frame(0)


def _check_names(function: str, options: Iterable[str], known: Sequence[str]) -> None:
    """Raise TypeError for an option that a function does not have."""
    if unknown := [name for name in options if name not in known]:
        hint = suggestion(unknown[0], known)
        raise TypeError(f"{function} has no option {unknown[0]!r}{hint}")


def _resolved(source: Footage | Scene | Resolved | Sequence[Any]) -> Resolved:
    """Return what a source is; of a scene, its motion."""
    if not isinstance(source, Scene):
        return resolve(source)
    if source.truth is None:
        raise InputError(
            f"a scene must be of a known motion, got {source.name}, whose truth is unknown"
        )
    return resolve(source.truth)


def _check_for_kind(
    options: TrackOptions, known: bool, motions: Sequence[Footage]
) -> None:
    """Raise InputError for an option of motions' files or of a known truth where there is no such thing."""
    captured = any(map(_is_captured, motions))
    folders = any(
        Path(motion).is_dir()
        for motion in options.train
        if isinstance(motion, str | Path)
    )
    if options.rate is not None and not (captured or folders):
        raise InputError(
            f"rate must be given for .amc files only, got {quoted(options.rate)}"
        )
    if not known:
        if options.translation == "known":
            raise InputError(
                "translation must be searched or aligned where only masks are given, got known"
            )
        if options.first_pose == "given":
            raise InputError(
                "first_pose must be searched where only masks are given, got given"
            )
        return
    if options.asf is not None and not captured:
        raise InputError(
            f"asf must be given for .amc files and footage only, got {quoted(str(options.asf))}"
        )


def _is_captured(motion: Footage) -> TypeGuard[str | Path]:
    """Return whether a motion is an .amc file, whose skeleton is in another file."""
    return isinstance(motion, str | Path) and str(motion).lower().endswith(".amc")


def _identity(
    source: Resolved, options: TrackOptions, train: Sequence[Source]
) -> dict[str, Digest]:
    """Return what a track must have in common with one that it goes on with."""
    values = {
        option.name: getattr(options, option.name)
        for option in fields(options)
        if declared(option).identifies
    }
    values |= {"source": source.named, "train": train, "version": __version__}
    # the skeleton beside an .amc counts as if it were given
    if beside := [
        skeleton_file(Path(motion), options.asf)
        for motion in (*source.named, *options.train)
        if isinstance(motion, str | Path) and _is_captured(motion)
    ]:
        values["asf"] = beside
    # a folder of that name is not read
    named = source.medium == "motion" and source.named[0] in built_in.names()
    return {
        name: digest_of(
            value, files=name in _FILES and not (named and name == "source")
        )
        for name, value in values.items()
    }


def _documented(function: Callable[..., Any]) -> None:
    """Show the options of a track in a function's signature and docstring, as if it declared them itself."""
    parameters = [
        each
        for each in inspect.signature(function).parameters.values()
        if each.kind is not each.VAR_KEYWORD
    ]
    listed = [
        option
        for option in fields(TrackOptions)
        if function is track or option.name != "frames"
    ]
    kind = inspect.Parameter.KEYWORD_ONLY
    more = [
        inspect.Parameter(
            option.name, kind, default=option.default, annotation=option.type
        )
        for option in listed
    ]
    function.__signature__ = inspect.Signature([*parameters, *more])  # type: ignore[attr-defined]
    lines = "\n".join(
        f"    {option.name}: {declared(option).help}" for option in listed
    )
    function.__doc__ = f"{(function.__doc__ or '').rstrip()}\n\n    Options:\n{lines}\n"


_documented(track)
_documented(fit)
