"""`posefit reproduce` and `posefit bench`.

`posefit --help` imports this module, so it imports click and posefit's own output only; a command imports the rest when
it runs.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from importlib import import_module  # of figures, for which matplotlib may be missing
from typing import TYPE_CHECKING, Any

import click

from posefit.cli.options import JSON
from posefit.cli.output import print_result, progress, say

if TYPE_CHECKING:
    from posefit_reproduce.experiment import Experiment


@click.group("reproduce")
def reproduce_group() -> None:
    """Repeat the experiments of the two publications."""


# of a `Scale`
QUICK: dict[str, Any] = {
    "seeds": 2,
    "frames": 15,
    "views": (0.0, 45.0),
    "around": (0.0, 45.0),
}

OUT = click.option(
    "--out",
    metavar="DIR",
    help="Folder of runs, tables and figures; continues an earlier one there.",
)
WORKERS = click.option(
    "--workers", type=int, default=2, show_default=True, metavar="N", help="Processes."
)
CLIPS = click.option(
    "--clips",
    envvar="POSEFIT_CMU",
    metavar="CMU_DIR",
    help="Folder of CMU clips; by default POSEFIT_CMU, else the library.",
)


@reproduce_group.command("vsmm")
@click.option(
    "--films",
    type=int,
    default=10,
    show_default=True,
    help="Films, of those that no default was chosen on.",
)
@OUT
@WORKERS
def vsmm_command(films: int, out: str | None, workers: int) -> None:
    """Stepping, waving, jumping jacks and squats: the experiment of CN101894278, by its letter and by default."""
    from posefit_reproduce.vsmm.experiment import Scale

    _run(patent_experiment(Scale(films)), out, workers)


@reproduce_group.command("sapso")
@CLIPS
@click.option(
    "--seeds",
    type=int,
    default=10,
    show_default=True,
    help="Tracks of each method, motion and view.",
)
@click.option(
    "--quick",
    is_flag=True,
    help=f"{QUICK['frames']} frames, {len(QUICK['views'])} views and {QUICK['seeds']} seeds.",
)
@OUT
@WORKERS
def sapso_command(
    clips: str | None, seeds: int, quick: bool, out: str | None, workers: int
) -> None:
    """A walk, a walk with a turn and a run: Acta Automatica Sinica 38(5), and what each part of its method is worth."""
    from posefit_reproduce.sapso.experiment import Scale

    _run(
        paper_experiment(clips, Scale(**QUICK) if quick else Scale(seeds)), out, workers
    )


def _run(experiment: "Experiment", out: str | None, workers: int) -> None:
    from posefit_reproduce.experiment import reproduce

    tables = reproduce(experiment, out, workers, partial(progress, unit="run"))
    click.echo("\n\n".join(f"{table.name}\n\n{table}" for table in tables))


@click.command("bench")
@click.option(
    "--threads",
    type=click.IntRange(1),
    help="Threads of the multi-threaded figures; by default every core.",
)
@JSON
def bench_command(threads: int | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, and every optimiser's ask and tell, all in one run.

    `cpu` names the processor that the loops are compiled for: this machine's, or the one that the environment variable
    NUMBA_CPU_NAME names, such as x86-64-v3, which has AVX2 and no AVX-512, or x86-64-v2, which has SSE4.
    """
    from posefit_reproduce.bench.loop import loop_figures

    say("timing; this takes half a minute ...")
    figures = loop_figures(threads)
    print_result(_named_lines(figures), figures, as_json)


def _named_lines(figures: Mapping[str, Any], group: str = "") -> Iterator[str]:
    """Yield every figure with its name, those of a group as `group.name`."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _named_lines(value, f"{group}{name}.")
        else:
            yield f"{group + name:50} " + (
                f"{value:.4g}" if isinstance(value, float) else str(value)
            )


def paper_experiment(clips: str | None, scale: Any) -> "Experiment":
    """Return the paper's experiment on CMU clips of a folder, or of the library. Raises InputError where clips lack."""
    from posefit_reproduce.experiment import Experiment
    from posefit_reproduce.sapso.experiment import loaded, perform
    from posefit_reproduce.sapso.motions import digests
    from posefit_reproduce.sapso.tables import Analysis, paper_tables

    analysis = partial(Analysis, motions=loaded(clips, scale.frames))
    return Experiment(
        [*scale.runs],
        partial(perform, clips, scale),
        lambda results: paper_tables(analysis(results)),
        lambda results: import_module("posefit_reproduce.sapso.figures").paper_figures(
            analysis(results)
        ),
        {
            "frames": scale.frames,
            "iterations": scale.iterations,
            "clips": digests(clips),
        },
    )


def patent_experiment(scale: Any) -> "Experiment":
    """Return the patent's experiment. Raises InputError where there are no films."""
    from posefit_reproduce.experiment import Experiment
    from posefit_reproduce.vsmm.experiment import perform
    from posefit_reproduce.vsmm.tables import patent_tables

    return Experiment(
        [*scale.runs],
        perform,
        patent_tables,
        lambda results: import_module("posefit_reproduce.vsmm.figures").patent_figures(
            results
        ),
    )
