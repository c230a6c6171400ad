"""The list of the command line: the `--help` of every command."""

from collections.abc import Iterator

import click

from posefit.cli import main

WIDTH = 78  # columns that click uses on a terminal of 80 or more


def page() -> str:
    """Return every command with its help, as Markdown."""
    return (
        "\n\n".join(
            f"## `{name}`\n\n```text\n{text}\n```" for name, text in helps().items()
        )
        + "\n"
    )


def helps() -> dict[str, str]:
    """Return the `--help` of every command, with a group before its commands."""
    context = click.Context(
        main, info_name="posefit", terminal_width=WIDTH, **main.context_settings
    )
    return {
        inner.command_path: inner.command.get_help(inner)
        for inner in _contexts(context)
    }


def _contexts(context: click.Context) -> Iterator[click.Context]:
    yield context
    command = context.command
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            inner = command.get_command(context, name)
            assert inner is not None
            yield from _contexts(type(context)(inner, parent=context, info_name=name))
