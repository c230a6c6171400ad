"""Options that commands share. Options of a track are built from `TrackOptions`."""

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from typing import Any

import click
from click.shell_completion import CompletionItem

from posefit.errors import InputError
from posefit.footage.options import text_range
from posefit.options import declared
from posefit.reading import quoted
from posefit.tracking.options import TrackOptions

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def parsed_by(
    parse: Callable[[str], Any],
) -> Callable[[click.Context, click.Parameter, Any], Any]:
    """Return a click callback that parses an option's text, or each of its texts.

    A ValueError becomes a message about the option.
    """

    def callback(
        _context: click.Context, _parameter: click.Parameter, value: Any
    ) -> Any:
        try:
            if isinstance(value, tuple):
                return tuple(map(parse, value))
            if value is None:
                return None
            return parse(value)
        except ValueError as error:
            raise click.BadParameter(str(error)) from None

    return callback


def methods_from(
    _context: click.Context, _parameter: click.Parameter, begun: str
) -> list[str]:
    """Return the methods with a given beginning, for a shell to complete."""
    from posefit.registry import registry

    offers = registry().offers
    optimiser, at, _ = begun.partition("@")
    names = [*offers["tracker"], *offers["optimiser"]]
    if at:
        names = [f"{optimiser}@{prior}" for prior in offers["prior"]]
    return [name for name in names if name.startswith(begun)]


def sources_from(
    _context: click.Context, _parameter: click.Parameter, begun: str
) -> list[CompletionItem]:
    """Return the motions with a given beginning, and have the shell add files."""
    from posefit.motion import built_in

    # recorded motions are left out: 216 names would bury the user's own files
    names = []
    for name in built_in.names():
        if name.startswith(begun):
            names.append(CompletionItem(name))
    return [*names, CompletionItem(begun, type="file")]


# options whose values a shell completes
COMPLETED = {"method": methods_from, "train": sources_from}


def number_by(parse: Callable[[str], float]) -> Callable[[str], float]:
    """Return a function that parses a number, with `expected` in its message.

    With `int` for `parse` the number must be whole.
    """

    def read(text: str) -> float:
        try:
            return parse(text)
        except ValueError:
            expected = "a number such as 1.75"
            if parse is int:
                expected = "a whole number such as 30"
            raise InputError(f"expected {expected}, got {quoted(str(text))}") from None

    return read


class Flag(click.Option):
    """An option that is listed under a heading in the help."""

    def __init__(self, *words: Any, heading: str = "Others", **more: Any) -> None:
        super().__init__(*words, **more)
        self.heading = heading


def under(heading: str) -> Callable[..., Decorator]:
    """Return a decorator for options that are listed under a heading."""
    return partial(click.option, cls=Flag, heading=heading)


class TrackCommand(click.Command):
    """A command with the options of a track, listed under headings in the help."""

    def format_options(
        self, context: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the options, those without a heading last."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for flag in self.get_params(context):
            if not isinstance(flag, click.Option):
                continue
            if record := flag.get_help_record(context):
                heading = getattr(flag, "heading", "Others")
                sections.setdefault(heading, []).append(record)
        sections["Others"] = sections.pop("Others", [])
        for heading, rows in sections.items():
            with formatter.section(heading):
                formatter.write_dl(rows)


def track_flags(*names: str) -> list[Decorator]:
    """Return the click options of some options of a track.

    Args:
        names: The options, by default all that the command line has.
    """
    flags: list[Decorator] = []
    heading = ""
    for field in fields(TrackOptions):
        option = declared(field)
        default = field.default
        heading = option.heading or heading
        if names:
            unwanted = field.name not in names
        else:
            unwanted = option.flag == ""
        if unwanted:
            continue
        flag = (option.flag or field.name).replace("_", "-")
        make = under(heading)
        words: dict[str, Any] = {
            "help": option.help,
            "shell_complete": COMPLETED.get(field.name),
        }
        if option.parse is bool:
            flags.append(
                make(f"--{flag}/--no-{flag}", field.name, default=None, **words)
            )
            continue
        words |= {"metavar": option.unit or None, "multiple": option.repeated}
        if option.parse in (int, float):
            kind = "INTEGER" if option.parse is int else "FLOAT"
            words["metavar"] = option.unit or kind
            # click's own message for a wrong number has no example
            words |= {"type": str, "callback": parsed_by(number_by(option.parse))}
        else:
            words["callback"] = parsed_by(option.parse)
        # None means that the default depends on the source; the help describes it
        if not isinstance(default, tuple) and default is not None:
            words |= {"default": default, "show_default": True}
        flags.append(make(f"--{flag}", field.name, **words))
    return flags


def box(text: str) -> tuple[int, ...]:
    """Return left, top, width and height from a text X,Y,WIDTH,HEIGHT."""
    parts = text.split(",")
    if len(parts) != 4 or not all(part.strip().isdigit() for part in parts):
        raise InputError(
            "expected X,Y,WIDTH,HEIGHT in pixels such as 0,420,1400,570, "
            f"got {quoted(text)}"
        )
    return tuple(map(int, parts))


_video = under("How the person is segmented in video")
_result = under("Results")
FRAMES = under("Source and camera")(
    "--frames",
    default=":",
    callback=parsed_by(text_range),
    metavar="A:B",
    help="Use only frames A to B - 1. Footage is numbered as filmed, a motion "
    "after resampling.",
)
JSON = _result(
    "--json",
    "as_json",
    is_flag=True,
    help="Print only one JSON object on stdout.",
)
QUIET = _result("--quiet", is_flag=True, help="Print only the result.")
EXTRACTION = (
    _video(
        "--extraction",
        help=(
            "How to segment video: mixture by default, mean with --background; or "
            "median, masks, or another segmenter of `posefit plugins`."
        ),
    ),
    _video(
        "--background",
        metavar="A:B|IMAGE",
        help="Frames without the person, or an image of the empty scene.",
    ),
    _video(
        "--roi",
        callback=parsed_by(box),
        metavar="X,Y,W,H",
        help="Region of the video that contains the person, in pixels.",
    ),
    _video(
        "--ignore",
        metavar="IMAGE",
        help="Image whose bright pixels are ignored, such as a tree in front.",
    ),
    _video(
        "--width",
        type=int,
        help="Scale wider videos down to this width, in pixels. Default: 640.",
    ),
)
WITHOUT = under("Method and budget")(
    "--without-subject",
    multiple=True,
    metavar="N",
    help="Leave a person out of the library; repeatable.",
)
TRACK: tuple[Any, ...] = (
    click.argument("source", nargs=-1, shell_complete=sources_from),
    *track_flags(),
    WITHOUT,
    *EXTRACTION,
    _result(
        "--out",
        metavar="DIR",
        help="Write poses, tables, video and pictures to this new folder.",
    ),
    _result(
        "--write",
        default="",
        metavar="KIND,...",
        help="Write only summary.json and these files, such as bvh,trc. Default: all.",
    ),
    _result("--force", is_flag=True, help="Replace earlier results in DIR."),
    _result(
        "--resume",
        is_flag=True,
        help="Continue the interrupted track to DIR.",
    ),
    _result("--verbose", is_flag=True, help="Print all figures instead of a summary."),
    QUIET,
    JSON,
)
ENGINE = (
    click.option(
        "--workers",
        type=int,
        metavar="N",
        help="Processes on this machine; by default one per core.",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Run on a Dask scheduler instead, such as tcp://host:8786.",
    ),
    click.option(
        "--cell-seconds",
        type=float,
        default=3600.0,
        show_default=True,
        help="Time limit of a cell.",
    ),
    click.option(
        "--cell-gigabytes",
        type=float,
        default=4.0,
        show_default=True,
        help="Memory limit of a cell.",
    ),
)


def options(chosen: Sequence[Decorator]) -> Decorator:
    """Return a decorator that adds options to a command."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(chosen):
            command = option(command)
        return command

    return decorate
