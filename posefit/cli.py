"""The command line. Messages and progress go to stderr, results to stdout; a mistake is one line and exit status 2."""

import json
import sys
from collections.abc import Callable, Iterator
from typing import Any

import click

from posefit import __version__


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


def _size(_: click.Context, __: click.Parameter, value: str) -> tuple[int, int]:
    width, _sign, height = value.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise click.BadParameter(f"expected WIDTHxHEIGHT such as 320x240, got {value!r}")
    return int(width), int(height)


def _range(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int | None, int | None]:
    if value is None:
        return None, None
    start, colon, stop = value.partition(":")
    try:
        if colon:
            return int(start) if start else None, int(stop) if stop else None
    except ValueError:
        pass
    raise click.BadParameter(f"expected A:B such as 0:50, :50 or 10:, got {value!r}")


def _box(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, ...] | None:
    if value is None:
        return None
    parts = value.split(",")
    if len(parts) != 4 or not all(part.strip().isdigit() for part in parts):
        raise click.BadParameter(f"expected X,Y,WIDTH,HEIGHT in pixels such as 0,420,1400,570, got {value!r}")
    return tuple(map(int, parts))


_OPTIONS = (
    click.argument("source", nargs=-1),
    click.option("--asf", metavar="FILE", help="Skeleton of SOURCE; by default the only .asf beside an .amc."),
    click.option("--camera", multiple=True, metavar="FILE", help="Calibration, one a view; guessed where absent."),
    click.option("--up", type=click.Choice(["x", "y", "z"]), help="Axis that points up in the calibration's world."),
    click.option("--optimiser", default="sapso", show_default=True, help="See `posefit plugins`."),
    click.option("--prior", help="By default pca, or loose where the truth is not known; see `posefit plugins`."),
    click.option("--tracker", help="A tracker instead of optimiser and prior; see `posefit plugins`."),
    click.option(
        "--set", "settings", multiple=True, metavar="NAME.SETTING=VALUE", help="Such as sapso.cooling=0.9; repeatable."
    ),
    click.option("--train", multiple=True, metavar="SOURCE", help="Motion the prior learns from; may be repeated."),
    click.option(
        "--view-degrees",
        type=float,
        multiple=True,
        help="Where a camera stands: 0 in front, 90 to the side; repeatable.",
    ),
    click.option("--size", default="320x240", show_default=True, callback=_size, help="Image of a rendered motion."),
    click.option("--fps", type=float, default=30.0, show_default=True, help="Rate to resample a motion to."),
    click.option("--evaluations", type=int, help="Budget of a frame; by default N (C + 1) = 2440."),
    click.option("--particles", type=int, help="N, by default 40."),
    click.option("--iterations", type=int, help="C, by default 60."),
    click.option("--first-pose", default="searched", show_default=True, help="searched, or given (the true one)."),
    click.option("--ask-seconds", type=float, help="How long a plugin may take to propose a population."),
    click.option("--translation", help="Root translation: known, searched or aligned."),
    click.option("--height", type=float, metavar="METRES", help="How tall the person in the footage stands."),
    click.option("--restarts", type=int, help="Searches of a first pose nobody knows; by default 8."),
    click.option("--body-frames", type=int, help="Frames a build is fitted to; by default 30 for footage, 0 for none."),
    click.option(
        "--extraction", default="mixture", show_default=True, help="Of video: mixture, median, mean, or masks."
    ),
    click.option("--background", metavar="A:B|IMAGE", help="For mean: frames without the person, or an image."),
    click.option("--roi", callback=_box, metavar="X,Y,W,H", help="Where the person is, in the video's pixels."),
    click.option("--ignore", metavar="IMAGE", help="Bright pixels are never known, such as a tree in front."),
    click.option("--width", type=int, default=640, show_default=True, help="Larger videos are scaled down to this."),
    click.option("--seed", type=int, default=0, show_default=True),
    click.option("--threads", type=int, default=1, show_default=True, help="The result is the same with any number."),
    click.option("--out", metavar="DIR", help="Write poses, table, video and picture to this new folder."),
    click.option("--force", is_flag=True, help="Replace DIR where it holds earlier results."),
    click.option("--resume", is_flag=True, help="Go on with the track to DIR that ended too early."),
    click.option("--rerun", metavar="FILE", help="Write a recording (.rrd) for the Rerun viewer."),
    click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout."),
)


def _common(command: Callable[..., None]) -> Callable[..., None]:
    for option in reversed(_OPTIONS):
        command = option(command)
    return command


@click.group(cls=_Mistakes, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="posefit")
def main() -> None:
    """Recover a person's 3D pose from silhouettes, by searching."""


@main.command()
@_common
@click.option(
    "--frames",
    callback=_range,
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
@_common
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
@click.option("--background", metavar="A:B|IMAGE", help="For mean: frames without the person, or an image.")
@click.option("--roi", callback=_box, metavar="X,Y,W,H", help="Where the person is, in the video's pixels.")
@click.option("--ignore", metavar="IMAGE", help="Bright pixels are never known, such as a tree in front.")
@click.option("--frames", callback=_range, metavar="A:B", help="Only these frames.")
@click.option("--width", type=int, default=640, show_default=True, help="Scale larger videos down to this.")
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

    how = {name: options.pop(name) for name in ("background", "roi", "ignore", "width")}
    options["extraction"] = Extraction(method=options["extraction"], **how)
    options["source"] = options["source"] or ("walk",)
    options["view_degrees"] = options["view_degrees"] or None
    prior = options["prior"] or prior_of(options["source"][0])
    return options | parse_settings(options.pop("settings"), options["optimiser"], prior, options["tracker"])


def _say(message: str) -> None:
    click.echo(message, err=True)


def _progress(frames: Iterator[Any], count: int) -> Iterator[Any]:
    from tqdm import tqdm

    return iter(tqdm(frames, total=count, unit="frame", file=sys.stderr, dynamic_ncols=True))


def _degrees(pose: Any) -> list[float]:
    import numpy as np

    return [round(float(angle), 6) for angle in np.degrees(pose)]
