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
from posefit.progress import Progress

if TYPE_CHECKING:
    from posefit.footage.source import Medium
    from posefit.output.content import Content

_OF_FILES = ("source", "out", "force", "resume", "write")
# what a user looks at first
HINTS = {
    "html": "open track.html",
    "mp4": "watch overlay.mp4",
    "png": "look at summary.png",
}
COLOURS = {"good": "green", "doubtful": "yellow", "do not use": "red"}


@click.command(cls=TrackCommand)
@options(TRACK)
@FRAMES
@under("What is seen")(
    "--live",
    metavar="DEVICE|URL|-",
    help="Frames as they come, instead of SOURCE; - reads PGM masks or PPM pictures.",
)
def track(
    as_json: bool, live: str | None, verbose: bool, quiet: bool, **options: Any
) -> None:
    """Track a person through SOURCE.

    A video; masks as a folder, image files, .npz or .npy; a built-in or recorded motion, an .amc or .bvh file. Several
    sources are what several cameras saw at the same time.

    \b
    posefit track masks/ --fps 25 --height 1.75 --out walker
    posefit track left.mp4 right.mp4 --camera cameras.toml --out walker
    posefit track walk --method sapso@pca --set sapso.cooling=0.9
    """  # noqa: D301
    from posefit.tracking.front import track as run

    logging.getLogger("posefit").disabled = quiet
    shown = Progress() if quiet else Progress(say, progress)
    if live is not None:
        return _track_live(live, as_json, options, shown)

    with results_alone() if as_json else nullcontext():
        result = run(progress=shown, **_arguments(options))
    shown.log(
        "took "
        + ", ".join(f"{name} {seconds:.1f} s" for name, seconds in shown.phases.items())
    )
    _print(result.content, as_json, {}, options, verbose, HINTS)


@click.command(cls=TrackCommand)
@options(TRACK)
@under("What is seen")(
    "--frame",
    type=int,
    metavar="K",
    help="The frame: its number as filmed, of a motion after resampling; by default the first.",
)
def fit(as_json: bool, verbose: bool, quiet: bool, **options: Any) -> None:
    """Find the pose in one frame of SOURCE.

    \b
    posefit fit mask.png --height 1.75 --out pose
    posefit fit walk --frame 20 --method cma
    """  # noqa: D301
    from posefit.tracking.front import fit as run

    logging.getLogger("posefit").disabled = quiet
    with results_alone() if as_json else nullcontext():
        result = run(
            progress=Progress() if quiet else Progress(say), **_arguments(options)
        )
    more = {"pose_degrees": [round(math.degrees(angle), 6) for angle in result.pose]}
    _print(
        result.track.content,
        as_json,
        more,
        options,
        verbose,
        {kind: HINTS[kind] for kind in ("html", "png")},
    )


def _track_live(
    live: str, as_json: bool, options: dict[str, Any], shown: Progress
) -> None:
    from posefit.tracking.live import track_live, write_live

    if options["source"]:
        raise InputError(
            f"SOURCE must be left out with --live, got {' '.join(options['source'])}"
        )
    if useless := [
        name
        for name in ("force", "resume", "write", "without_subject")
        if options[name]
    ]:
        raise InputError(
            f"--{useless[0].replace('_', '-')} must be left out with --live"
        )
    out = options["out"]
    # frames that come are taken as those of a video
    chosen = {
        name: value
        for name, value in _arguments(options, "video").items()
        if name not in _OF_FILES
    }
    frames = track_live(live, progress=shown, **chosen)
    summary = write_live(
        frames,
        out,
        (lambda frame: click.echo(json.dumps(frame.row))) if as_json else None,
    )
    latency = f"latency {summary['latency_ms']['p50']:g} ms, 99 % within {summary['latency_ms']['p99']:g} ms"
    shown.log(
        f"{summary['frames']} frames tracked, {summary['skipped']} skipped; {latency}"
    )


def _print(
    content: "Content",
    as_json: bool,
    more: Mapping[str, Any],
    options: Mapping[str, Any],
    verbose: bool,
    hints: Mapping[str, str],
) -> None:
    """Print what a track is: as JSON with something more, in three lines, or whole; then which file to look at."""
    from posefit.output.files import WRITERS, chosen_kinds
    from posefit.output.text import brief, table

    if as_json:
        click.echo(json.dumps({**content.summary, **more}))
        return
    if verbose:
        click.echo(table(content))
    else:
        worth, *work = brief(content)
        grade = "good" if content.trust is None else content.trust.grade
        click.secho(worth, bold=True, fg=COLOURS[grade])
        click.echo("\n".join(work))
    out = options["out"]
    kinds = chosen_kinds(options["write"])
    shown = [hint for kind, hint in hints.items() if kind in kinds]
    if out or not verbose:
        click.echo(
            f"written to {out}: {', '.join(shown or [WRITERS[kind][0] for kind in kinds])}"
            if out
            else "--verbose prints all figures; --out DIR writes files"
        )


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
    help="Of the segmenter; repeatable.",
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
    """Write the masks of one person in SOURCE as a file.

    They are taken out of a video, or of pictures, before a still background; masks are cleaned, and motions drawn.
    Several sources are what several cameras saw at the same time.
    """
    from posefit.footage.extract import extract as run
    from posefit.footage.segmentation import Extraction
    from posefit.footage.source import resolve

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
            f"{camera['frames']} frames, {camera['usable']} usable, {camera['touching_border']} touch the "
            f"border{pieces}; written to {folder}: watch preview.mp4"
        )


def _arguments(
    options: dict[str, Any], medium: "Medium | None" = None
) -> dict[str, Any]:
    """Return the keywords of `posefit.track` that the command's options stand for; of a stream with its medium."""
    from posefit.footage.source import resolve
    from posefit.tracking.defaults import completed
    from posefit.tracking.options import TrackOptions

    options = {**options}
    if medium is None:
        options["source"] = resolve(options["source"] or "walk")
        medium = options["source"].medium
    options["extraction"] = extraction_of(options, medium)
    if left_out := options.pop("without_subject"):
        chosen = TrackOptions(
            **{name: options[name] for name in ("method", "settings", "train")}
        )
        motion = options["source"].named[0] if medium == "motion" else None
        options["train"] = without_subjects(completed(chosen, motion).train, left_out)
    return options


def extraction_of(
    options: dict[str, Any], medium: "Medium", settings: Sequence[str] | None = None
) -> Any:
    """Return how the person is taken out of a video, by options that are taken out of them; None by default.

    `settings` are texts of the segmenter's settings; without them, those of `options` that begin with its name. Raises
    InputError where the options are given for another kind of source.
    """
    from posefit.footage.segmentation import Extraction, segmenter_name
    from posefit.footage.source import useless_for
    from posefit.registry import registry
    from posefit.settings import parse_texts

    values = {
        name: options.pop(name)
        for name in ("extraction", "background", "roi", "ignore", "width")
    }
    values = {name: value for name, value in values.items() if value is not None}
    if medium not in ("video", "pictures"):
        for name, value in values.items():
            raise useless_for(medium, name, value, "video")
        return None
    if "extraction" in values:
        values["method"] = values.pop("extraction")
    name = segmenter_name(values.get("method"), values.get("background"))
    if settings is None and "settings" in options:
        texts = options["settings"]
        settings = [text for text in texts if text.partition(".")[0] == name]
        options["settings"] = tuple(text for text in texts if text not in settings)
    if settings:
        values["settings"] = parse_texts(
            name, registry().offer("segmenter", name).factory, settings
        )
    return Extraction(**values) if values else None


def without_subjects(train: Sequence[Any], subjects: Sequence[str]) -> list[Any]:
    """Return what a method learns from, some people of the library left out."""
    from posefit.motion import recorded

    if not any(recorded.is_library(clips) for clips in train):
        raise InputError(
            f"without_subject must be given with --train library, got {', '.join(train)}"
        )
    return [
        recorded.leaving_out(clips, subjects) if recorded.is_library(clips) else clips
        for clips in train
    ]
