"""The list of settings of everything that a plugin of posefit registers.

It is read from the code. Optimisers that only adapt a library are listed by name.
"""

import inspect
from collections.abc import Callable
from typing import Any

from posefit.fitting.synthesis import Prediction
from posefit.hooks import PROJECT
from posefit.registry import KINDS, Offer, registry
from posefit.settings import setting_text, settings_in, settings_of, without_settings

ADAPTERS = "Each needs a library: `python -m pip install 'posefit[NAME]'`."


def page() -> str:
    """Return the lists of all kinds, as Markdown."""
    offers = registry().offers
    parts = []
    for kind in KINDS:
        mine = [
            offer for offer in offers[kind].values() if offer.distribution == PROJECT
        ]
        adapters = [
            offer for offer in mine if kind == "optimiser" and offer.needs is not None
        ]
        parts += [
            f"## {kind.capitalize()}s",
            *(_method(offer) for offer in mine if offer not in adapters),
        ]
        if adapters:
            names = ", ".join(f"`{offer.name}`" for offer in adapters)
            parts += [
                "### Adapters of libraries",
                f"{names}: `posefit plugins show NAME` has their settings. {ADAPTERS}",
            ]
    return "\n\n".join(parts) + "\n"


def tracker() -> str:
    """Return the settings of the tracker that drives an optimiser and a prior."""
    return _described("tracker", Prediction) + "\n"


def _method(offer: Offer) -> str:
    needs = ""
    if offer.needs is not None:
        package = offer.needs[1]
        needs = f"\n\nIt needs a library: `python -m pip install '{package}'`."
    return f"### `{offer.name}`\n\n{_described(offer.name, offer.factory, needs)}"


def _described(name: str, factory: Callable[..., Any], more: str = "") -> str:
    """Return the first paragraph of a method's docstring and the list of its settings.

    Raises KeyError if the docstring lacks a setting.
    """
    text = inspect.getdoc(factory) or ""
    listed = settings_in(text)
    settings = settings_of(factory)
    if not settings:
        return f"{text}{more}\n\nIt has no settings."
    lines = []
    for setting in settings:
        symbol, meaning = listed[setting.name]
        default = ""
        if setting.default is not inspect.Parameter.empty:
            default = f"={setting_text(setting.default)}"
        letter = f" ({symbol})" if symbol else ""
        lines.append(f"- `{name}.{setting.name}{default}`{letter}: {meaning}")
    summary = without_settings(text).split("\n\n")[0]
    return f"{summary}{more}\n\n" + "\n".join(lines)
