"""The options that commands share, and how their values are read."""

from collections.abc import Callable, Sequence
from typing import Any

import click


def _size(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, int] | None:
    if value is None:
        return None
    width, _sign, height = value.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise click.BadParameter(f"expected WIDTHxHEIGHT such as 320x240, got {value!r}")
    return int(width), int(height)


def frame_range(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int | None, int | None]:
    """Return the ends of a range A:B, either of which may be left out."""
    if value is None:
        return None, None
    start, colon, stop = value.partition(":")
    try:
        if colon:
            return int(start) if start else None, int(stop) if stop else None
    except ValueError:
        pass
    raise click.BadParameter(f"expected A:B such as 0:50, :50 or 10:, got {value!r}")


def box(_: click.Context, __: click.Parameter, value: str | None) -> tuple[int, ...] | None:
    """Return the left, the top, the width and the height of X,Y,WIDTH,HEIGHT."""
    if value is None:
        return None
    parts = value.split(",")
    if len(parts) != 4 or not all(part.strip().isdigit() for part in parts):
        raise click.BadParameter(f"expected X,Y,WIDTH,HEIGHT in pixels such as 0,420,1400,570, got {value!r}")
    return tuple(map(int, parts))


def label(_: click.Context, __: click.Parameter, value: str | None) -> int | None:
    """Return the number that a label is: 15, or 0x800000 for a colour."""
    try:
        return None if value is None else int(value, 0)
    except ValueError:
        raise click.BadParameter(f"expected a whole number such as 15, or a colour 0xRRGGBB, got {value!r}") from None


EXTRACTION = (
    click.option(
        "--extraction",
        help="Of video: mixture, or mean with --background; else median, masks, or another of `posefit plugins`.",
    ),
    click.option("--background", metavar="A:B|IMAGE", help="Frames without the person, or an image."),
    click.option("--roi", callback=box, metavar="X,Y,W,H", help="Where the person is, in the video's pixels."),
    click.option("--ignore", metavar="IMAGE", help="Bright pixels are never known, such as a tree in front."),
    click.option("--width", type=int, help="Larger videos are scaled down to this; by default 640."),
)
CAMERAS = (
    click.option("--asf", metavar="FILE", help="Skeleton of SOURCE; by default the only .asf beside an .amc."),
    click.option("--camera", multiple=True, metavar="FILE", help="Calibration, one a view; guessed where absent."),
    click.option("--up", type=click.Choice(["x", "y", "z"]), help="Axis that points up in the calibration's world."),
)
VIEWS = (
    click.option(
        "--view-degrees",
        type=float,
        multiple=True,
        help="Where a camera stands: 0 in front, 90 to the side; repeatable.",
    ),
    click.option("--size", callback=_size, metavar="WxH", help="Image of a rendered motion, by default 320x240."),
    click.option("--fps", type=float, help="Rate to resample a motion to, or of masks; by default 30, or theirs."),
)
MASKS = (
    click.option("--label", callback=label, metavar="N", help="Of masks: the value or the colour that the person has."),
    click.option("--holes", type=float, metavar="SHARE", help="Fill holes up to this share of him; by default 0.02."),
)
HEIGHT = (click.option("--height", type=float, metavar="METRES", help="How tall the person in the footage stands."),)
WITHOUT = (
    click.option(
        "--without-subject", multiple=True, metavar="N", help="Leave a person of the library out; may be repeated."
    ),
)
TRACK = (
    click.argument("source", nargs=-1),
    *CAMERAS,
    click.option("--optimiser", help="By default sapso; see `posefit plugins`."),
    click.option("--prior", help="By default pca, or loose where the truth is not known; see `posefit plugins`."),
    click.option(
        "--tracker", help="Instead of optimiser and prior; exemplars where neither is named and the truth not known."
    ),
    click.option(
        "--set", "settings", multiple=True, metavar="NAME.SETTING=VALUE", help="Such as sapso.cooling=0.9; repeatable."
    ),
    click.option(
        "--train",
        multiple=True,
        metavar="SOURCE",
        help="What the method learns from: a motion, a folder, library, or library:16; may be repeated. By default "
        "library for exemplars where the truth is not known, else other styles of a built-in motion, or walks.",
    ),
    *WITHOUT,
    *VIEWS,
    click.option("--evaluations", type=int, help="Budget of a frame; by default N (C + 1) = 2440."),
    click.option("--particles", type=int, help="N, by default 40."),
    click.option("--iterations", type=int, help="C, by default 60."),
    click.option("--first-pose", default="searched", show_default=True, help="searched, or given (the true one)."),
    click.option("--ask-seconds", type=float, help="How long a plugin may take to propose a population."),
    click.option("--translation", help="Root translation: known, searched or aligned."),
    *HEIGHT,
    click.option("--restarts", type=int, help="Searches of a first pose nobody knows: 8, or 0 for exemplars."),
    click.option(
        "--body-frames",
        type=int,
        help="Frames a build is fitted to, every third; by default 12 for footage, 0 for none.",
    ),
    *EXTRACTION,
    *MASKS,
    click.option("--tracks", type=int, default=1, show_default=True, help="Tracks of other beginnings; one is kept."),
    click.option(
        "--steady/--no-steady",
        default=None,
        help="The root goes smoothly, and feet that stand do not slide; by default so for footage.",
    ),
    click.option("--passes", type=int, default=1, show_default=True, help="How often a steady track is followed."),
    click.option("--seed", type=int, default=0, show_default=True),
    click.option("--threads", type=int, default=1, show_default=True, help="The result is the same with any number."),
    click.option("--device", default="cpu", show_default=True, help="Where poses are drawn: cpu, or cuda with a GPU."),
    click.option("--out", metavar="DIR", help="Write poses, table, video and picture to this new folder."),
    click.option("--force", is_flag=True, help="Replace DIR where it holds earlier results."),
    click.option("--resume", is_flag=True, help="Go on with the track to DIR that ended too early."),
    click.option("--rerun", metavar="FILE", help="Write a recording (.rrd) for the Rerun viewer."),
    click.option("--json", "as_json", is_flag=True, help="Print one JSON object and nothing else on stdout."),
)


ENGINE = (
    click.option("--workers", type=int, metavar="N", help="Processes of this machine; by default one a core."),
    click.option("--dask-local", type=int, metavar="N", help="Dask workers on this machine instead."),
    click.option("--dask-dashboard", is_flag=True, help="Show these workers on Dask's page, to this machine alone."),
    click.option("--scheduler", metavar="ADDRESS", help="A Dask scheduler instead, such as tcp://host:8786."),
    click.option("--cell-seconds", type=float, default=3600.0, show_default=True, help="How long a cell may take."),
    click.option(
        "--cell-gigabytes", type=float, default=4.0, show_default=True, help="How much memory a cell may have."
    ),
)


def options(chosen: Sequence[Callable[..., Any]]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that gives a command some options."""

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        for option in reversed(chosen):
            command = option(command)
        return command

    return decorate
