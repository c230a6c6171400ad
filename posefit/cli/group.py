"""Groups of commands."""

from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any

import click

from posefit.reading import cut, quoted
from posefit.registry import KINDS


class Group(click.Group):
    """For a name that is no command of it, it names the nearest of all commands of posefit, wherever that is.

    For what plugins offer, such as `optimisers`, that is the command that lists them.
    """

    def resolve_command(self, context: click.Context, args: list[str]) -> Any:
        """Return the command that the first word names. Raises click.UsageError where it names none."""
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
    """Yield the name of each command below one, and what to type for it; of two of a name the outer one comes last."""
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            if below := command.get_command(context, name):
                yield from _paths(below, context, f"{path} {name}")
        for name in command.list_commands(context):
            yield name, f"{path} {name}"
