"""`posefit track`, `fit` and `extract`."""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from typing import Any

import click

from posefit.cli.options import EXTRACTION, TRACK, frame_range, options
from posefit.cli.output import json_line, progress, results_alone, say


@click.command()
@options(TRACK)
@click.option(
    "--frames",
    callback=frame_range,
    metavar="A:B",
    help="Only these frames: of footage as filmed, of a motion after resampling.",
)
def track(as_json: bool, **options: Any) -> None:
    """Follow a person through SOURCE.

    A built-in motion, an .amc or .bvh file, a folder or .npz of masks, a video; or what several cameras saw.
    """
    from posefit.tracking.front import track as run

    with results_alone() if as_json else nullcontext():
        result = run(progress=progress, say=say, **_arguments(options))
    if as_json:
        click.echo(json_line(result.summary))
        return
    from posefit.tracking.table import table

    click.echo(table(result.summary))
    if options["out"]:
        click.echo(f"written to {options['out']}: open track.html, watch overlay.mp4, look at summary.png")


@click.command()
@options(TRACK)
@click.option("--frame", type=int, default=0, show_default=True, metavar="K", help="The frame, after resampling.")
def fit(as_json: bool, **options: Any) -> None:
    """Find the pose in one frame of SOURCE."""
    from posefit.tracking.front import fit as run

    with results_alone() if as_json else nullcontext():
        result = run(say=say, **_arguments(options))
    if as_json:
        click.echo(json_line({**result.summary, "pose_degrees": _degrees(result.pose)}))
        return
    from posefit.tracking.table import table

    click.echo(table(result.summary))
    if options["out"]:
        click.echo(f"written to {options['out']}: open track.html, look at summary.png")


@click.command()
@click.argument("video")
@click.option("--out", required=True, metavar="DIR", help="New folder for masks.npz, preview.mp4 and quality.csv.")
@options(EXTRACTION)
@click.option("--method", hidden=True, help="What --extraction was called.")
@click.option("--set", "settings", multiple=True, metavar="SETTING=VALUE", help="Of the segmenter; repeatable.")
@click.option("--frames", callback=frame_range, metavar="A:B", help="Only these frames.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def extract(
    video: str,
    out: str,
    as_json: bool,
    frames: Any,
    method: str | None,
    settings: Sequence[str],
    **options: Any,
) -> None:
    """Take the masks of one person out of a VIDEO before a still background."""
    from posefit.footage.extract import extract as run
    from posefit.footage.segmentation import Extraction, segmenter_name
    from posefit.registry import registry
    from posefit.settings import parse_texts

    if method is not None:
        if options["extraction"] is not None:
            raise ValueError(f"--method must be left out beside --extraction, which it is called now, got {method!r}")
        say("--method is called --extraction now, as for posefit track")
        options["extraction"] = method
    given = _extraction_given(options)
    offer = registry().offer("segmenter", segmenter_name(given.get("method"), given.get("background")))
    how = Extraction(**given, settings=parse_texts(offer.name, offer.factory, settings))
    result = run(video, out, how, frames=frames, progress=progress)
    for warning in result["warnings"]:
        say(f"warning: {warning}")
    if as_json:
        click.echo(json_line(result))
        return
    click.echo(
        f"{result['frames']} frames, {result['usable']} usable, {result['touching_border']} touch the border, "
        f"{result['in_pieces']} in pieces; written to {out}: watch preview.mp4"
    )


def _arguments(options: dict[str, Any]) -> dict[str, Any]:
    """Return the keywords of `posefit.track` that options stand for.

    `--set` gives the settings of optimiser, prior, tracker and segmenter, as their types ask; `tracker.` also
    sets the tracker that an optimiser and a prior are driven by.
    """
    from posefit.footage.segmentation import segmenter_name
    from posefit.footage.source import kind_of
    from posefit.tracking.method import FOLLOWER, parse_settings, usual

    options["source"] = options["source"] or ("walk",)
    filmed = kind_of(options["source"][0]) == "video"
    segmenter = segmenter_name(options["extraction"], options["background"]) if filmed else None
    options["view_degrees"] = options["view_degrees"] or None
    settings, named = options.pop("settings"), {name: options[name] for name in ("optimiser", "prior", "tracker")}
    searched = any(text.partition(".")[0] not in (FOLLOWER, segmenter) for text in settings)
    chosen = usual(options["source"][0], **named, train=options["train"], searched=searched)
    if left_out := options.pop("without_subject"):
        options["train"] = without_subjects(chosen.train, left_out)
    parsed = parse_settings(settings, **chosen.method, segmenter=segmenter)
    options["extraction"] = extraction_of(options, options["source"][0], parsed.pop("segmenter_settings", {}))
    return options | chosen.method | parsed


def extraction_of(options: dict[str, Any], source: str, settings: Mapping[str, Any] | None = None) -> Any:
    """Return how the person is taken out of a video, as options say, which are taken out of them; None by default.

    `settings` are the segmenter's.

    Raises ValueError where they say it of another kind of source.
    """
    from posefit.footage.segmentation import Extraction
    from posefit.footage.source import kind_of, useless_for

    given = _extraction_given(options) | ({"settings": settings} if settings else {})
    if given and (kind := kind_of(source)) != "video":
        name = next(iter(given))
        raise useless_for(kind, "extraction" if name == "method" else name, given[name], "video")
    return Extraction(**given) if given else None


def _extraction_given(options: dict[str, Any]) -> dict[str, Any]:
    """Return those keywords of `Extraction` that options say, which are taken out of them but for `extraction`."""
    how = {name: options.pop(name) for name in ("background", "roi", "ignore", "width")}
    return {name: value for name, value in {**how, "method": options["extraction"]}.items() if value is not None}


def without_subjects(train: Sequence[Any], subjects: Sequence[str]) -> list[Any]:
    """Return what a method learns from, some people of the library left out."""
    from posefit.motion import recorded

    if not any(recorded.is_library(one) for one in train):
        raise ValueError(f"without_subject must be given with --train library, got {', '.join(train)}")
    return [recorded.leaving_out(one, subjects) if recorded.is_library(one) else one for one in train]


def _degrees(pose: Any) -> list[float]:
    import numpy as np

    return [round(float(angle), 6) for angle in np.degrees(pose)]
