"""`posefit reproduce sapso`, `posefit reproduce footage` and `posefit reproduce vsmm`."""

from dataclasses import replace
from functools import partial
from typing import Any, Literal

import click

from posefit.cli.options import EXTRACTION, FRAMES, JSON, options, track_flags
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
    from posefit_reproduce.sapso.design import QUICK, Scale
    from posefit_reproduce.sapso.report import paper_report, paper_text

    scale = replace(QUICK if quick else Scale(), first_yaw=first_yaw)
    report = paper_report(clips, seeds, scale, out, workers, partial(progress, unit="run"))
    click.echo(json_line(report) if as_json else paper_text(report))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(report['figures'])}")


@click.command("footage")
@click.argument("folder", type=click.Path())
@click.option("--only", default="", metavar="TEXT", help="Films with it in their path; by default a walk and a run.")
@click.option("--activity", type=click.Choice(["walk", "run"]), help="What films show whose names do not say it.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all random numbers.")
@CLIPS
@click.option("--out", metavar="DIR", help="New folder for report.json and the pictures of figures 8 and 10.")
@options((FRAMES, *track_flags("height"), *EXTRACTION, JSON))
def footage_command(out: str | None, as_json: bool, **given: Any) -> None:
    """Figures 8 and 10 of Acta Automatica Sinica 38(5), on real films.

    FOLDER is that of KTH's actions, HumanEva-I or CMU's motion capture database as unpacked, or a film by itself. Of
    each film 100 frames are taken, from the first that shows the person by what its data set says, unless --frames
    chooses others.
    """
    from posefit.footage.segmentation import Extraction
    from posefit_reproduce.footage.experiment import Choice, footage_report, footage_text

    how = {name: given.pop(name) for name in ("background", "roi", "ignore", "width")}
    how["method"] = given.pop("extraction")
    extraction = Extraction(**{name: value for name, value in how.items() if value is not None})
    report = footage_report(Choice(**given, extraction=extraction), out, partial(progress, unit="film"))
    click.echo(json_line(report) if as_json else footage_text(report))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(report['figures'])}")
