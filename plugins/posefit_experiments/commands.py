"""`posefit reproduce` and `posefit bench`."""

import json
from collections.abc import Callable
from functools import partial

import click

from posefit import hookimpl
from posefit.cli.output import progress, say


@click.command()
@click.option("--threads", type=int, help="How many `all threads` are; by default every core.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench(threads: int | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run."""
    from posefit_experiments.bench import bench as run

    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    say("timing; this takes half a minute ...")
    figures = run(threads)
    if as_json:
        click.echo(json.dumps(figures))
        return
    for group in ("vector_env", "optimisers"):
        figures |= {f"{group}.{name}": value for name, value in figures.pop(group).items()}
    for name, value in figures.items():
        click.echo(f"{name:38} {value:.4g}" if isinstance(value, float) else f"{name:38} {value}")


@click.group()
def reproduce() -> None:
    """Repeat the experiments of the publications that posefit follows."""


@reproduce.command()
@click.option("--seeds", type=int, default=10, show_default=True, help="Sequences, each in other phases and views.")
@click.option("--searches", is_flag=True, help="Compare with SAPSO and with the joined tracker too; minutes more.")
@click.option("--out", metavar="DIR", help="New folder for report.json and the figures; needs posefit[figures].")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def vsmm(seeds: int, searches: bool, out: str | None, as_json: bool) -> None:
    """Stepping, waving, jumping jacks and squats: the experiment of CN101894278, against an IMM over all models."""
    from posefit_experiments.vsmm.report import report, table

    figures = report(seeds, searches, out, partial(progress, unit="run"))
    click.echo(json.dumps(figures) if as_json else table(figures))
    if out and not as_json:
        click.echo(f"written to {out}: look at figure-9-joints.png, figure-10-probabilities.png, figure-11-errors.png")


@reproduce.command()
@click.option(
    "--clips",
    envvar="POSEFIT_CMU",
    metavar="CMU_DIR",
    help="Folder of CMU clips; by default POSEFIT_CMU, else built-in.",
)
@click.option("--seeds", type=int, default=5, show_default=True, help="Tracks of each method, motion and view.")
@click.option("--quick", is_flag=True, help="30 frames from one view, a sixth of the time.")
@click.option("--out", metavar="DIR", help="New folder for the report and the figures; needs posefit[figures].")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def sapso(clips: str | None, seeds: int, quick: bool, out: str | None, as_json: bool) -> None:
    """A walk, a walk with a turn and a run: tables 1 and 2 and figures 3-7 and 9 of Acta Automatica Sinica 38(5)."""
    from posefit_experiments.sapso.experiment import QUICK, Scale
    from posefit_experiments.sapso.report import report, text

    told = report(clips, seeds, QUICK if quick else Scale(), out, partial(progress, unit="run"))
    click.echo(json.dumps(told) if as_json else text(told))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(told['figures'])}")


@hookimpl
def posefit_register_commands(register: Callable[[click.Command], None]) -> None:
    """Offer `reproduce` and `bench`."""
    register(reproduce)
    register(bench)
