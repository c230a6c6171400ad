"""`posefit reproduce` and `posefit bench`.

`posefit --help` imports this module, so it imports click and posefit's own output only; a command imports the rest when
it runs.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import click

from posefit.cli.options import JSON
from posefit.cli.output import progress, say
from posefit.errors import InputError

NEIGHBOURS = "Processes. Seconds of a frame are those beside so many neighbours."


@click.group("reproduce")
def reproduce_group() -> None:
    """Repeat the experiments of the two publications."""


@reproduce_group.command("vsmm")
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
    click.echo(json.dumps(figures) if as_json else patent_text(figures))
    if out and not as_json:
        click.echo(f"written to {out}: look at figure-9-joints.png, figure-10-probabilities.png, figure-11-errors.png")


CLIPS = click.option(
    "--clips",
    envvar="POSEFIT_CMU",
    metavar="CMU_DIR",
    help="Folder of CMU clips; by default POSEFIT_CMU, else built-in.",
)


@reproduce_group.command("sapso")
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
    click.echo(json.dumps(report) if as_json else paper_text(report))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(report['figures'])}")


@click.command("bench")
@click.option("--threads", type=click.IntRange(1), help="Threads of the multi-threaded figures; by default every core.")
@click.option("--device", type=click.Choice(["cuda"]), help="Time a GPU beside the CPU instead, and compare counts.")
@JSON
def bench_command(threads: int | None, device: str | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run.

    `cpu` names the processor that the loops are compiled for: this machine's, or the one that the environment variable
    NUMBA_CPU_NAME names, such as x86-64-v3, which has AVX2 and no AVX-512, or x86-64-v2, which has SSE4.
    """
    from posefit.silhouette.cuda.device import check_device

    if None not in (threads, device):
        raise InputError("bench must have --threads or --device, got both")
    if device is None:
        from posefit_reproduce.bench.experiment import loop_figures

        say("timing; this takes half a minute ...")
        figures = loop_figures(threads)
        lines = _named_lines(figures)
    else:
        from posefit_reproduce.bench.device import device_figures, device_lines

        check_device(device)
        say("timing the GPU beside the CPU; this takes a minute or more ...")
        figures = device_figures(device)
        lines = device_lines(figures)
    click.echo(json.dumps(figures) if as_json else "\n".join(lines))


def _named_lines(figures: Mapping[str, Any], group: str = "") -> Iterator[str]:
    """Yield every figure with its name, those of a group as `group.name`."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _named_lines(value, f"{group}{name}.")
        else:
            yield f"{group + name:38} " + (f"{value:.4g}" if isinstance(value, float) else str(value))
