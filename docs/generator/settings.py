"""The page of the settings: every optimiser, prior and tracker that posefit brings, read from the code."""

import inspect

from generator.prose import Entry, settings_in, without_settings
from posefit.entries import PROJECT
from posefit.registry import KINDS, Offer, registry


def page() -> str:
    """Return the lists of all kinds, as Markdown."""
    offers = registry().offers
    parts = []
    for kind in KINDS:
        mine = [offer for offer in offers[kind].values() if offer.distribution == PROJECT]
        parts += [f"## {kind.capitalize()}s", *map(_method, mine)]
    return "\n\n".join(parts) + "\n"


def _method(offer: Offer) -> str:
    text = inspect.getdoc(offer.factory) or ""
    needs = "" if offer.needs is None else f"\n\nIt needs a library: `python -m pip install '{offer.needs[1]}'`."
    said = settings_in(text)
    return f"### `{offer.name}`\n\n{without_settings(text)}{needs}\n\n{_table(offer, said)}"


def _table(offer: Offer, said: dict[str, Entry]) -> str:
    if not offer.settings:
        return "It has no settings."
    lines = ["| `--set` | symbol | type | default | meaning and source |", "|---|---|---|---|---|"]
    for setting in offer.settings:
        symbol, meaning = said.get(setting.name, Entry("", ""))
        default = "" if setting.default is inspect.Parameter.empty else f"`{_shown(setting.default)}`"
        cells = [f"`{offer.name}.{setting.name}`", symbol, setting.type, default, meaning or "see the text above"]
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines)


def _shown(value: object) -> str:
    """Return a default as `--set` takes it."""
    if isinstance(value, bool) or value is None:
        return str(value).lower()
    return '""' if value == "" else str(value)
