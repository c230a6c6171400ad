"""The functions `posefit.track` and `posefit.fit`.

They complete the options, make a scene from the source, and track it.
"""

import inspect
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, TypeGuard, Unpack

from posefit.errors import InputError
from posefit.fitting.check import whole
from posefit.fitting.driving import clocks
from posefit.footage.extraction import Extraction
from posefit.footage.kinds import Resolved, first_of, resolve
from posefit.footage.named import OneSource
from posefit.footage.options import SourceOptions
from posefit.footage.scene import Scene
from posefit.footage.source import scene_of
from posefit.footage.uses import check_used
from posefit.limits import trim_memory
from posefit.motion import built_in
from posefit.motion.clips import (
    Source,
    skeleton_file,
    training_clips,
    training_motions,
)
from posefit.motion.motion import Motion
from posefit.options import declared
from posefit.output.files import chosen_kinds
from posefit.output.folder import OutputFolder, Recorder
from posefit.output.identity import Digest, digest_of
from posefit.progress import Progress, interactive
from posefit.reading import quoted, suggestion
from posefit.registry import registry, version_of
from posefit.tracking.defaults import completed
from posefit.tracking.keywords import FitKeywords, TrackKeywords
from posefit.tracking.method import offers_of
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit.tracking.result import Fit, Track

# the arguments of a track that are not fields of TrackOptions
_ARGUMENTS = ("out", "force", "resume", "write", "progress")
DOCSTRING_WIDTH = 84  # columns of a described option, 88 in an indented docstring
# options that may name files, which are compared by content
_FILES = ("source", "train", "asf", "camera", "extraction")


def track(
    source: OneSource | Scene | Resolved | Sequence[Any] = "walk",
    *,
    out: str | Path | None = None,
    force: bool = False,
    resume: bool = False,
    write: str | Sequence[str] = (),
    progress: Progress | None = None,
    **options: Unpack[TrackKeywords],
) -> Track:
    """Track a person through a source's silhouettes.

    The defaults that depend on the source are in `posefit.tracking.defaults.completed`.

    Args:
        source: What is tracked. Footage is masks as an array (T, H, W), a list of image
            files, a folder of them, or an .npz or .npy file; or a video; or a list of
            any of these, one for each of several cameras that filmed at the same time.
            A known motion is the name of a built-in or recorded motion, a `Motion`, an
            .amc or .bvh file, or a `Scene`, which is tracked as it is.
        out: A new folder for poses, .amc, .bvh, .trc, .c3d, tables, a video and a
            picture. It appears only when it is complete. By default nothing is written.
        force: Whether earlier results in `out` are replaced.
        resume: Whether to continue an interrupted track, whose frames were kept.
        write: The files to write, such as "bvh,trc" or ["bvh", "trc"]; by default all.
        progress: Receives messages and progress bars; by default they go to the
            terminal or the notebook.
        options: The options that follow.

    Returns:
        The track, with its errors if the truth is known.

    Raises:
        InputError: There is a mistake in the arguments or files.

    Example:
        >>> import posefit
        >>> track = posefit.track("walk", frames=(0, 3), evaluations=400)
        >>> track.joints.shape
        (3, 27, 3)
    """
    _check_names("track", options, [option.name for option in fields(TrackOptions)])
    chosen = TrackOptions(**options)
    scene = source if isinstance(source, Scene) else None
    resolved = _resolved(source)
    if scene is not None:
        _check_no_source_options(chosen)
    check_used(resolved.medium, chosen)
    is_motion = resolved.medium == "motion"
    _check_for_kind(chosen, is_motion, [*resolved.named, *chosen.train])
    named = resolved.named[0]
    followed = named if isinstance(named, str | Path | Motion) else None
    chosen = completed(chosen, followed if is_motion else None)
    # before the work, because a name may be wrong
    clips = training_clips(chosen.train, chosen.of_files, followed=followed)
    kinds = chosen_kinds(write)
    for name, value in (("resume", resume), ("force", force), ("write", len(write))):
        if value and out is None:
            raise InputError(f"{name} needs out, the folder of the track, got none")
    progress = progress or interactive()
    recorder = Recorder()
    if out is not None:
        identity = _identity(resolved, chosen, options.get("train", ()))
        recorder = OutputFolder(out, force, resume, identity, progress.log, kinds)
    with recorder:
        with progress.phase("masks"):
            scene = scene or _read_scene(resolved, chosen, progress)
        recorder.begin(scene)
        training = training_motions(clips, scene.fps)
        track = track_scene(
            scene, training, chosen, recorder=recorder, progress=progress
        )
        setup = replace(
            track.setup,
            source=list(resolved.names),
            frames_chosen=list(chosen.frames),
            view_degrees=list(chosen.degrees) or None,
        )
        track = replace(track, setup=setup)
        with progress.phase("write"):
            recorder.finish(track.content)
        return track


def fit(
    source: OneSource | Sequence[Any] = "walk",
    *,
    frame: int | None = None,
    **options: Unpack[FitKeywords],
) -> Fit:
    """Estimate the pose in one frame.

    Args:
        source: As for `track`, or one mask (H, W).
        frame: The frame's number, as filmed or, for a motion, after resampling; by
            default the first.
        options: `out` and the other arguments of `track`, and the options that follow.

    Returns:
        The pose and its track of one frame.

    Raises:
        InputError: There is a mistake in the arguments or files.

    Example:
        >>> import posefit
        >>> fit = posefit.fit("walk", frame=10, evaluations=400)
        >>> fit.pose.shape, fit.translation.shape
        ((66,), (3,))
    """
    known = [option.name for option in fields(TrackOptions) if option.name != "frames"]
    _check_names("fit", options, [*_ARGUMENTS, *known])
    if frame is None:
        frame = first_of(_resolved(source), options.get("fps"))
    frame = whole("frame", frame, 0)
    return track(source, frames=(frame, frame + 1), **options).frame(0)


def _check_no_source_options(options: TrackOptions) -> None:
    """Raise InputError if options of a source were given, for a scene."""
    changed = []
    for option in fields(SourceOptions):
        if getattr(options, option.name) != option.default:
            changed.append(option.name)
    if changed:
        raise InputError(
            "options of the source must be left out for a scene, "
            f"got {', '.join(changed)}"
        )


def _read_scene(source: Resolved, options: TrackOptions, progress: Progress) -> Scene:
    """Return the scene of a source, for footage with the time that reading took."""
    start = clocks()
    scene = scene_of(source, options, progress)
    # a known motion is rendered during tracking, not read here
    if scene.truth is not None:
        return scene
    seconds, cpu_seconds = (clocks() - start).tolist()
    trim_memory()
    return replace(scene, reading_seconds=(seconds, cpu_seconds))


def _check_names(function: str, options: Iterable[str], known: Sequence[str]) -> None:
    """Raise TypeError for an option that a function does not have."""
    if unknown := [name for name in options if name not in known]:
        hint = suggestion(unknown[0], known)
        raise TypeError(f"{function} has no option {unknown[0]!r}{hint}")


def _resolved(source: OneSource | Scene | Resolved | Sequence[Any]) -> Resolved:
    """Return the resolved source; for a scene, its motion."""
    if not isinstance(source, Scene):
        return resolve(source)
    if source.truth is None:
        raise InputError(
            "a scene must be of a known motion, "
            f"got {source.name}, whose truth is unknown"
        )
    return resolve(source.truth)


def _check_for_kind(
    options: TrackOptions, is_motion: bool, motions: Sequence[OneSource]
) -> None:
    """Raise InputError for an option that does not apply to the source.

    Some options need .amc files, others a known motion. `motions` are all motions that
    the track reads.
    """
    captured = any(map(_is_captured, motions))
    named = [motion for motion in options.train if isinstance(motion, str | Path)]
    folders = any(Path(motion).is_dir() for motion in named)
    if options.rate is not None and not (captured or folders):
        raise InputError(
            f"rate applies only to .amc files, got {quoted(options.rate)}: leave it out"
        )
    if not is_motion:
        if options.translation == "known":
            raise InputError(
                "translation must be searched or aligned for footage, got known"
            )
        if options.first_pose == "given":
            raise InputError("first_pose must be searched for footage, got given")
        return
    if options.asf is not None and not captured:
        raise InputError(
            "asf applies only to .amc files and footage, "
            f"got {quoted(str(options.asf))}: leave it out"
        )


def _is_captured(motion: OneSource) -> TypeGuard[str | Path]:
    """Return whether a motion is an .amc file, whose skeleton is in another file."""
    return isinstance(motion, str | Path) and str(motion).lower().endswith(".amc")


def _identity(
    source: Resolved, options: TrackOptions, train: Sequence[Source]
) -> dict[str, Digest]:
    """Return the digests of the arguments that a resumed track must share."""
    values = {}
    for option in fields(options):
        if declared(option).identifies:
            values[option.name] = getattr(options, option.name)
    values |= {"source": source.named, "train": train}
    values["version"] = version_of(_origins(source, options))
    # the skeleton in the folder of an .amc counts as if it were given
    skeletons = []
    for motion in (*source.named, *options.train):
        if _is_captured(motion):
            skeletons.append(skeleton_file(Path(motion), options.asf))
    if skeletons:
        values["asf"] = skeletons
    read = set(_FILES)
    # a folder with the name of a built-in motion is not read
    if source.medium == "motion" and source.named[0] in built_in.names():
        read.discard("source")
    return {name: digest_of(value, name in read) for name, value in values.items()}


def _origins(source: Resolved, options: TrackOptions) -> Iterator[str]:
    """Yield the origins of the named plugins that a track's frames depend on."""
    # objects that the caller made have no origin
    if isinstance(options.method, str):
        optimiser, prior = offers_of(options.method)
        yield optimiser.origin
        if isinstance(prior, str):
            yield registry().offer("prior", prior).origin
    for start in registry().offers["start"].values():
        yield start.origin
    if source.medium in ("video", "pictures"):
        extraction = options.extraction or Extraction()
        for way in extraction.ways(len(source.named)):
            yield registry().offer("segmenter", way.name).origin


def _documented(function: Callable[..., Any]) -> None:
    """Add the options of a track to a function's signature and its docstring's Args."""
    parameters = []
    for parameter in inspect.signature(function).parameters.values():
        if parameter.kind is not parameter.VAR_KEYWORD:
            parameters.append(parameter)
    lines = []
    for option in fields(TrackOptions):
        if function is fit and option.name == "frames":
            continue
        parameter = inspect.Parameter(
            option.name,
            inspect.Parameter.KEYWORD_ONLY,
            default=option.default,
            annotation=option.type,
        )
        parameters.append(parameter)
        described = f"{option.name}: {declared(option).help}"
        lines += textwrap.wrap(
            described,
            DOCSTRING_WIDTH,
            initial_indent="    ",
            subsequent_indent="        ",
            break_on_hyphens=False,
        )
    signature = inspect.Signature(parameters)
    function.__signature__ = signature  # type: ignore[attr-defined]
    arguments, heading, rest = inspect.cleandoc(function.__doc__ or "").partition(
        "\n\nReturns:\n"
    )
    function.__doc__ = "\n".join([arguments, *lines]) + heading + rest


_documented(track)
_documented(fit)
