"""Every setting of every built-in stands in its factory's docstring, in the list that the handbook is made from."""

import re
from collections.abc import Callable
from typing import Any

import pytest

from posefit.fitting.tracker import Prediction
from posefit.hooks import PROJECT
from posefit.registry import registry
from posefit.settings import settings_of

ENTRY = re.compile(r"(?P<name>[a-z_]+)(?: \((?P<letter>[^)]+)\))?: \S.*\.")
BUILT_IN = [
    pytest.param(offer.factory, id=f"{kind} {name}")
    for kind, offers in registry().offers.items()
    for name, offer in offers.items()
    if offer.distribution == PROJECT
]


def listed(factory: Callable[..., Any]) -> list[str]:
    """Return the lines below `Settings:`, up to the next line that is no farther to the right."""
    lines = iter((factory.__doc__ or "").splitlines())
    for line in lines:
        if line == "    Settings:":
            break
    found = []
    for line in lines:
        if not line.startswith(8 * " "):
            break
        found.append(line[8:])
    return found


@pytest.mark.parametrize("factory", [*BUILT_IN, pytest.param(Prediction, id="tracker")])
def test_every_setting_is_listed_in_its_order_and_nothing_else_is(factory: Callable[..., Any]) -> None:
    entries = [ENTRY.fullmatch(line) for line in listed(factory)]
    assert all(entries), listed(factory)
    assert [entry["name"] for entry in entries if entry] == [one.name for one in settings_of(factory)]


def test_built_ins_are_looked_at() -> None:
    assert len(BUILT_IN) > 12
