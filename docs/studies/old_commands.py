"""posefit's own measurements: `posefit reproduce accuracy`, `methods`, `views`, `degradation` and so on."""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import click

from posefit.cli.options import box, frame_range
from posefit.cli.output import json_line, progress, say
from posefit_reproduce.commands.options import CLIPS, JSON, LEDGER, seeds, workers

bar = partial(progress, unit="run")


@click.command("accuracy")
@CLIPS
@click.option("--optimiser", default="sapso", show_default=True, help="See `posefit plugins`.")
@click.option("--tracks", type=int, default=1, show_default=True, help="Beginnings of each track; one is kept.")
@seeds(5)
@workers(None)
@LEDGER
@JSON
def accuracy_command(as_json: bool, **asked: Any) -> None:
    """An optimiser with the prior pca on two walks of CMU, from three sides, beside what anybody reaches."""
    from accuracy import accuracy, accuracy_lines

    _print(accuracy(**asked, say=say), accuracy_lines, as_json)


@click.command("methods")
@CLIPS
@click.option("--first-pose", default="searched", show_default=True, help="searched, or given (the true one).")
@seeds(5)
@workers(2, "Seconds of a frame are those beside so many neighbours.")
@LEDGER
@JSON
def methods_command(as_json: bool, **asked: Any) -> None:
    """Five optimisers in three priors follow a walk and a run of CMU, from three sides, at one budget."""
    from methods import methods, methods_lines

    _print(methods(**asked, say=say), methods_lines, as_json)


@click.command("views")
@seeds(5)
@workers(None)
@JSON
def views_command(as_json: bool, **asked: Any) -> None:
    """One camera, two or four, at the same budget of evaluations; built-in motions, whose first pose is searched."""
    from views import views, views_lines

    _print(views(**asked, progress=bar), views_lines, as_json)


@click.command("degradation")
@click.option("--optimiser", default="sapso", show_default=True, help="See `posefit plugins`.")
@click.option("--prior", default="pca", show_default=True, help="See `posefit plugins`.")
@seeds(5)
@workers(None)
@click.option("--out", metavar="FILE.png", help="New file for the figure; needs posefit[figures].")
@JSON
def degradation_command(out: str | None, as_json: bool, **asked: Any) -> None:
    """Silhouettes with holes, blobs, shadows and more, worse and worse; frames that are missing; another body."""
    from contextlib import nullcontext
    from importlib.util import find_spec

    from degradation import degradation, degradation_figure, degradation_lines
    from posefit.files import new_file

    if out and find_spec("matplotlib") is None:  # known before the minutes that the tracks take
        raise ImportError("the figure needs the library matplotlib: pip install posefit[figures]")
    with new_file(out) if out else nullcontext() as file:
        told = degradation(**asked, progress=bar)
        if file is not None:
            degradation_figure(told, file)
    _print(told, degradation_lines, as_json)


@click.command("builds")
@click.option("--motion", default="walk-b", show_default=True, help="The built-in motion that they walk.")
@click.option("--subjects", type=int, default=8, show_default=True, help="People, each of another build.")
@workers(None)
@JSON
def builds_command(as_json: bool, **asked: Any) -> None:
    """How far stature and limbs are off, before and after a build is fitted, with one camera, two or four."""
    from builds import builds, builds_lines

    _print(builds(**asked, progress=bar), builds_lines, as_json)


@click.command("footage")
@click.argument("video")
@click.option("--roi", callback=box, required=True, metavar="X,Y,W,H", help="Where the person is, in pixels.")
@click.option("--frames", callback=frame_range, metavar="A:B", help="Frames that are followed; by default all.")
@seeds(5)
@workers(None)
@JSON
def footage_command(as_json: bool, **asked: Any) -> None:
    """Tracks of a real walk in VIDEO, whose truth nobody knows: overlap, way and steps; and how fast that is."""
    from filmed.experiment import filmed, filmed_lines

    _print(filmed(**asked, progress=bar), filmed_lines, as_json)


@click.command("composites")
@click.argument("video")
@click.option("--situation", "situations", multiple=True, help="One alone, such as stands. Again for more of them.")
@click.option("--views", type=int, multiple=True, help="Cameras, 1, 2 or 4. Again for more of them.")
@click.option(
    "--extraction",
    "extractions",
    multiple=True,
    default=("mixture", "median", "mean"),
    show_default=True,
    help="How people are taken out, as in `posefit track`, settings behind: 'mixture history=90'. Again for more.",
)
@seeds(1, "Tracks of each, of other people in other clothes.")
@click.option("--quick", is_flag=True, help="One camera, somebody who passes and somebody who stands: a look.")
@click.option("--rows", metavar="FILE", help="A file for a row a line as they come; the same command goes on there.")
@click.option("--pictures", metavar="DIR", help="A folder for a picture a row.")
@workers(1)
@JSON
def composites_command(as_json: bool, **asked: Any) -> None:
    """Videos made from the truth, before the empty pictures of VIDEO, tracked as any footage."""
    from composites.experiment import composites
    from composites.tables import composites_lines

    _print(composites(**asked, progress=bar), composites_lines, as_json)


@click.command("people")
@click.option("--method", default="exemplars", show_default=True, help="A tracker, or OPTIMISER@PRIOR.")
@click.option("--evaluations", type=int, default=2440, show_default=True, help="Budget of a frame, of every method.")
@click.option("--others/--no-others", default=True, show_default=True, help="Whether other methods are compared.")
@click.option("--recovery", is_flag=True, help="Whoever is not seen for a while, instead: gaps, and coming back.")
@click.option("--quick", is_flag=True, help="Some 40 tracks, or 6 trials: a look, not a measurement.")
@click.option("--out", metavar="FILE", help="New file for a row a track, in JSON.")
@workers(None)
@LEDGER
@JSON
def people_command(recovery: bool, others: bool, ledger: str | None, as_json: bool, **asked: Any) -> None:
    """People whom a library of motions has never seen: walks, runs, jumps, turns, dances and everyday things."""
    from people import experiment, tables

    if recovery:
        if ledger is not None:
            raise ValueError("ledger must be given for tracks only, got --ledger with --recovery")
        _print(experiment.recovery(**asked, progress=bar), tables.recovery_lines, as_json)
    else:
        told = experiment.people(**asked, others=others, ledger=ledger, say=say, progress=bar)
        _print(told, tables.people_lines, as_json)


@click.command("posterior")
@click.option("--temperature", type=float, default=8.0, show_default=True, help="Of the posterior: 4, 8, 16 or 32.")
@click.option("--quick", is_flag=True, help="A few frames of every clip from one side: a look, not a measurement.")
@click.option("--again", metavar="FILE", help="Tracks that --out wrote, in place of following.")
@click.option("--out", metavar="FILE.npz", help="New file for the frames of all tracks.")
@click.option("--store", metavar="FILE.json", help="New file for what is learned of all people, for exemplars to read.")
@workers(None)
@JSON
def posterior_command(as_json: bool, **asked: Any) -> None:
    """How sure exemplars is of people whom it has never seen: intervals and modes."""
    from posterior import experiment, tables

    _print(experiment.posterior(**asked, progress=bar), tables.posterior_lines, as_json)


@click.command("lost")
@click.option("--method", default="exemplars", show_default=True, help="A tracker, or OPTIMISER@PRIOR: by its cost.")
@click.option("--quick", is_flag=True, help="Two clips of each group: a look, not a measurement.")
@click.option("--store", metavar="FILE.json", help="New file for the models that are fitted, for exemplars to read.")
@click.option("--rows", metavar="FILE", help="Fit to what --out wrote, and follow nobody.")
@click.option("--out", metavar="FILE", help="New file for a row a track, in JSON.")
@workers(None)
@JSON
def lost_command(as_json: bool, **asked: Any) -> None:
    """How well lost frames and swapped sides are told, of people whom neither library nor model has seen."""
    from lost import experiment, tables

    _print(experiment.lost(**asked, progress=bar), tables.lost_lines, as_json)


@click.command("modes")
@click.option("--instances", type=int, default=30, show_default=True, help="Of the niching task, held out ones.")
@click.option("--method", "methods", multiple=True, help="An optimiser; cma*16 is 16 searches. Again for more of them.")
@click.option("--evaluations", type=int, default=19520, show_default=True, help="Of every method, on each instance.")
@workers(None)
@JSON
def modes_command(as_json: bool, **asked: Any) -> None:
    """Who finds all poses of nearly one silhouette: peak ratio and calibration, by method, on the niching task."""
    from niches import niches, niches_lines

    _print(niches(**asked, progress=bar), niches_lines, as_json)


@click.command("agents")
@click.option("--environment", "environments", multiple=True, help="configure or fit; by default both.")
@click.option("--agent", "names", multiple=True, help="One alone, such as ppo, beside random search. Again for more.")
@seeds(5, "Trainings of each agent.")
@click.option("--steps", type=int, default=20_000, show_default=True, help="Of a training.")
@click.option("--instances", type=int, default=40, show_default=True, help="Held out, for the scores.")
@click.option("--quick", is_flag=True, help="Two trainings of 300 steps, four instances: a look, not a measurement.")
@click.option("--rows", metavar="FILE", help="A file for a row a line as they come; the same command goes on there.")
@workers(None)
@JSON
def agents_command(as_json: bool, **asked: Any) -> None:
    """Baseline agents of the environments on held-out instances: chance, constants, schedules, bandit, PPO and SAC."""
    from agents import experiment, tables

    _print(experiment.agents(**asked, progress=bar), tables.agents_lines, as_json)


def _print(told: dict[str, Any], lines: Callable[[dict[str, Any]], Iterable[str]], as_json: bool) -> None:
    for line in [json_line(told)] if as_json else lines(told):
        click.echo(line)
