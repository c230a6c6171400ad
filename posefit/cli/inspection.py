"""What is installed, and what is wrong with it."""

import os
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from inspect import Parameter
from typing import Any

import click

from posefit.claims import ClaimedOrder, order_name
from posefit.entries import BLOCK, LOAD, STRICT, Plugin
from posefit.registry import KINDS, Offer, Registry


def described(offer: Offer) -> dict[str, Any]:
    """Return what `posefit plugins --json` says of an offer."""
    settings = [
        {"name": one.name, "type": one.type, "default": None if one.default is Parameter.empty else one.default}
        for one in offer.settings
    ]
    more = {"next_frame": offer.next_frame} if offer.kind == "optimiser" else {}
    return {
        "kind": offer.kind,
        "name": offer.name,
        "distribution": offer.distribution,
        "version": offer.version,
        "summary": offer.summary,
        "install": offer.missing,
        **more,
        "settings": settings,
    }


def listing(found: Registry) -> Iterator[str]:
    """Yield the lines of `posefit plugins`."""
    width = min(shutil.get_terminal_size((100, 24)).columns, 120)
    for kind in KINDS:
        for offer in found.offers[kind].values():
            missing = f" [not installed: python -m pip install '{offer.missing}']" if offer.missing else ""
            yield f"{kind} {offer.name} ({offer.distribution} {offer.version}){missing}"
            yield from textwrap.wrap(offer.summary, width, initial_indent="    ", subsequent_indent="    ")
            settings = ", ".join(
                f"{one.name}: {one.type}" + ("" if one.default is Parameter.empty else f" = {one.default}")
                for one in offer.settings
            )
            yield from textwrap.wrap(settings, width, initial_indent="    --set ", subsequent_indent="          ")


def diagnosis(
    found: Registry,
    added: Sequence[Plugin[click.Command]] = (),
    claiming: Sequence[Plugin[ClaimedOrder]] = (),
    verbose: bool = False,
) -> tuple[list[str], bool]:
    """Return what `posefit plugins doctor` says, and whether all is well.

    `added` are the plugins with commands, and `claiming` those with claims of publications. Where it is to be
    `verbose`, the traceback of what could not be loaded follows its line.
    """
    lines = [f"{name}={os.environ[name]!r}" for name in (LOAD, BLOCK, STRICT) if name in os.environ]
    for plugin in found.plugins:
        names = ", ".join(f"{offer.kind} {offer.name}" for offer in plugin.offers) or "nothing"
        lines += _state(plugin, f"offers {names}", verbose)
        for offer in plugin.offers:
            if offer.missing:
                lines.append(f"          {offer.name} is not usable yet: python -m pip install '{offer.missing}'")
            if not offer.summary:
                lines.append(f"          {offer.name} has no docstring to be listed with")
    for more in added:
        names = ", ".join(f"command {command.name}" for command in more.offers) or "nothing"
        lines += _state(more, f"offers {names}", verbose)
    for one in claiming:
        names = "; ".join(map(order_name, one.offers)) or "nothing"
        lines += _state(one, f"offers {names}", verbose)
    groups: tuple[Sequence[Plugin[Any]], ...] = (found.plugins, added, claiming)
    well = all(plugin.state != "broken" for group in groups for plugin in group)
    more_told = "" if verbose else "; -v shows where they fail"
    lines.append("all plugins work" if well else f"broken plugins are left out; the others work{more_told}")
    return lines, well


def _state(plugin: Plugin[Any], offers: str, verbose: bool) -> list[str]:
    cause = " ".join(plugin.cause.split())  # on one line, whatever the error says
    said = f"{plugin.state:8}  {plugin.name} ({plugin.distribution} {plugin.version}): {cause or offers}"
    return [said, *(f"          {line}" for line in plugin.traceback.splitlines() if verbose)]
