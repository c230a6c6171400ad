"""Finds plugins and what they offer. A broken plugin costs one warning; the others work on."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Literal

import pluggy

from posefit import hooks
from posefit.fitting.optimiser import OptimiserFactory
from posefit.fitting.prior import PriorFactory

Kind = Literal["optimiser", "prior"]


@dataclass(frozen=True)
class Offer:
    """One registered name."""

    kind: Kind
    name: str
    factory: Callable[..., Any] = field(repr=False)
    distribution: str
    version: str

    @property
    def summary(self) -> str:
        """The first line of the factory's docstring."""
        return (self.factory.__doc__ or "").strip().split("\n")[0]


@dataclass(frozen=True)
class Registry:
    """Everything that plugins registered, by kind and name."""

    offers: Mapping[Kind, Mapping[str, Offer]]

    def optimiser(self, name: str) -> OptimiserFactory:
        """Return the optimiser factory of a name. Raises ValueError listing the known names."""
        factory: OptimiserFactory = self._find("optimiser", name)
        return factory

    def prior(self, name: str) -> PriorFactory:
        """Return the prior factory of a name. Raises ValueError listing the known names."""
        factory: PriorFactory = self._find("prior", name)
        return factory

    def _find(self, kind: Kind, name: str) -> Any:
        known = self.offers[kind]
        if name not in known:
            near = get_close_matches(name, known, 1)
            hint = f"; did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{kind} must be one of {', '.join(sorted(known))}, got {name!r}{hint}")
        return known[name].factory


@lru_cache(maxsize=1)
def registry() -> Registry:
    """Return what all installed plugins offer; they are loaded once a process."""
    return load(entry_points(group=hooks.PROJECT))


def load(points: Iterable[EntryPoint]) -> Registry:
    """Return what the plugins behind these entry points offer.

    Each plugin that cannot be imported, misspells a hook, fails inside one or takes a name that is taken is warned
    of, with its distribution, and left out.
    """
    offers: dict[Kind, dict[str, Offer]] = {"optimiser": {}, "prior": {}}
    for point in sorted(points, key=_built_ins_first):
        distribution, version = (point.dist.name, point.dist.version) if point.dist else ("unknown", "")
        try:
            mine = [Offer(*one, distribution, version) for one in _registered(point)]
            for offer in mine:
                if offer.name in offers[offer.kind]:
                    owner = offers[offer.kind][offer.name].distribution
                    raise ValueError(f"{offer.kind} {offer.name!r} is already registered by {owner}")
        except Exception as error:  # whatever a plugin does, the others must work
            warnings.warn(
                f"plugin {point.name!r} of {distribution} {version} is left out: {type(error).__name__}: {error}",
                stacklevel=2,
            )
            continue
        for offer in mine:
            offers[offer.kind][offer.name] = offer
    return Registry(offers)


def _built_ins_first(point: EntryPoint) -> tuple[bool, str]:
    return point.dist is None or point.dist.name != hooks.PROJECT, point.name


def _registered(point: EntryPoint) -> list[tuple[Kind, str, Callable[..., Any]]]:
    """Return (kind, name, factory) of everything one plugin registers."""
    manager = pluggy.PluginManager(hooks.PROJECT)
    manager.add_hookspecs(hooks)
    manager.register(point.load(), point.name)
    manager.check_pending()
    mine: list[tuple[Kind, str, Callable[..., Any]]] = []
    manager.hook.posefit_register_optimisers(register=lambda name, make: mine.append(("optimiser", name, make)))
    manager.hook.posefit_register_priors(register=lambda name, make: mine.append(("prior", name, make)))
    return mine
