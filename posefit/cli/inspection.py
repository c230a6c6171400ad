"""Texts of `posefit plugins`: the installed plugins, and their faults."""

import os
import shutil
import textwrap
from collections.abc import Iterable, Iterator
from inspect import Parameter, getdoc
from typing import Any

from posefit.errors import InputError
from posefit.hooks import PROJECT
from posefit.reading import quoted, suggestion
from posefit.registry import BLOCK, COMMAND, KINDS, Offer, Plugin, Registry
from posefit.settings import Setting, settings_in, without_settings


def described(offer: Offer) -> dict[str, Any]:
    """Return an offer in the form of `posefit plugins --json`."""
    settings = []
    for setting in offer.settings:
        default = setting.default
        if default is Parameter.empty:
            default = None
        settings.append(
            {"name": setting.name, "type": setting.type, "default": default}
        )
    if offer.kind == "optimiser":
        more = {"next_frame": offer.next_frame}
    else:
        more = {}
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


def listing(registry: Registry) -> Iterator[str]:
    """Yield the lines of `posefit plugins`."""
    for kind in KINDS:
        for offer in registry.offers[kind].values():
            yield _head(offer)
            yield from _wrapped(offer.summary, 4 * " ", 4 * " ")
            yield from _wrapped(
                ", ".join(map(_typed, offer.settings)), "    --set ", 10 * " "
            )


def explanation(registry: Registry, name: str) -> Iterator[str]:
    """Yield the lines of `posefit plugins show`, for every plugin with the name.

    Raises:
        InputError: There is none; the message lists the known names.
    """
    offers: list[Offer] = []
    for kind in KINDS:
        offers += registry.offers[kind].values()
    named = [offer for offer in offers if offer.name == name]
    if not named:
        known = sorted({offer.name for offer in offers})
        raise InputError(
            f"plugin must be one of {', '.join(known)}, "
            f"got {quoted(name)}{suggestion(name, known)}"
        )
    for offer in named:
        text = getdoc(offer.factory) or ""
        listed = settings_in(text)
        yield _head(offer)
        for line in without_settings(text).splitlines():
            yield f"    {line}".rstrip()
        if not offer.settings:
            yield "    It has no settings."
        for setting in offer.settings:
            yield f"    --set {name}.{_typed(setting)}"
            symbol, meaning = listed.get(setting.name, ("", ""))
            yield from _wrapped(
                f"({symbol}) {meaning}" if symbol else meaning, 8 * " ", 8 * " "
            )


def _head(offer: Offer) -> str:
    missing = ""
    if offer.missing:
        missing = f" [not installed: python -m pip install '{offer.missing}']"
    return f"{offer.kind} {offer.name} ({offer.distribution} {offer.version}){missing}"


def _typed(setting: Setting) -> str:
    """Return a setting with its type or choices, and its default."""
    if setting.default is Parameter.empty:
        default = ""
    else:
        default = f" = {setting.default}"
    return f"{setting.name}: {setting.type}{default}"


def _wrapped(text: str, first: str, other: str) -> list[str]:
    width = min(shutil.get_terminal_size((100, 24)).columns, 120)
    return textwrap.wrap(text, width, initial_indent=first, subsequent_indent=other)


def diagnosis(
    plugins: Iterable[Plugin], verbose: bool = False
) -> tuple[list[str], bool]:
    """Return the lines of `posefit plugins doctor`, and whether all is well.

    Args:
        plugins: The plugins.
        verbose: Whether to add the traceback of a broken plugin.
    """
    lines = []
    if BLOCK in os.environ:
        lines.append(f"{BLOCK}={os.environ[BLOCK]!r}")
    states = set[str]()
    for plugin in plugins:
        offered = [f"{offer.kind} {offer.name}" for offer in plugin.offers]
        offered += [f"{COMMAND} {command.name}" for command in plugin.commands]
        state: str = plugin.state
        # a plugin without a marked hook loads without an error, and does nothing
        if state == "loaded" and not offered:
            state = "empty"
        states.add(state)
        # an error's message may have several lines
        cause = " ".join(plugin.cause.split()) or f"offers {', '.join(offered)}"
        if state == "empty":
            cause = (
                "registers nothing: a hook such as posefit_register_optimisers "
                "needs the decorator @hookimpl"
            )
        release = f"{plugin.distribution} {plugin.version}"
        lines.append(f"{state:8}  {plugin.name} ({release}): {cause}")
        if verbose:
            for traced in plugin.traceback.splitlines():
                lines.append(f"          {traced}")
        for offer in plugin.offers:
            if offer.missing:
                lines.append(
                    f"          {offer.name} is not usable yet: "
                    f"python -m pip install '{offer.missing}'"
                )
            if not offer.summary:
                lines.append(f"          {offer.name} has no docstring for the list")
            # posefit's own plugins are checked by its tests
            if not offer.missing and plugin.distribution != PROJECT:
                lines.append(f"          next: posefit check {offer.kind} {offer.name}")
    hint = "" if verbose else "; -v shows where they fail"
    if "broken" in states:
        lines.append(f"broken plugins are left out; the others are loaded{hint}")
    elif "empty" in states:
        lines.append("all plugins are loaded, but not all offer something")
    else:
        lines.append("all plugins work")
    return lines, not states & {"broken", "empty"}
