"""Commands that plugins add to `posefit`.

A plugin that has one names a module in the entry-point group `posefit.commands`, beside the group `posefit` of what
`posefit.hooks` describes: `posefit --help` imports every module of this group, and nothing else of a plugin, so such a
module imports at its top what it needs to describe its commands, and the rest where they run.

    import click
    from posefit import hookimpl

    @click.command()
    @click.argument("name")
    def greet(name):
        '''Greet somebody.'''
        click.echo(f"hello, {name}")

    @hookimpl
    def posefit_register_commands(register):
        register(greet)

A ValueError, an ImportError or a missing file is told the user in one line, with exit status 2.
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

import click
from pluggy import HookspecMarker

from posefit import entries
from posefit.entries import PROJECT, Plugin

GROUP = "posefit.commands"
hookspec = HookspecMarker(PROJECT)


@hookspec
def posefit_register_commands(register: Callable[[click.Command], None]) -> Any:
    """Call `register(command)` for each command, a `click.Command` or a group of them."""


@lru_cache(maxsize=1)
def installed(taken: tuple[str, ...] = ()) -> tuple[Plugin[click.Command], ...]:
    """Return what became of all installed plugins with commands; `taken` are the names of posefit's own commands."""
    return commands_of(entry_points(group=GROUP), taken)


def commands_of(
    points: Iterable[EntryPoint], taken: Iterable[str] = (), variables: Mapping[str, str] = os.environ
) -> tuple[Plugin[click.Command], ...]:
    """Return what became of the plugins behind entry points; see `posefit.entries.load`."""
    own = {_named(click.Command(name)): PROJECT for name in taken}
    return entries.load(points, sys.modules[__name__], _registered, _named, variables, own)


def _named(command: click.Command) -> str:
    return f"command {command.name!r}"


def _registered(hooks: Any, _distribution: str, _version: str) -> Iterator[click.Command]:
    mine: list[click.Command] = []

    def register(command: click.Command) -> None:
        if not isinstance(command, click.Command) or not command.name:
            raise TypeError(f"a command must be a click.Command with a name, got {command!r}")
        mine.append(command)

    hooks.posefit_register_commands(register=register)
    yield from mine
