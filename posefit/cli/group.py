"""Groups of commands."""

from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any

import click

from posefit.reading import cut, quoted
from posefit.registry import KINDS


class Group(click.Group):
    """A group that suggests the nearest of all posefit commands for an unknown name.

    For a kind of plugin, such as `optimisers`, it suggests the command that lists them.
    """

    def resolve_command(self, context: click.Context, args: list[str]) -> Any:
        """Return the command that the first word names.

        Raises:
            click.UsageError: there is no such command.
        """
        if args[0][:1].isalnum() and self.get_command(context, args[0]) is None:
            root = context.find_root()
            listed = dict.fromkeys(
                (f"{kind}s" for kind in (*KINDS, "method")), "posefit plugins"
            )
            known = listed | dict(_paths(root.command, root, "posefit"))
            near = get_close_matches(cut(args[0]), known, 1)
            hint = f"; did you mean {known[near[0]]!r}?" if near else ""
            raise click.UsageError(f"No such command {quoted(args[0])}{hint}")
        return super().resolve_command(context, args)


def _paths(
    command: click.Command, context: click.Context, path: str
) -> Iterator[tuple[str, str]]:
    """Yield name and full path of all commands below one, outer commands last.

    In a dictionary of these pairs, an outer command so wins over an inner one.
    """
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            if below := command.get_command(context, name):
                yield from _paths(below, context, f"{path} {name}")
        for name in command.list_commands(context):
            yield name, f"{path} {name}"
