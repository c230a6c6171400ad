"""`posefit reproduce sapso` and `posefit reproduce vsmm`."""

from dataclasses import replace
from functools import partial
from typing import Literal

import click

from posefit.cli.options import JSON
from posefit.cli.output import json_line, progress

NEIGHBOURS = "Processes. Seconds of a frame are those beside so many neighbours."


@click.command("vsmm")
@click.option("--seeds", type=int, default=5, show_default=True, help="Films, each in other phases and views.")
@click.option("--searches", is_flag=True, help="Compare with SAPSO and with the joined tracker too; minutes more.")
@click.option("--alternatives", is_flag=True, help="Compare with the other value of every setting; minutes more.")
@click.option("--out", metavar="DIR", help="New folder for report.json and the figures; needs posefit[figures].")
@click.option("--workers", type=int, default=1, show_default=True, metavar="N", help=NEIGHBOURS)
@JSON
def vsmm_command(seeds: int, searches: bool, alternatives: bool, out: str | None, workers: int, as_json: bool) -> None:
    """Stepping, waving, jumping jacks and squats: the experiment of CN101894278, by its letter and by default."""
    from posefit_reproduce.vsmm.report import patent_report, patent_text

    figures = patent_report(seeds, searches, alternatives, out, workers, partial(progress, unit="run"))
    click.echo(json_line(figures) if as_json else patent_text(figures))
    if out and not as_json:
        click.echo(f"written to {out}: look at figure-9-joints.png, figure-10-probabilities.png, figure-11-errors.png")


CLIPS = click.option(
    "--clips",
    envvar="POSEFIT_CMU",
    metavar="CMU_DIR",
    help="Folder of CMU clips; by default POSEFIT_CMU, else built-in.",
)


@click.command("sapso")
@CLIPS
@click.option("--seeds", type=int, default=5, show_default=True, help="Tracks of each method, motion and view.")
@click.option("--quick", is_flag=True, help="30 frames from one view, a sixth of the time.")
@click.option(
    "--first-yaw",
    type=click.Choice(["known", "unknown"]),
    default="known",
    show_default=True,
    help="What a track begins with; unknown is a full circle, with restarts.",
)
@click.option("--out", metavar="DIR", help="New folder for the report and the figures; needs posefit[figures].")
@click.option("--workers", type=int, default=2, show_default=True, metavar="N", help=NEIGHBOURS)
@JSON
def sapso_command(
    clips: str | None,
    seeds: int,
    quick: bool,
    first_yaw: Literal["known", "unknown"],
    out: str | None,
    workers: int,
    as_json: bool,
) -> None:
    """A walk, a walk with a turn and a run: tables 1 and 2 and figures 3-7 and 9 of Acta Automatica Sinica 38(5)."""
    from posefit_reproduce.sapso.paper import QUICK, Scale
    from posefit_reproduce.sapso.report import paper_report, paper_text

    scale = replace(QUICK if quick else Scale(), first_yaw=first_yaw)
    report = paper_report(clips, seeds, scale, out, workers, partial(progress, unit="run"))
    click.echo(json_line(report) if as_json else paper_text(report))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(report['figures'])}")
