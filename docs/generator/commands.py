"""The page of the command line: what `--help` prints, of every command; what `track` has is there once."""

import re
from collections.abc import Iterator

import click

from posefit.cli import main

WIDTH = 78  # columns: what click takes of a terminal of 80 or more
FEW = 4  # options that a command may share with `posefit track` and list all the same
_HELP = re.compile(r"(\n\n[A-Z][\w ]*:)?\n  -h, --help +Show this message and exit\.(?=\n|\Z)")


def page() -> str:
    """Return every command with its help, as Markdown; without the option `--help`, which all have."""
    parts = ((name, _HELP.sub("", text), more) for name, text, more in _helps(shared=False))
    return "\n\n".join(f"## `{name}`\n\n```text\n{text}\n```{more}" for name, text, more in parts) + "\n"


def helps() -> dict[str, str]:
    """Return what `--help` prints of every command, a group before what it holds."""
    return {name: text for name, text, _ in _helps(shared=True)}


def _helps(shared: bool) -> Iterator[tuple[str, str, str]]:
    """Yield every command, its help and what comes after; without the options that `posefit track` has, too."""
    context = click.Context(main, info_name="posefit", terminal_width=WIDTH, **main.context_settings)
    tracked = main.get_command(context, "track")
    assert tracked is not None
    known = set() if shared else {option.get_help_record(context) for option in _flags(tracked)}
    for name, command, inner in _of(main, context):
        mine = [option for option in _flags(command) if option.get_help_record(inner) in known]
        if command is tracked or len(mine) < FEW:
            yield name, command.get_help(inner), ""
            continue
        for option in mine:
            option.hidden = True
        flags = ", ".join(f"`{option.opts[0]}`" for option in mine)
        yield name, command.get_help(inner), f"\n\nAs in `posefit track`: {flags}."
        for option in mine:
            option.hidden = False


def _flags(command: click.Command) -> list[click.Option]:
    return [option for option in command.params if isinstance(option, click.Option)]


def _of(command: click.Command, context: click.Context) -> Iterator[tuple[str, click.Command, click.Context]]:
    yield context.command_path, command, context
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from _of(inner, type(context)(inner, parent=context, info_name=name))
