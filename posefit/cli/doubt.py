"""`posefit ambiguity`."""

from contextlib import nullcontext
from typing import Any

import click

from posefit.cli.following import extraction_of, without_subjects
from posefit.cli.options import CAMERAS, EXTRACTION, HEIGHT, MASKS, VIEWS, WITHOUT, options
from posefit.cli.output import json_line, results_alone, say


@click.command()
@click.argument("source", nargs=-1)
@click.option("--frame", type=int, default=0, show_default=True, metavar="K", help="The frame, after resampling.")
@click.option("--within", type=float, default=1.0, show_default=True, help="Cost above the least that is as good.")
@click.option("--temperature", type=float, default=2.0, show_default=True, help="Weights are exp(-cost / this).")
@options((*CAMERAS, *VIEWS, *HEIGHT))
@click.option(
    "--train", multiple=True, default=("library",), metavar="SOURCE", help="Poses to compare; by default library."
)
@options(WITHOUT)
@click.option("--build", metavar="DIR", help="Of footage: the folder of a track, whose build the person has.")
@click.option("--translation", help="Root translation: known, by default where it is, or aligned.")
@options((*EXTRACTION, *MASKS))
@click.option("--threads", type=int, default=1, show_default=True, help="The result is the same with any number.")
@click.option("--out", metavar="DIR", help="Write a picture and all numbers to this new folder.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def ambiguity(as_json: bool, out: str | None, **given: Any) -> None:
    """Tell which poses the silhouette in one frame of SOURCE leaves open.

    Every pose of the library at every yaw whose cost is nearly the least, in groups of poses that are alike; and the
    spread of them all, which no search can know better, with a second camera as well. SOURCE is as for `track`.
    """
    from posefit.ambiguity.estimate import ambiguity_of
    from posefit.ambiguity.output import ambiguity_table, summary_of, written_to
    from posefit.footage.source import Viewing

    source = given["source"] or ("walk",)
    viewing = Viewing(
        asf=given["asf"],
        cameras=given["camera"],
        view_degrees=given["view_degrees"],
        size=given["size"],
        fps=given["fps"],
        extraction=extraction_of(given, source[0]),
        height=given["height"],
        up=given["up"],
        label=given["label"],
        holes=given["holes"],
    )
    subjects = given["without_subject"]
    with results_alone() if as_json else nullcontext(), written_to(out) as write:
        found = ambiguity_of(
            source,
            frame=given["frame"],
            within=given["within"],
            temperature=given["temperature"],
            train=without_subjects(given["train"], subjects) if subjects else given["train"],
            translation=given["translation"],
            viewing=viewing,
            build=given["build"],
            threads=given["threads"],
            say=say,
        )
        write(found)
    if as_json:
        click.echo(json_line(summary_of(found)))
        return
    click.echo(ambiguity_table(found))
    if out:
        click.echo(f"written to {out}: look at ambiguity.png")
