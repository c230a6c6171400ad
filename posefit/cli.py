"""The command line. Messages and progress go to stderr, results to stdout; a mistake is one line and exit status 2."""

import json
import sys
from collections.abc import Iterator
from functools import partial
from typing import Any

import click

from posefit import __version__
from posefit.options import ENGINE, EXTRACTION, TRACK, frame_range, options


class _Mistakes(click.Group):
    """Turns the errors that users can make into one line on stderr."""

    def invoke(self, context: click.Context) -> Any:
        try:
            return super().invoke(context)
        except click.UsageError as error:
            click.echo(f"posefit: {' '.join(error.format_message().split())}", err=True)
            context.exit(2)
        except (ValueError, FileNotFoundError, PermissionError, ImportError) as error:
            click.echo(f"posefit: {' '.join(str(error).split())}", err=True)
            context.exit(2)


@click.group(cls=_Mistakes, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="posefit")
def main() -> None:
    """Recover a person's 3D pose from silhouettes, by searching."""


@main.command()
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
    from posefit.study.run import track as run

    result = run(progress=_progress, say=_say, **_arguments(options))
    if as_json:
        click.echo(json.dumps(result.summary))
        return
    from posefit.study.table import table

    click.echo(table(result.summary))
    if options["out"]:
        click.echo(f"written to {options['out']}: watch overlay.mp4, look at summary.png")


@main.command()
@options(TRACK)
@click.option("--frame", type=int, default=0, show_default=True, metavar="K", help="The frame, after resampling.")
def fit(as_json: bool, **options: Any) -> None:
    """Find the pose in one frame of SOURCE."""
    from posefit.study.run import fit as run

    result = run(say=_say, **_arguments(options))
    if as_json:
        click.echo(json.dumps({**result.summary, "pose_degrees": _degrees(result.pose)}))
        return
    from posefit.study.table import table

    click.echo(table(result.summary))
    if options["out"]:
        click.echo(f"written to {options['out']}: look at summary.png")


@main.command()
@click.argument("video")
@click.option("--out", required=True, metavar="DIR", help="New folder for masks.npz, preview.mp4 and quality.csv.")
@click.option(
    "--method", default="mixture", show_default=True, help="mixture, median, mean, or masks: the frames are masks."
)
@options(EXTRACTION)
@click.option("--frames", callback=frame_range, metavar="A:B", help="Only these frames.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def extract(video: str, out: str, as_json: bool, frames: Any, **options: Any) -> None:
    """Take the masks of one person out of a VIDEO before a still background."""
    from posefit.study.extract import extract as run
    from posefit.study.segment import Extraction

    result = run(video, out, Extraction(**options), frames=frames, progress=_progress)
    for warning in result["warnings"]:
        _say(f"warning: {warning}")
    if as_json:
        click.echo(json.dumps(result))
        return
    click.echo(
        f"{result['frames']} frames, {result['usable']} usable, {result['touching_border']} touch the border, "
        f"{result['in_pieces']} in pieces; written to {out}: watch preview.mp4"
    )


@main.command()
@click.option("--threads", type=int, help="How many `all threads` are; by default every core.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench(threads: int | None, as_json: bool) -> None:
    """Time the kernel, the OpenCV way, a SAPSO frame and every optimiser's ask and tell, all in one run."""
    from posefit.study.bench import bench as run

    if threads is not None and threads < 1:
        raise ValueError(f"threads must be at least 1, got {threads}")
    _say("timing; this takes half a minute ...")
    figures = run(threads)
    if as_json:
        click.echo(json.dumps(figures))
        return
    for group in ("vector_env", "optimisers"):
        figures |= {f"{group}.{name}": value for name, value in figures.pop(group).items()}
    for name, value in figures.items():
        click.echo(f"{name:38} {value:.4g}" if isinstance(value, float) else f"{name:38} {value}")


@main.command()
@click.argument("plan")
@click.option("--out", metavar="DIR", help="The ledger: a new folder, or one that a sweep goes on in.")
@options(ENGINE)
@click.option("--dry-run", is_flag=True, help="Print the cells and about how long they take, and run none.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
@click.pass_context
def sweep(context: click.Context, /, plan: str, out: str | None, dry_run: bool, as_json: bool, **where: Any) -> None:
    """Run the cells of PLAN: methods, motions, views, corruptions and seeds.

    PLAN is a .toml file, `default`, or - for standard input. A sweep may be killed at any moment, and any number of
    them may work on one DIR: the same command goes on where it was.
    Exit status 1 where cells were quarantined after three attempts, 130 where somebody stopped it.
    """
    from posefit.sweep import command
    from posefit.sweep.limits import Limits

    limits = Limits(where.pop("cell_seconds"), where.pop("cell_gigabytes"))
    if dry_run:
        found = command.preview(plan, out, limits=limits, **where)
        if as_json:
            click.echo(json.dumps(found))
            return
        for line in command.listed(found):
            click.echo(line)
        return
    if out is None:
        raise click.UsageError("--out must name a folder for the results, got none")
    tally, status = command.sweep(plan, out, limits=limits, say=_say, **where)
    click.echo(json.dumps({"out": out, **vars(tally)}) if as_json else command.told(tally, out))
    context.exit(status)


@main.command()
@click.argument("ledger", metavar="DIR")
@click.option("--out", required=True, metavar="FILE.html", help="The page; an earlier report is replaced.")
@click.option("--figures", metavar="DIR", help="New folder for figures and tables of a paper; needs posefit[figures].")
@click.option("--iohprofiler", metavar="DIR", help="New folder for IOHprofiler's files.")
@click.option("--csv", metavar="FILE", help="New file of all rows.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def report(ledger: str, out: str, as_json: bool, **others: Any) -> None:
    """Write what a sweep to DIR found as one page that any browser opens, offline.

    It may be written while the sweep goes on, of the cells that are done.
    """
    from posefit.sweep.reporting import report as run
    from posefit.sweep.reporting import told

    found = run(ledger, out, say=_say, **others)
    for line in [json.dumps(found)] if as_json else told(found):
        click.echo(line)


@main.group()
def reproduce() -> None:
    """Repeat the experiments of the publications that posefit follows."""


@reproduce.command()
@click.option("--seeds", type=int, default=10, show_default=True, help="Sequences, each in other phases and views.")
@click.option("--searches", is_flag=True, help="Compare with SAPSO and with the joined tracker too; minutes more.")
@click.option("--out", metavar="DIR", help="New folder for report.json and the figures; needs posefit[figures].")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout.")
def vsmm(seeds: int, searches: bool, out: str | None, as_json: bool) -> None:
    """Stepping, waving, jumping jacks and squats: the experiment of CN101894278, against an IMM over all models."""
    from posefit.study.patent_report import report, table

    figures = report(seeds, searches, out, partial(_progress, unit="run"))
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
    from posefit.study.paper import QUICK, Scale
    from posefit.sweep.paper_report import report, text

    told = report(clips, seeds, QUICK if quick else Scale(), out, partial(_progress, unit="run"))
    click.echo(json.dumps(told) if as_json else text(told))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(told['figures'])}")


@main.group(invoke_without_command=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON array.")
@click.pass_context
def plugins(context: click.Context, as_json: bool) -> None:
    """List the optimisers, priors and trackers that are installed, with their settings."""
    if context.invoked_subcommand is not None:
        return
    from posefit.registry import KINDS, registry
    from posefit.study.plugins import described, listing

    if as_json:
        offers = registry().offers
        click.echo(json.dumps([described(offer) for kind in KINDS for offer in offers[kind].values()]))
        return
    for line in listing(registry()):
        click.echo(line)


@plugins.command()
@click.pass_context
def doctor(context: click.Context) -> None:
    """Say of every plugin whether it works, and what to do where it does not; exit status 1 where one is broken."""
    import warnings

    from posefit.registry import registry
    from posefit.study.plugins import diagnosis

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the same is said below
        lines, well = diagnosis(registry())
    click.echo("\n".join(lines))
    context.exit(0 if well else 1)


@plugins.command()
@click.argument("name")
@click.option("--kind", default="optimiser", show_default=True, help="optimiser, prior or tracker.")
@click.option("--out", metavar="DIR", help="The new folder; by default posefit-NAME.")
def new(name: str, kind: Any, out: str | None) -> None:
    """Write a small plugin to start from: it installs, works and has a test that passes."""
    from posefit.study.plugins import new as write

    folder = write(name, kind, out)
    click.echo(f"written to {folder}; next: cd {folder} && python -m pip install -e '.[test]' && python -m pytest")


@main.command()
@click.argument("kind", type=click.Choice(["optimiser", "prior", "tracker"]))
@click.argument("name")
@click.option("--set", "settings", multiple=True, metavar="SETTING=VALUE", help="Check it with this setting.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@click.pass_context
def check(context: click.Context, kind: Any, name: str, settings: tuple[str, ...], as_json: bool) -> None:
    """Check that an installed plugin keeps the rules of its kind; exit status 1 where it breaks one."""
    from posefit.study.plugins import checked

    report = checked(kind, name, settings)
    if as_json:
        results = [{"check": one.name, "outcome": one.outcome, "detail": one.detail} for one in report.results]
        click.echo(json.dumps({"plugin": report.plugin, "summary": report.summary, "results": results}))
    else:
        click.echo(str(report))
    context.exit(0 if report else 1)


def _arguments(options: dict[str, Any]) -> dict[str, Any]:
    """Return the keywords of `posefit.track` that options stand for.

    `--set` gives the settings of optimiser, prior and tracker, as their types ask; `tracker.` also sets the tracker
    that an optimiser and a prior are driven by.
    """
    from posefit.study.method import parse_settings
    from posefit.study.run import prior_of
    from posefit.study.segment import Extraction

    context = click.get_current_context()
    for name in ("optimiser", "prior"):
        if options["tracker"] and context.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT:
            raise ValueError(f"{name} must not be given beside a tracker, got {options[name]} and {options['tracker']}")
    how = {name: options.pop(name) for name in ("background", "roi", "ignore", "width")}
    options["extraction"] = Extraction(method=options["extraction"], **how)
    options["source"] = options["source"] or ("walk",)
    options["view_degrees"] = options["view_degrees"] or None
    prior = options["prior"] or prior_of(options["source"][0])
    return options | parse_settings(options.pop("settings"), options["optimiser"], prior, options["tracker"])


def _say(message: str) -> None:
    click.echo(message, err=True)


def _progress(frames: Iterator[Any], count: int, unit: str = "frame") -> Iterator[Any]:
    from tqdm import tqdm

    return iter(tqdm(frames, total=count, unit=unit, file=sys.stderr, dynamic_ncols=True))


def _degrees(pose: Any) -> list[float]:
    import numpy as np

    return [round(float(angle), 6) for angle in np.degrees(pose)]
