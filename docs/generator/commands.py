"""The page of the command line: what `--help` prints, of every command."""

from collections.abc import Iterator

import click

from posefit.cli import main

WIDTH = 78  # columns: what click takes of a terminal of 80 or more


def page() -> str:
    """Return every command with its help, as Markdown."""
    return "\n\n".join(f"## `{name}`\n\n```text\n{text}\n```" for name, text in helps()) + "\n"


def helps() -> Iterator[tuple[str, str]]:
    """Yield every command and what `--help` prints of it, a group before what it holds."""
    yield from _of(main, click.Context(main, info_name="posefit", terminal_width=WIDTH, **main.context_settings))


def _of(command: click.Command, context: click.Context) -> Iterator[tuple[str, str]]:
    yield context.command_path, command.get_help(context)
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from _of(inner, type(context)(inner, parent=context, info_name=name))
