"""`posefit track`, `fit` and `extract`."""

import json
import logging
import math
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from posefit.cli.options import (
    EXTRACTION,
    FRAMES,
    JSON,
    TRACK,
    TrackCommand,
    options,
    track_flags,
    under,
)
from posefit.cli.output import progress, results_alone, say
from posefit.errors import InputError
from posefit.limits import share_heap
from posefit.progress import Progress

if TYPE_CHECKING:
    from posefit.footage.kinds import Medium
    from posefit.output.content import Content

_OF_FILES = ("source", "out", "force", "resume", "write")
# the files that a user should open first
HINTS = {
    "html": "open track.html",
    "mp4": "watch overlay.mp4",
    "png": "look at summary.png",
}
COLOURS = {"good": "green", "doubtful": "yellow", "do not use": "red"}


@click.command(cls=TrackCommand)
@options(TRACK)
@FRAMES
@under("Source and camera")(
    "--live",
    metavar="DEVICE|URL|-",
    help="Track live frames instead of SOURCE. - reads PGM masks or PPM pictures "
    "from standard input.",
)
def track(
    as_json: bool, live: str | None, verbose: bool, quiet: bool, **options: Any
) -> None:
    """Track a person through SOURCE.

    SOURCE is a video; masks in a folder, image files, .npz or .npy; a built-in or
    recorded motion; or an .amc or .bvh file. Several sources are the views of several
    cameras at the same time.

    \b
    posefit track masks/ --fps 25 --height 1.75 --out walker
    posefit track left.mp4 right.mp4 --camera cameras.toml --out walker
    posefit track walk --method sapso@pca --set sapso.cooling=0.9
    """  # noqa: D301
    from posefit.tracking.front import track as run

    share_heap()
    logging.getLogger("posefit").disabled = quiet
    shown = Progress() if quiet else Progress(say, progress)
    if live is not None:
        return _track_live(live, as_json, options, shown)

    # plugins may print, and stdout must contain nothing but the JSON object
    with results_alone() if as_json else nullcontext():
        result = run(progress=shown, **_arguments(options))
    shown.log(f"time: {_times(shown)}")
    _print(result.content, as_json, {}, options, verbose, HINTS)


def _times(shown: Progress) -> str:
    """Return how long each phase took, and how much of that was compiling."""
    from posefit.arrays.compiling import compiling_seconds

    phases = [f"{name} {seconds:.1f} s" for name, seconds in shown.phases.items()]
    compiling = compiling_seconds()
    if compiling:
        phases.append(f"{compiling:.1f} s of this for compiling kernels")
    return ", ".join(phases)


@click.command(cls=TrackCommand)
@options(TRACK)
@under("Source and camera")(
    "--frame",
    type=int,
    metavar="K",
    help="Number of the frame, as filmed or, for a motion, after resampling. "
    "Default: the first.",
)
def fit(as_json: bool, verbose: bool, quiet: bool, **options: Any) -> None:
    """Find the pose in one frame of SOURCE.

    \b
    posefit fit mask.png --height 1.75 --out pose
    posefit fit walk --frame 20 --method cma
    """  # noqa: D301
    from posefit.tracking.front import fit as run

    logging.getLogger("posefit").disabled = quiet
    shown = Progress() if quiet else Progress(say)
    with results_alone() if as_json else nullcontext():
        result = run(progress=shown, **_arguments(options))
    pose_degrees = [round(math.degrees(angle), 6) for angle in result.pose]
    more = {"pose_degrees": pose_degrees}
    hints = {kind: HINTS[kind] for kind in ("html", "png")}
    _print(result.track.content, as_json, more, options, verbose, hints)


def _track_live(
    live: str, as_json: bool, options: dict[str, Any], shown: Progress
) -> None:
    from posefit.tracking.live import track_live, write_live

    if options["source"]:
        raise InputError(
            f"SOURCE must be left out with --live, got {' '.join(options['source'])}"
        )
    # a session always writes the same two files, and cannot be continued
    for name in ("force", "resume", "write", "without_subject"):
        if options[name]:
            flag = name.replace("_", "-")
            came = options[name]
            if came is True:
                came = "it"
            elif not isinstance(came, str):
                came = ", ".join(came)
            raise InputError(f"--{flag} must be left out with --live, got {came}")
    out = options["out"]
    # live frames are treated like a video's
    chosen = _arguments(options, "video")
    # a stream has no files that these could apply to
    for name in _OF_FILES:
        chosen.pop(name, None)
    frames = track_live(live, progress=shown, **chosen)
    each = (lambda frame: click.echo(json.dumps(frame.row))) if as_json else None
    summary = write_live(frames, out, each)
    # the stream may end, or Ctrl-C be pressed, before the first pose
    if not summary["frames"]:
        shown.log("no frame was tracked")
        return
    latency = summary["latency_ms"]
    shown.log(
        f"{summary['frames']} frames tracked, {summary['skipped']} skipped; "
        f"latency {latency['p50']:g} ms, 99 % within {latency['p99']:g} ms"
    )


def _print(
    content: "Content",
    as_json: bool,
    more: Mapping[str, Any],
    options: Mapping[str, Any],
    verbose: bool,
    hints: Mapping[str, str],
) -> None:
    """Print a track: as JSON with `more` values, in a few lines, or in full.

    Then name the files to open, out of `hints`.
    """
    from posefit.output.files import WRITERS, chosen_kinds
    from posefit.output.text import brief, detailed

    if as_json:
        click.echo(json.dumps({**content.summary, **more}))
        return
    if verbose:
        click.echo(detailed(content))
    else:
        # the verdict comes first, in a colour, so that a bad track is not overlooked
        first, *others = brief(content)
        if content.trust is None:
            grade = "good"
        else:
            grade = content.trust.grade
        click.secho(first, bold=True, fg=COLOURS[grade])
        click.echo("\n".join(others))
    out = options["out"]
    if out:
        kinds = chosen_kinds(options["write"])
        shown = [hint for kind, hint in hints.items() if kind in kinds]
        files = [WRITERS[kind].file for kind in kinds]
        click.echo(f"written to {out}: {', '.join(shown or files)}")
    elif not verbose:
        click.echo("--verbose prints all figures; --out DIR writes files")


@click.command()
@click.argument("source", nargs=-1, required=True)
@click.option(
    "--out",
    required=True,
    metavar="DIR",
    help="New folder for masks.npz, preview.mp4 and quality.csv.",
)
@options(EXTRACTION)
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="[NAME.]SETTING=VALUE",
    help="Setting of the segmenter; repeatable.",
)
@FRAMES
@options(track_flags("person"))
@JSON
def extract(
    source: Sequence[str],
    out: str,
    as_json: bool,
    frames: Any,
    settings: Sequence[str],
    person: Any,
    **options: Any,
) -> None:
    """Write the masks of one person in SOURCE to a file.

    The person is segmented in a video or in pictures with a still background. Masks are
    cleaned, and motions are rendered. Several sources are the views of several cameras
    at the same time.
    """
    from posefit.footage.extract import extract as run
    from posefit.footage.extraction import Extraction
    from posefit.footage.kinds import resolve

    resolved = resolve(source)
    how = extraction_of(options, resolved.medium, settings) or Extraction()
    how = replace(how, person=person)
    result = run(resolved, out, how, frames=frames, progress=progress)
    cameras = result.get("cameras", [result])
    for camera in cameras:
        if camera["guesses"]:
            say(f"guessed: {'; '.join(camera['guesses'])}")
        for warning in camera["warnings"]:
            say(f"warning: {warning}")
    if as_json:
        click.echo(json.dumps(result))
        return
    for number, camera in enumerate(cameras, 1):
        pieces = ""
        if camera["in_pieces"] is not None:
            pieces = f", {camera['in_pieces']} in pieces"
        folder = out if len(cameras) == 1 else f"{out}/{number}"
        click.echo(
            f"{camera['frames']} frames, {camera['usable']} usable, "
            f"{camera['touching_border']} touch the border{pieces}; "
            f"written to {folder}: watch preview.mp4"
        )


def _arguments(
    options: dict[str, Any], medium: "Medium | None" = None
) -> dict[str, Any]:
    """Return the command's options as keywords of `posefit.track`.

    `medium` is given for a stream; otherwise the source is resolved.
    """
    from posefit.footage.kinds import resolve
    from posefit.tracking.defaults import completed
    from posefit.tracking.options import TrackOptions

    options = {**options}
    if medium is None:
        options["source"] = resolve(options["source"] or "walk")
        medium = options["source"].medium
    options["extraction"] = extraction_of(options, medium)
    if left_out := options.pop("without_subject"):
        # the default training motions depend on the method and the source
        chosen = TrackOptions(
            method=options["method"],
            settings=options["settings"],
            train=options["train"],
        )
        if medium == "motion":
            motion = options["source"].named[0]
        else:
            motion = None
        options["train"] = without_subjects(completed(chosen, motion).train, left_out)
    return options


def extraction_of(
    options: dict[str, Any], medium: "Medium", settings: Sequence[str] | None = None
) -> Any:
    """Return how to segment the person in a video, or None for the default.

    Args:
        options: The command's options. The options of the segmentation are removed.
        medium: The kind of source.
        settings: Settings of the segmenter as strings. By default they are the settings
            in `options` that begin with its name.

    Returns:
        The segmentation, or None for the default.

    Raises:
        InputError: The options are given for a source that is not segmented.
    """
    from posefit.footage.extraction import Extraction, segmenter_name
    from posefit.footage.uses import useless_for
    from posefit.registry import registry
    from posefit.settings import parse_texts

    values = {}
    for name in ("extraction", "background", "roi", "ignore", "width"):
        value = options.pop(name)
        if value is not None:
            values[name] = value
    # an option without effect is an error: the user believes that it does something
    if medium not in ("video", "pictures"):
        for name, value in values.items():
            raise useless_for(medium, name, value, "video")
        return None
    if "extraction" in values:
        values["method"] = values.pop("extraction")
    name = segmenter_name(values.get("method"), values.get("background"))
    if settings is None and "settings" in options:
        # `--set` has the settings of all plugins, and the tracker refuses unknown ones
        own = []
        others = []
        for text in options["settings"]:
            if text.partition(".")[0] == name:
                own.append(text)
            else:
                others.append(text)
        settings = own
        options["settings"] = tuple(others)
    if settings:
        factory = registry().offer("segmenter", name).factory
        values["settings"] = parse_texts(name, factory, settings)
    if values:
        return Extraction(**values)
    return None


def without_subjects(train: Sequence[Any], subjects: Sequence[str]) -> list[Any]:
    """Return the training motions without some people of the library."""
    from posefit.motion import recorded

    # leaving out somebody who is not there would look like an honest test
    if not any(recorded.is_library(clips) for clips in train):
        raise InputError(
            "without_subject must be given with --train library, "
            f"got {', '.join(train)}"
        )
    kept = []
    for clips in train:
        if recorded.is_library(clips):
            clips = recorded.leaving_out(clips, subjects)
        kept.append(clips)
    return kept
