"""Orders of methods that publications claim. A plugin offers one, and a report says how it came out in a sweep.

A plugin that has one names a module in the entry-point group `posefit.claims`, beside the group `posefit` of what
`posefit.hooks` describes: a report imports every module of this group, and nothing else of a plugin.

    from posefit import hookimpl
    from posefit.claims import ClaimedOrder

    @hookimpl
    def posefit_register_claims(register):
        register(ClaimedOrder("my paper", "searching beats drawing at random", ("random@pca", "mine@pca")))
"""

import os
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from pluggy import HookspecMarker

from posefit import entries
from posefit.entries import PROJECT, Plugin

CLAIMS_GROUP = "posefit.claims"
hookspec = HookspecMarker(PROJECT)


@dataclass(frozen=True)
class ClaimedOrder:
    """What a publication says of methods: each of them is beaten by the next.

    Raises ValueError where there are fewer than two methods, or one is there twice.
    """

    source: str  # how a report calls the publication: "the SAPSO paper"
    said: str  # what it says, as the second half of a sentence
    methods: tuple[str, ...]  # worst first, by the names that plans have for them

    def __post_init__(self) -> None:
        if len(set(self.methods)) != len(self.methods) or len(self.methods) < 2:
            raise ValueError(f"methods must be at least two that differ, got {', '.join(self.methods) or 'none'}")


@hookspec
def posefit_register_claims(register: Callable[[ClaimedOrder], None]) -> Any:
    """Call `register(order)` for each order of methods that a publication claims."""


def claimed_orders() -> tuple[ClaimedOrder, ...]:
    """Return what all installed plugins say that publications claim."""
    return tuple(order for plugin in claiming() for order in plugin.offers)


@lru_cache(maxsize=1)
def claiming() -> tuple[Plugin[ClaimedOrder], ...]:
    """Return what became of all installed plugins with claims."""
    return claims_of(entry_points(group=CLAIMS_GROUP))


def claims_of(
    points: Iterable[EntryPoint], variables: Mapping[str, str] = os.environ
) -> tuple[Plugin[ClaimedOrder], ...]:
    """Return what became of the plugins behind entry points; see `posefit.entries.load`."""
    return entries.load(points, sys.modules[__name__], _claimed, order_name, variables)


def order_name(order: ClaimedOrder) -> str:
    """Return how lists and errors name an order."""
    return f"claim {order.source!r} of {', '.join(order.methods)}"


def _claimed(hooks: Any, _distribution: str, _version: str) -> Iterator[ClaimedOrder]:
    mine: list[ClaimedOrder] = []

    def register(order: ClaimedOrder) -> None:
        if not isinstance(order, ClaimedOrder):
            raise TypeError(f"a claim must be a ClaimedOrder, got {order!r}")
        mine.append(order)

    hooks.posefit_register_claims(register=register)
    yield from mine
