"""Groups of commands."""

from collections.abc import Iterator
from difflib import get_close_matches
from typing import Any

import click

from posefit.reading import cut, quoted
from posefit.registry import KINDS


class Group(click.Group):
    """A group that suggests the nearest of its commands for an unknown name.

    A command of exactly that name in another group is suggested, too. For a kind of
    plugin, such as `optimisers`, `posefit` suggests the command that lists them.
    """

    def resolve_command(self, context: click.Context, args: list[str]) -> Any:
        """Return the command that the first word names.

        Raises:
            click.UsageError: There is no such command.
        """
        if args[0][:1].isalnum() and self.get_command(context, args[0]) is None:
            root = context.find_root()
            every = dict(_paths(root.command, root, "posefit"))
            known = dict(_paths(self, context, _path_of(context)))
            if context is root:
                kinds = (f"{kind}s" for kind in (*KINDS, "method"))
                known = dict.fromkeys(kinds, "posefit plugins") | known
            elif args[0] in every:
                known[args[0]] = every[args[0]]
            near = get_close_matches(cut(args[0]), known, 1)
            hint = f"see {_path_of(context)} --help"
            if near:
                hint = f"did you mean {known[near[0]]!r}?"
            raise click.UsageError(f"No such command {quoted(args[0])}; {hint}")
        return super().resolve_command(context, args)


def _path_of(context: click.Context) -> str:
    """Return the full path of a group: `posefit`, or `posefit suite`."""
    names = list[str]()
    outer = context
    while outer.parent is not None:
        names.insert(0, str(outer.info_name))
        outer = outer.parent
    return " ".join(["posefit", *names])


def _paths(
    command: click.Command, context: click.Context, path: str
) -> Iterator[tuple[str, str]]:
    """Yield name and full path of all commands below one, outer commands last.

    So in a dictionary of these pairs an outer command wins over an inner one.
    """
    if isinstance(command, click.Group):
        for name in command.list_commands(context):
            if below := command.get_command(context, name):
                yield from _paths(below, context, f"{path} {name}")
        for name in command.list_commands(context):
            yield name, f"{path} {name}"
