"""The options that commands share: those of a track are made of their one declaration, `TrackOptions`."""

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import partial
from typing import Any

import click
from click.shell_completion import CompletionItem

from posefit.errors import InputError
from posefit.reading import quoted
from posefit.tracking.options import TrackOptions, declared, text_range

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def parsed_by(
    parse: Callable[[str], Any],
) -> Callable[[click.Context, click.Parameter, Any], Any]:
    """Return a click callback that parses an option's text, or each of several, and shows what is wrong with it."""

    def callback(
        _context: click.Context, _parameter: click.Parameter, value: Any
    ) -> Any:
        try:
            if isinstance(value, tuple):
                return tuple(map(parse, value))
            return None if value is None else parse(value)
        except ValueError as error:
            raise click.BadParameter(str(error)) from None

    return callback


def methods_from(
    _context: click.Context, _parameter: click.Parameter, begun: str
) -> list[str]:
    """Return the methods that begin so, for a shell to complete."""
    from posefit.registry import registry

    offers = registry().offers
    optimiser, at, _ = begun.partition("@")
    names = (
        [f"{optimiser}@{prior}" for prior in offers["prior"]]
        if at
        else [*offers["tracker"], *offers["optimiser"]]
    )
    return [name for name in names if name.startswith(begun)]


def sources_from(
    _context: click.Context, _parameter: click.Parameter, begun: str
) -> list[CompletionItem]:
    """Return the built-in motions that begin so, and have the shell add files."""
    from posefit.motion import built_in

    names = [
        CompletionItem(name) for name in built_in.names() if name.startswith(begun)
    ]
    return [*names, CompletionItem(begun, type="file")]


# options whose values a shell completes
COMPLETED = {"method": methods_from, "train": sources_from}


def number_by(parse: Callable[[str], float]) -> Callable[[str], float]:
    """Return a function that reads a number, a whole one where `parse` is int, and says what it expected."""

    def read(text: str) -> float:
        try:
            return parse(text)
        except ValueError:
            expected = (
                "a whole number such as 30" if parse is int else "a number such as 1.75"
            )
            raise InputError(f"expected {expected}, got {quoted(str(text))}") from None

    return read


class Flag(click.Option):
    """An option that the help of its command lists under a heading."""

    def __init__(self, *words: Any, heading: str = "Others", **more: Any) -> None:
        super().__init__(*words, **more)
        self.heading = heading


def under(heading: str) -> Callable[..., Decorator]:
    """Return what makes options that are listed under a heading."""
    return partial(click.option, cls=Flag, heading=heading)


class TrackCommand(click.Command):
    """A command with the options of a track, whose help lists them under headings."""

    def format_options(
        self, context: click.Context, formatter: click.HelpFormatter
    ) -> None:
        """Write the options: those of no heading last."""
        sections: dict[str, list[tuple[str, str]]] = {}
        for flag in self.get_params(context):
            if isinstance(flag, click.Option) and (
                record := flag.get_help_record(context)
            ):
                sections.setdefault(getattr(flag, "heading", "Others"), []).append(
                    record
                )
        sections["Others"] = sections.pop("Others", [])
        for heading, rows in sections.items():
            with formatter.section(heading):
                formatter.write_dl(rows)


def track_flags(*names: str) -> list[Decorator]:
    """Return the click options of some options of a track; without names, of all that the command line has."""
    flags: list[Decorator] = []
    heading = ""
    for field in fields(TrackOptions):
        option = declared(field)
        default = field.default
        heading = option.heading or heading
        if (field.name not in names) if names else option.flag == "":
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
            words["metavar"] = option.unit or (
                "INTEGER" if option.parse is int else "FLOAT"
            )
            words |= {"type": str, "callback": parsed_by(number_by(option.parse))}
        else:
            words["callback"] = parsed_by(option.parse)
        if not isinstance(default, tuple) and default is not None:
            words |= {"default": default, "show_default": True}
        flags.append(make(f"--{flag}", field.name, **words))
    return flags


def box(text: str) -> tuple[int, ...]:
    """Return the left, the top, the width and the height of a text X,Y,WIDTH,HEIGHT."""
    parts = text.split(",")
    if len(parts) != 4 or not all(part.strip().isdigit() for part in parts):
        raise InputError(
            f"expected X,Y,WIDTH,HEIGHT in pixels such as 0,420,1400,570, got {quoted(text)}"
        )
    return tuple(map(int, parts))


_video = under("How the person is taken out of video")
_result = under("Results")
FRAMES = under("What is seen")(
    "--frames",
    default=":",
    callback=parsed_by(text_range),
    metavar="A:B",
    help="Only these frames: of footage as filmed, of a motion after resampling.",
)
JSON = _result(
    "--json",
    "as_json",
    is_flag=True,
    help="Print one JSON object and nothing else on stdout.",
)
QUIET = _result(
    "--quiet", is_flag=True, help="No messages and no bars, only the result."
)
EXTRACTION = (
    _video(
        "--extraction",
        help="Of video: mixture, or mean with --background; else median, masks, or another of `posefit plugins`.",
    ),
    _video(
        "--background",
        metavar="A:B|IMAGE",
        help="Frames without the person, or an image.",
    ),
    _video(
        "--roi",
        callback=parsed_by(box),
        metavar="X,Y,W,H",
        help="Where the person is, in the video's pixels.",
    ),
    _video(
        "--ignore",
        metavar="IMAGE",
        help="Bright pixels are never known, such as a tree in front.",
    ),
    _video(
        "--width",
        type=int,
        help="Larger videos are scaled down to this; by default 640.",
    ),
)
WITHOUT = under("Method and budget")(
    "--without-subject",
    multiple=True,
    metavar="N",
    help="Leave a person of the library out; may be repeated.",
)
TRACK: tuple[Any, ...] = (
    click.argument("source", nargs=-1, shell_complete=sources_from),
    *track_flags(),
    WITHOUT,
    *EXTRACTION,
    _result(
        "--out",
        metavar="DIR",
        help="Write poses, table, video and picture to this new folder.",
    ),
    _result(
        "--write",
        default="",
        metavar="KIND,...",
        help="Only these files, such as bvh,trc,html, and summary.json; by default all.",
    ),
    _result(
        "--force", is_flag=True, help="Replace DIR where it holds earlier results."
    ),
    _result(
        "--resume",
        is_flag=True,
        help="Go on with the track to DIR that ended too early.",
    ),
    _result("--verbose", is_flag=True, help="Print all figures, not three lines."),
    QUIET,
    JSON,
)
ENGINE = (
    click.option(
        "--workers",
        type=int,
        metavar="N",
        help="Processes of this machine; by default one a core.",
    ),
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="A Dask scheduler instead, such as tcp://host:8786.",
    ),
    click.option(
        "--cell-seconds",
        type=float,
        default=3600.0,
        show_default=True,
        help="How long a cell may take.",
    ),
    click.option(
        "--cell-gigabytes",
        type=float,
        default=4.0,
        show_default=True,
        help="How much memory a cell may have.",
    ),
)


def options(chosen: Sequence[Decorator]) -> Decorator:
    """Return a decorator that gives a command some options."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        for option in reversed(chosen):
            command = option(command)
        return command

    return decorate
