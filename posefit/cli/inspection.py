"""What is installed, and what is wrong with it."""

import os
import shutil
import textwrap
from collections.abc import Iterator, Sequence
from inspect import Parameter
from typing import Any

import click

from posefit.entries import BLOCK, LOAD, STRICT, Plugin
from posefit.registry import KINDS, Kind, Offer, Registry, registry
from posefit.settings import parse
from posefit.testing import Report, optimiser_checks, prior_checks, run_checks, tracker_checks


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


def diagnosis(found: Registry, added: Sequence[Plugin[click.Command]] = ()) -> tuple[list[str], bool]:
    """Return what `posefit plugins doctor` says, and whether all is well; `added` are the plugins with commands."""
    lines = [f"{name}={os.environ[name]!r}" for name in (LOAD, BLOCK, STRICT) if name in os.environ]
    for plugin in found.plugins:
        names = ", ".join(f"{offer.kind} {offer.name}" for offer in plugin.offers) or "nothing"
        lines.append(_state(plugin, plugin.cause or f"offers {names}"))
        for offer in plugin.offers:
            if offer.missing:
                lines.append(f"          {offer.name} is not usable yet: python -m pip install '{offer.missing}'")
            if not offer.summary:
                lines.append(f"          {offer.name} has no docstring to be listed with")
    for more in added:
        names = ", ".join(f"command {command.name}" for command in more.offers) or "nothing"
        lines.append(_state(more, more.cause or f"offers {names}"))
    states = [*(plugin.state for plugin in found.plugins), *(plugin.state for plugin in added)]
    well = "broken" not in states
    lines.append("all plugins work" if well else "broken plugins are left out; the others work")
    return lines, well


def _state(plugin: Plugin[Any], said: str) -> str:
    return f"{plugin.state:8}  {plugin.name} ({plugin.distribution} {plugin.version}): {said}"


def checked(kind: Kind, name: str, texts: Sequence[str]) -> Report:
    """Return what the checks say of an installed plugin, with settings given as `SETTING=VALUE`."""
    offer = registry().offer(kind, name)
    given = {}
    for text in texts:
        setting, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"--set must be SETTING=VALUE such as particles=20, got {text!r}")
        given[setting.rpartition(".")[2]] = value
    settings = parse(offer.name, offer.factory, given)
    if kind == "prior" and settings:
        offer.factory(**settings)  # a value that makes no sense is one mistake, not one a check
    checks = {
        "optimiser": lambda: optimiser_checks(offer.factory, next_frame=offer.next_frame, settings=settings),
        "prior": lambda: prior_checks(offer.factory, settings=settings),
        "tracker": lambda: tracker_checks(offer.factory, settings=settings),
    }[kind]()
    return run_checks(offer.label, checks)
