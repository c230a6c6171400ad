"""`posefit reproduce` and `posefit bench`.

`posefit --help` imports this module. It therefore imports only click and posefit's
output; a command imports the rest when it runs.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from importlib import import_module  # for figures: matplotlib may be missing
from typing import TYPE_CHECKING, Any

import click

from posefit.cli.options import JSON
from posefit.cli.output import print_result, progress, say

if TYPE_CHECKING:
    from posefit_reproduce.experiment import Experiment


@click.group("reproduce")
def reproduce_group() -> None:
    """Repeat the experiments of the two publications."""


# settings of a quick `Scale`
QUICK: dict[str, Any] = {
    "seeds": 2,
    "frames": 15,
    "views": (0.0, 45.0),
    "around": (0.0, 45.0),
}

OUT = click.option(
    "--out",
    metavar="DIR",
    help="Folder for runs, tables and figures. An earlier run there is continued.",
)
WORKERS = click.option(
    "--workers",
    type=int,
    default=2,
    show_default=True,
    metavar="N",
    help="Number of processes.",
)
CLIPS = click.option(
    "--clips",
    envvar="POSEFIT_CMU",
    metavar="CMU_DIR",
    help="Folder of CMU clips; by default POSEFIT_CMU, or else the library.",
)


@reproduce_group.command("vsmm")
@click.option(
    "--films",
    type=int,
    default=10,
    show_default=True,
    help="Number of films, all different from those on which defaults were chosen.",
)
@OUT
@WORKERS
def vsmm_command(films: int, out: str | None, workers: int) -> None:
    """Track stepping, waving, jumping jacks and squats, by default and literally.

    This is the experiment of the patent, CN101894278.
    """
    from posefit_reproduce.vsmm.experiment import Scale

    _run(patent_experiment(Scale(films)), out, workers)


@reproduce_group.command("sapso")
@CLIPS
@click.option(
    "--seeds",
    type=int,
    default=10,
    show_default=True,
    help="Number of tracks of each method, motion and view.",
)
@click.option(
    "--quick",
    is_flag=True,
    help=(
        f"Only {QUICK['frames']} frames, {len(QUICK['views'])} views "
        f"and {QUICK['seeds']} seeds."
    ),
)
@OUT
@WORKERS
def sapso_command(
    clips: str | None, seeds: int, quick: bool, out: str | None, workers: int
) -> None:
    """Track a walk, a walk with a turn and a run, and measure each part of the method.

    These are the experiments of the paper, Acta Automatica Sinica 38(5).
    """
    from posefit_reproduce.sapso.experiment import Scale

    scale = Scale(**QUICK) if quick else Scale(seeds)
    _run(paper_experiment(clips, scale), out, workers)


def _run(experiment: "Experiment", out: str | None, workers: int) -> None:
    from posefit_reproduce.experiment import reproduce

    tables = reproduce(experiment, out, workers, partial(progress, unit="run"))
    click.echo("\n\n".join(f"{table.name}\n\n{table}" for table in tables))


@click.command("bench")
@click.option(
    "--threads",
    type=click.IntRange(1),
    help="Threads of the multi-threaded figures; by default all cores.",
)
@JSON
def bench_command(threads: int | None, as_json: bool) -> None:
    """Time the kernel, OpenCV, and ask and tell of every optimiser, all in one run.

    `cpu` is the processor for which the loops are compiled: this machine's, or the one
    in the environment variable NUMBA_CPU_NAME. Examples are x86-64-v3, which has AVX2
    and no AVX-512, and x86-64-v2, which has SSE4.
    """
    from posefit_reproduce.bench.loop import loop_figures

    say("timing; this takes half a minute ...")
    figures = loop_figures(threads)
    print_result(_named_lines(figures), figures, as_json)


def _named_lines(figures: Mapping[str, Any], group: str = "") -> Iterator[str]:
    """Yield every figure with its name; figures of a group are named `group.name`."""
    for name, value in figures.items():
        if isinstance(value, Mapping):
            yield from _named_lines(value, f"{group}{name}.")
        else:
            if isinstance(value, float):
                text = f"{value:.4g}"
            else:
                text = str(value)
            yield f"{group + name:50} {text}"


def paper_experiment(clips: str | None, scale: Any) -> "Experiment":
    """Return the paper's experiment on CMU clips, from a folder or the library.

    Raises InputError if clips are missing.
    """
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
    """Return the patent's experiment. Raises InputError if there are no films."""
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
