"""Every setting of every built-in stands in its factory's docstring, in the list that the handbook is made from."""

import re
from collections.abc import Callable
from typing import Any

from posefit.fitting.tracker import Prediction
from posefit.hooks import PROJECT
from posefit.registry import registry
from posefit.settings import settings_of

ENTRY = re.compile(r"(?P<name>[a-z_]+)(?: \((?P<letter>[^)]+)\))?: \S.*\.")


def listed(factory: Callable[..., Any]) -> list[str]:
    """Return the lines below `Settings:`, up to the next line that is no farther to the right."""
    lines = iter((factory.__doc__ or "").splitlines())
    for line in lines:
        if line == "    Settings:":
            break
    entries = []
    for line in lines:
        if not line.startswith(8 * " "):
            break
        entries.append(line[8:])
    return entries


def test_every_setting_is_listed_in_its_order_and_nothing_else_is() -> None:
    offers = [offer for of_kind in registry().offers.values() for offer in of_kind.values()]
    factories = [offer.factory for offer in offers if offer.distribution == PROJECT]
    assert len(factories) > 12
    for factory in (*factories, Prediction):
        entries = [ENTRY.fullmatch(line) for line in listed(factory)]
        assert all(entries), (factory, listed(factory))
        assert [entry["name"] for entry in entries if entry] == [one.name for one in settings_of(factory)], factory
