"""`posefit ambiguity`."""

import json
from contextlib import nullcontext
from typing import Any

import click

from posefit.cli.options import EXTRACTION, JSON, WITHOUT, options, track_flags
from posefit.cli.output import results_alone, say
from posefit.cli.tracking import extraction_of, without_subjects


@click.command()
@click.argument("source", nargs=-1)
@click.option("--frame", type=int, default=0, show_default=True, metavar="K", help="The frame, after resampling.")
@click.option("--within", type=float, default=1.0, show_default=True, help="Cost above the least that is as good.")
@click.option("--temperature", type=float, default=2.0, show_default=True, help="Weights are exp(-cost / this).")
@options(track_flags("asf", "camera", "up", "view_degrees", "size", "fps", "height"))
@click.option(
    "--train", multiple=True, default=("library",), metavar="SOURCE", help="Poses to compare; by default library."
)
@WITHOUT
@click.option("--build", metavar="DIR", help="Of footage: the folder of a track, whose build the person has.")
@click.option("--translation", help="Root translation: known, by default where it is, or aligned.")
@options((*EXTRACTION, *track_flags("label", "holes", "threads")))
@click.option("--out", metavar="DIR", help="Write a picture and all numbers to this new folder.")
@JSON
def ambiguity(as_json: bool, out: str | None, **given: Any) -> None:
    """Estimate which poses the silhouette in one frame of SOURCE leaves open.

    Every pose of the library at every yaw whose cost is nearly the least, in groups of similar poses; and the spread of
    them all, below which no search can go, with a second camera as well. SOURCE is as for `track`.
    """
    from posefit.ambiguity.estimate import ambiguity_of
    from posefit.ambiguity.output import ambiguity_table, summary_of, write_result
    from posefit.files import new_folder

    source = given.pop("source") or ("walk",)
    given["extraction"] = extraction_of(given, source[0])
    if subjects := given.pop("without_subject"):
        given["train"] = without_subjects(given["train"], subjects)
    with results_alone() if as_json else nullcontext(), new_folder(out) if out else nullcontext() as folder:
        result = ambiguity_of(source, say=say, **given)
        if folder is not None:
            write_result(folder, result)
    if as_json:
        click.echo(json.dumps(summary_of(result)))
        return
    click.echo(ambiguity_table(result))
    if out:
        click.echo(f"written to {out}: look at ambiguity.png")
